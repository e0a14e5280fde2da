"""A part that the machine moves, such as its tool: commands of the machine, and the motion that they lead to.

What moves it is predicted by the project's models of arm and slew drive as they are: good enough to choose an
excitation by, and the recording that comes of it shows the true motion.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fmus.equations import kinematics
from fmus.toolchain.discrete import DiscreteStepper
from fmus.toolchain.loader import load_model
from fmus.toolchain.stepper import Stepper
from learning.collection.plan import PLAN_COMMANDS
from reconcile.experiment.limits import Range
from reconcile.recordings.data import Run, Signal
from reconcile.system.parts import JOINTS, RATES
from specs.signals import signals

SLEW_STEP_S = 0.005  # of the slew drive: coarser than its FMU's, for a prediction
Commands = Mapping[str, np.ndarray]
Derive = Callable[[Mapping[str, np.ndarray]], dict[str, tuple[str, np.ndarray]]]


@dataclass(frozen=True)
class Carrier:
    """The machine with its arm at `pose` {"q_boom", "q_stick"} and its slew at `q_slew` (rad).

    `derive`: what a part's inputs are made of, as in `reconcile.system.parts.Part`.
    """

    derive: Derive
    pose: Mapping[str, float]
    q_slew: float

    @property
    def ranges(self) -> dict[str, Range]:
        """Of the machine's commands."""
        known = signals()
        return {n: (float(known[n].min or 0.0), float(known[n].max or 0.0)) for n in PLAN_COMMANDS}

    def moved(self, told: Commands, tick_s: float) -> dict[str, np.ndarray]:
        """Motion of slew, boom and stick by signal, [n] each, with "time": what commands [m] at ticks do."""
        arm = self._arm(told, tick_s)
        return arm | self._slew(told["u_slew"], tick_s, arm)

    def inputs(self, moved: Mapping[str, np.ndarray]) -> dict[str, Signal]:
        """Inputs of the part's model, made of the motion."""
        load = np.zeros_like(moved["time"])
        made = self.derive({**moved, "load": load})
        return {n: Signal(moved["time"], values) for n, (_, values) in made.items()}

    def _arm(self, told: Commands, tick_s: float) -> dict[str, np.ndarray]:
        model = load_model("arm")
        stepper = DiscreteStepper(model, {f"start_{n}": q for n, q in self.pose.items()})
        each = round(tick_s / model.step)
        rows = []
        for k in range(each * len(told["u_slew"])):
            stepper.set(**{n: float(told[n][k // each]) for n in PLAN_COMMANDS if n != "u_slew"})
            rows.append([stepper.outputs()[n] for n in (*JOINTS, *RATES, "inertia", "inertia_rate")])
            stepper.advance()
        columns = np.array(rows).T
        names = (*JOINTS, *RATES, "inertia", "inertia_rate")
        return {"time": model.step * np.arange(len(rows))} | dict(zip(names, columns, strict=True))

    def _slew(self, u: np.ndarray, tick_s: float, arm: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        period = float(arm["time"][1])
        stepper = Stepper(load_model("slew"), {"start_q_slew": self.q_slew}, SLEW_STEP_S)

        def inputs(t: float) -> dict[str, float]:
            k = min(round(t / period), len(arm["time"]) - 1)
            turned = {n: float(arm[n][k]) for n in ("inertia", "inertia_rate")}
            return {"u_slew": float(u[min(int(t / tick_s + 1e-9), len(u) - 1)]), **turned}

        run = stepper.run(inputs, period * (len(arm["time"]) - 1), period)
        return {n: run[n] for n in ("q_slew", "qd_slew")}


def carrier(derive: Derive, run: Run) -> Carrier:
    """The machine as it stood when a recording of the part began: the pose that holds it up at its place."""
    g = kinematics.geometry()
    radius, height, q_slew = (float(run.inputs[n].values[0]) for n in ("radius", "height", "q_slew"))
    _, boom, stick = (float(q) for q in kinematics.inverse(radius, 0.0, height - g.tool_length, g))
    return Carrier(derive, dict(zip(JOINTS, (boom, stick), strict=True)), q_slew)
