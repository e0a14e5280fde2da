"""What a bundle's controller answers to a motion that somebody else drove: its core, given the sensors of it.

Switches and planner are put in the place of those that came: the core is armed, automatic operation is asked
for, with a target where the slew swung about, and a little to either side: a controller that rests near its
target answers least where the swing is about the target itself.  What it sends goes nowhere.
"""

import math
from collections.abc import Mapping

import numpy as np

from baselines.margins.loop import Loop, share
from deployment.commissioning.bench import hanging_height
from deployment.commissioning.rig import AXES, JOYSTICKS, MODES, Trace
from fmus.equations import kinematics
from runtime.bundle import Bundle
from runtime.control import ControlCore
from runtime.image import INPUT, OUTPUT, TICK_S, Status
from runtime.policy import open_core
from specs.errors import RunError

ENABLED, REQUESTED = 2, 4  # ticks from which the operator's switches are on
BEAT_TICKS, BEATS = 5, 251  # of the planner's heartbeat
ASIDE = (0.0, 0.01, -0.01)  # rad: controllers rest within 0.5 to 1 degree of their target
MODE = {number: text for text, number in MODES.items()}


def loops(bundle: Bundle, traces: Mapping[float, Trace], settle_s: float) -> list[Loop]:
    """The slew loop of a bundle's controller: answer over joystick at each frequency [Hz] of `traces`.

    One for each of ASIDE, by which the target is beside the mean of the swing.

    RunError where the core does not go into automatic operation on what the sensors showed.
    """
    core, settle = open_core(bundle), round(settle_s / TICK_S)
    own = {hz: share(trace["u_slew"], hz, settle_s) for hz, trace in traces.items()}
    return [
        Loop(
            np.array(
                [share(answered(core, t, settle, aside), hz, settle_s) / own[hz] for hz, t in traces.items()]
            ),
            tuple(traces),
        )
        for aside in ASIDE
    ]


def answered(core: ControlCore, trace: Trace, settle: int, aside: float = 0.0) -> np.ndarray:
    """The slew joystick [n] that the core sends on a trace.

    The target is `aside` [rad] of the mean of what is left of the trace after `settle` ticks.
    """
    core.reset()
    image, target, sent = INPUT.new(), _target(trace.part(settle), aside), np.zeros(len(trace))
    for k in range(len(trace)):
        image["value"], image["status"], image["tick"] = trace.inputs[k], trace.status[k], k
        image["age"] = np.where(trace.status[k] == Status.OK, 0, image["age"])
        for name, value in (target | _switches(k)).items():
            place = INPUT.index[name]
            image["value"][place], image["age"][place], image["status"][place] = value, 0, Status.OK
        sent[k] = core.step(image, k)["value"][OUTPUT.index["u_slew"]]
    mode = MODE[int(core.outputs["value"][OUTPUT.index["control_mode"]])]
    if mode != "automatic":
        raise RunError(
            f"controller {core.bundle.controller} does not run on the recorded sensors: it is in {mode}"
        )
    return sent


def _switches(k: int) -> dict[str, float]:
    still = dict.fromkeys(JOYSTICKS, 0.0)
    on = {"operator_enable": float(k >= ENABLED), "automatic_request": float(k >= REQUESTED)}
    beat = {"planner_heartbeat": float(k // BEAT_TICKS % BEATS)}
    return {**still, **on, **beat, "automatic_allowed": 1.0}


def _target(trace: Trace, aside: float) -> dict[str, float]:
    slew, boom, stick = (float(np.mean(trace[f"q_{axis}"])) for axis in AXES)
    slew += aside
    radius, _ = kinematics.arm_tip(boom, stick, kinematics.geometry())
    place = float(radius) * math.cos(slew), float(radius) * math.sin(slew), hanging_height(boom, stick)
    told = {"target_valid": 1.0, "target_number": 1.0, "load_told": 0.0, "pace": 1.0}
    return dict(zip(("target_x", "target_y", "target_z"), place, strict=True)) | told
