"""What a closed FMU with effects at its ports answers to a recording's inputs, from its own start.

A force on a disturbance input is fed back from the outputs, in a system of the FMU and the force; only where
candidates are ranked is their force reckoned from the recorded motion.
"""

import hashlib
from collections.abc import Mapping, Sequence

import numpy as np

from orchestrator.system.system import System
from reconcile.closed.box import Box, answer
from reconcile.closed.candidates import Sizes
from reconcile.closed.port import Passing, Port, Side, identifier
from reconcile.closed.windows import STEP_S
from reconcile.equations.model import ALL_OUTPUTS, Attached
from reconcile.recordings.data import Parts, Run
from reconcile.recordings.held import Held
from reconcile.recordings.noise import high_pass_level, quantum
from reconcile.search.core import unique
from specs.errors import InputError

REMEMBERED = 400  # answers of the FMU
FORCE_STEP = 0.2  # of a step: a force that is fed back is one step late


class Simulation:
    """A box, its recordings in three parts, and what is remembered of its answers.

    `sigma`: the noise of each recorded output; `base`: the FMU's parameters as a fit moves them.
    """

    def __init__(self, box: Box, parts: Parts):
        self.box, self.parts = box, parts
        self.runs = unique([b.run for b in (*parts.fit, *parts.confirm, *parts.holdout)])
        self.system = box.at_step(float(np.clip(0.5 * self.runs[0].period_s, *STEP_S)))
        self.step_s = self.system.step_s
        self.sizes = Sizes(box, self.runs)
        self.recorded = set.intersection(*({*r.inputs, *r.outputs} for r in self.runs))
        self.outputs = [n for n in box.ports.outputs if n in self.recorded]
        self.sigma = {n: self._noise(n) for n in self.outputs}
        self._answers: dict[bytes, dict[str, np.ndarray]] = {}
        self._ports: dict[tuple, Passing] = {}
        self._systems: dict[tuple, tuple[System, dict[str, str]]] = {}
        self.base = self.sizes.base()

    def prior(self) -> dict[str, float]:
        """The FMU's parameters as it came."""
        return {f.name: f.prior[0] for f in self.base if f.prior}

    def _noise(self, name: str) -> float:
        """Noise level of an output, by its high-pass content and its steps."""
        values = [r.outputs[name].values for r in self.runs]
        level = float(np.sqrt(np.mean([high_pass_level(v) ** 2 for v in values])))
        step, span = max(quantum(v) for v in values), max(float(np.ptp(v)) for v in values)
        if span == 0.0:
            raise InputError(f"output {name} is constant in every recording: it tells nothing; leave it out")
        return max(level, step / np.sqrt(12.0), 1e-7 * span)

    def simulate(
        self,
        run: Run,
        effects: Sequence[Attached],
        values: Mapping[str, float],
        reckoned: Sequence[Attached] = (),
    ):
        """Outputs by name as the recording shows them: at its own sample times.

        `reckoned`: of the effects, forces to reckon from the recorded motion.
        """
        system, own = self._fed_back([a for a in effects if a.effect.place == "force" and a not in reckoned])
        told = {identifier(k): v for k, v in values.items()}
        parameters = {n: told[p] for n, p in own.items()}
        parameters |= self.told(values)
        each, ticks = round(self.step_s / system.step_s), self.ticks(run)
        u = {n: np.repeat(v, each) for n, v in self.inputs(run, effects, values, ticks, reckoned).items()}
        y = {n: v[::each] for n, v in self._answer(system, u, parameters, each * ticks).items()}
        return self.shown(run, effects, values, y)

    def told(self, values: Mapping[str, float]) -> dict[str, float]:
        """What the FMU is told of values: its own parameters, by "component.name"."""
        return {f"{self.box.model.name}.{f.name}": values[f.name] for f in self.base if f.name in values}

    def ticks(self, run: Run) -> int:
        """Steps over a run."""
        return int(np.ceil((run.end_s - run.start_s) / self.step_s)) + 1

    def _fed_back(self, forces: Sequence[Attached]) -> tuple[System, dict[str, str]]:
        """The FMU with forces fed back to it, and "component.name" -> parameter of theirs."""
        if not forces:
            return self.system, {}
        key = tuple(forces)
        if key not in self._systems:
            from reconcile.closed import wrap

            step = self.box.at_step(FORCE_STEP * self.step_s).step_s
            ports = {}
            for f in self.box.ports.feedbacks:
                own = tuple(a for a in forces if a.port == f.input)
                if own:
                    # starts of no consequence, the same for every fit: what is built is found again
                    values = {n: 1.0 for a in own for n in (*a.free, a.name("width"))}
                    ports[f"force_effects_{f.input}"] = self.port("force", own, values, step)
            self._systems[key] = (
                wrap.system(self, ports, step),
                {f"{name}.{v.name}": v.name for name, port in ports.items() for v in port.model().parameters},
            )
        return self._systems[key]

    def inputs(
        self,
        run: Run,
        effects: Sequence[Attached],
        values: Mapping[str, float],
        ticks: int,
        reckoned: Sequence[Attached] = (),
    ) -> dict[str, np.ndarray]:
        """What the FMU is given at each step [ticks], by input: behind the effects in front of it."""
        u = {}
        for n, signal in run.inputs.items():
            late = sum(values[a.name("delay")] for a in effects if a.effect.delays and a.port == n)
            u[n] = Held(signal).delayed(run.start_s, self.step_s, ticks, late)[0]
        u |= self._through("input", effects, values, {n: u[n] for n in self.box.ports.controls if n in u})
        for f in self.box.ports.feedbacks:
            at = run.start_s + self.step_s * np.arange(ticks)
            shown = {n: run.outputs[n] for n in f.signals.values() if n in run.outputs}
            motion = {n: np.interp(at, s.time, s.values) for n, s in shown.items()}
            given = {f.input: u.get(f.input, np.full(ticks, self.box.start(f.input)))}
            own = [a for a in reckoned if a.port == f.input]
            if own:
                u |= self._through("force", own, values, given | motion)
        return u

    def _through(
        self, side: Side, effects: Sequence[Attached], values: Mapping[str, float], u: dict[str, np.ndarray]
    ):
        own = tuple(a for a in effects if a.effect.place == side and not a.effect.delays)
        if not own or not u:
            return u
        port = self.port(side, own, values, self.step_s)
        if (side, own) not in self._ports:
            self._ports[side, own] = Passing(port)
        return self._ports[side, own].through(u, values)

    def port(
        self, side: Side, effects: tuple[Attached, ...], values: Mapping[str, float], step: float
    ) -> Port:
        """The port of one side; of a force at one disturbance input."""
        model, box = self.box.model, self.box
        if side == "force":
            f = next(x for x in box.ports.feedbacks if x.input == effects[0].port)
            signals = [v for v in model.inputs if v.name == f.input]
            outputs = {v.name: v for v in model.outputs}
            motion = {role: outputs[n] for role, n in f.signals.items()}
            return Port(side, step, tuple(signals), effects, values, motion)
        if side == "input":
            signals = [v for v in model.inputs if v.name in box.ports.controls and v.name in self.recorded]
        else:
            signals = [v for v in model.outputs if v.name in self.outputs]
        return Port(side, step, tuple(signals), effects, values, {})

    def _answer(
        self, system: System, u: Mapping[str, np.ndarray], parameters: Mapping[str, float], ticks: int
    ):
        told = repr((id(system), sorted(parameters.items()), sorted(u))).encode()
        key = hashlib.sha256(told + b"".join(u[n].tobytes() for n in sorted(u))).digest()
        if key not in self._answers:
            if len(self._answers) >= REMEMBERED:
                self._answers.clear()
            self._answers[key] = answer(system, u, parameters, ticks)
        return self._answers[key]

    def shown(
        self, run: Run, effects: Sequence[Attached], values: Mapping[str, float], y: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """What sensors show of outputs by step: at the recording's sample times, behind the effects."""
        late = dict.fromkeys(self.outputs, 0.0)
        for a in (a for a in effects if a.effect.delays and a.effect.place == "output"):
            for n in self.outputs if a.port == ALL_OUTPUTS else [a.port]:
                late[n] += values[a.name("delay")]
        behind = self._through("output", effects, values, {n: y[n] for n in self.outputs})
        found = {}
        for n in self.outputs:
            at = (run.outputs[n].time - run.start_s - late[n]) / self.step_s
            found[n] = np.interp(at, np.arange(len(behind[n])), behind[n])
        return found
