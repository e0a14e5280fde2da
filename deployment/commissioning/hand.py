"""How the simulated operator brings the grab to a place by the joysticks, looking at where it truly is."""

import math
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from deployment.commissioning.operator import Answering
from deployment.commissioning.points import JOINTS
from fmus.equations import kinematics
from runtime.image import TICK_S

KNOWN = ((9.0, 2.0, 3.0), (7.0, -3.0, 5.0), (11.0, -2.0, 4.0), (9.5, 4.0, 6.0))  # in its yard
BAND, MORE, MOST = 0.2, 0.8, 0.4  # joystick that moves an axis, more of it per rad, largest
LEAD_S = {"q_slew": 1.2, "q_boom": 0.4, "q_stick": 0.4}  # by which an axis goes on
NEAR_RAD = 0.004
PATIENCE_S, STILL_S = 60.0, 8.4  # for the way; for a look at where the grab swings about
LOOKS = 6  # at where the grab hangs, each followed by a correction
NEAR_M = 0.08  # to which a hand brings it


class Machine(Protocol):
    """What the hand works with: where the machine truly is, and its joysticks."""

    joystick: dict[str, float]

    @property
    def true(self) -> Mapping[str, float]:
        """Outputs of the machine, those beginning with `true_` among them."""
        ...


def bring(machine: Machine, place: tuple[float, float, float]) -> Answering:
    """Bring the grab's centre there; "yes", or "no" where it does not get there."""
    aim = np.array(place)
    for _ in range(LOOKS):
        x, y, z = aim.tolist()
        wanted = [float(angle) for angle in kinematics.inverse(x, y, z, kinematics.geometry())]
        yield from _turn(machine, wanted)
        seen = []
        for _ in range(round(STILL_S / TICK_S)):
            seen.append(grab(machine))
            yield
        off = np.array(place) - np.mean(seen, axis=0)
        if float(np.linalg.norm(off)) < NEAR_M:
            return "yes"
        aim = aim + off
    return "no"


def grab(machine: Machine) -> np.ndarray:
    """Where the grab's centre truly is."""
    return np.array([machine.true[f"true_tool_{axis}"] for axis in "xyz"])


def _turn(machine: Machine, wanted: list[float]) -> Answering:
    """All axes to their angles, each by its joystick, until they rest there or patience ends."""
    for _ in range(round(PATIENCE_S / TICK_S)):
        sticks = {
            joint: _joystick(machine, joint, angle) for joint, angle in zip(JOINTS, wanted, strict=True)
        }
        for joint, value in sticks.items():
            machine.joystick[joint.replace("q_", "joystick_")] = value
        if not any(sticks.values()) and _fastest(machine) < 0.002:
            break
        yield
    for joint in JOINTS:
        machine.joystick[joint.replace("q_", "joystick_")] = 0.0
    return ""


def _joystick(machine: Machine, joint: str, wanted: float) -> float:
    rate = machine.true[f"true_{joint.replace('q_', 'qd_')}"]
    left = wanted - machine.true[f"true_{joint}"]
    ahead = left - LEAD_S[joint] * rate
    if abs(left) < NEAR_RAD or left * ahead < 0.0:
        return 0.0
    return math.copysign(min(BAND + MORE * abs(ahead), MOST), left)


def _fastest(machine: Machine) -> float:
    return max(abs(machine.true[f"true_{joint.replace('q_', 'qd_')}"]) for joint in JOINTS)
