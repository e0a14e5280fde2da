"""The reference machine with its arm led by the velocity loops: what the optimal control is computed on.

The equations are the machine's own (fmus/equations, fmus/models/machine) with the parameters of one machine
draw, as perfect knowledge has them.  Three things are simpler, so that a collocation of 15 s stays small:

    arm      q''_boom = (limited reference - q'_boom) / lag: the arm follows its velocity loops exactly;
             slew, pitch and roll feel it through the rows of the full mass matrix
    pump     its pressure is the one it aims at, less a share of its droop
    brake    released: a run's first command releases it before the spool opens

What is left out shows when a command is run on the whole machine (`resimulate`): that figure counts.
States in the order of `STATES`; pressures there in units of PRESSURE.  Inputs act without their delays.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from fmus.equations import multibody, slew_drive
from fmus.models.machine import arm_hydraulics, dynamics
from specs import parameters

PRESSURE = 1e7  # Pa, unit of the pressures among the states
DROOP_SHARE = 0.2  # of the pump's droop, at the flow that the slew drive takes
FILES = ("geometry", "slew", "machine")
DRIVE = ("slew", "slew_rate", "spool", "relief", "p_a", "p_b")
TOOL = ("pitch", "roll", "pitch_rate", "roll_rate")
ARM = ("boom", "stick", "boom_rate", "stick_rate")
STATES = (*DRIVE, *TOOL, *ARM)
FREE = (multibody.SLEW, multibody.PITCH, multibody.ROLL)
LED = (multibody.BOOM, multibody.STICK)


@dataclass(frozen=True)
class Plant:
    """One machine: nominal parameters with `overrides` (SI, by name, as `specs.draws` gives them)."""

    overrides: Mapping[str, float]

    @cached_property
    def p(self) -> SimpleNamespace:
        """All parameters of the machine by name."""
        values = {name: q.value for name, q in parameters.load(*FILES).items()}
        return SimpleNamespace(**(values | dict(self.overrides)))

    @cached_property
    def arm(self) -> SimpleNamespace:
        """How the arm follows its velocity references, as the nominal arm is calibrated."""
        return SimpleNamespace(**{name: q.value for name, q in parameters.load("arm").items()})

    @cached_property
    def rates(self) -> ca.Function:
        """(x [14], u [3]) -> dx/dt [14]; u: slew joystick, boom and stick velocity reference (rad/s)."""
        x, u = ca.SX.sym("x", len(STATES)), ca.SX.sym("u", 3)  # type: ignore[call-arg]
        values = self._rates(SimpleNamespace(**{n: x[i] for i, n in enumerate(STATES)}), u)
        return ca.Function("rates", [x, u], [ca.cse(ca.vertcat(*(values[n] for n in STATES)))])

    def rest(self, boom: float, stick: float) -> np.ndarray:
        """State [14] at rest at slew angle 0 with the tool hanging (level ground)."""
        boost = self.p.slew_boost_pressure / PRESSURE
        values = {"boom": boom, "stick": stick, "p_a": boost, "p_b": boost}
        return np.array([values.get(name, 0.0) for name in STATES])

    def _rates(self, x: SimpleNamespace, u: Any) -> dict[str, Any]:
        p, p_a, p_b, relief = self.p, x.p_a * PRESSURE, x.p_b * PRESSURE, x.relief * PRESSURE
        flows = slew_drive.flows(x.spool, relief, p_a, p_b, p, self._supply(x.spool))
        rate_a, rate_b = slew_drive.pressure_rates(flows, p_a, p_b, x.slew_rate, p)
        led = [self._follow(x, joint, u[i + 1]) for i, joint in enumerate(("boom", "stick"))]
        free = self._mechanics(x, p_a, p_b, ca.vertcat(*led))
        return {
            "slew": x.slew_rate,
            "slew_rate": free[0],
            "spool": slew_drive.spool_rate(u[0], x.spool, p),
            "relief": slew_drive.relief_rate(p_a, p_b, relief, p) / PRESSURE,
            "p_a": rate_a / PRESSURE,
            "p_b": rate_b / PRESSURE,
            "pitch": x.pitch_rate,
            "roll": x.roll_rate,
            "pitch_rate": free[1],
            "roll_rate": free[2],
            "boom": x.boom_rate,
            "stick": x.stick_rate,
            "boom_rate": led[0],
            "stick_rate": led[1],
        }

    def _supply(self, spool: Any) -> Any:
        load = dynamics.slew_load_pressure(spool, self.p)
        return arm_hydraulics.set_pressure([load], self.p) - DROOP_SHARE * self.p.pump_droop

    def _follow(self, x: SimpleNamespace, joint: str, reference: Any) -> Any:
        """rad/s2 of a led joint: the share it makes up in a step of 0.02 s, as a lag."""
        lag = -0.02 / np.log(1 - getattr(self.arm, f"{joint}_response"))
        return (reference - getattr(x, f"{joint}_rate")) / lag

    def _mechanics(self, x: SimpleNamespace, p_a: Any, p_b: Any, led: Any) -> ca.SX:
        """Accelerations of slew, pitch and roll (rad/s2) with those of boom and stick given."""
        p = self.p
        angles = [x.slew, x.boom, x.stick, x.pitch, x.roll]
        speeds = [x.slew_rate, x.boom_rate, x.stick_rate, x.pitch_rate, x.roll_rate]
        motion = multibody.motion(angles, speeds, p)
        mass, c = multibody.equations_of_motion(motion, multibody.gravity_in_s(x.slew, p))
        inertia = mass[multibody.SLEW, multibody.SLEW]
        torque = slew_drive.torque(p_a, p_b, x.slew_rate, inertia, 1.0, p)
        mass[multibody.SLEW, multibody.SLEW] = inertia + p.slew_inertia_extra
        pitch_inertia, roll_inertia = dynamics.tool_inertias(p)
        swing = x.pitch_rate + x.boom_rate + x.stick_rate
        damping_pitch = p.grab_damping_pitch * pitch_inertia * swing
        damping_roll = p.grab_damping_roll * roll_inertia * x.roll_rate
        active = ca.vertcat(torque, -damping_pitch, -damping_roll)
        free, led_rows = list(FREE), list(LED)
        right = active - c[free] - mass[free, led_rows] @ led
        return multibody.solve(ca.cse(mass[free, free]), right)
