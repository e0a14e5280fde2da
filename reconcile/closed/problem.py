"""Simulation error of a closed FMU with effects at its ports, over whole recordings.

It runs from its own start; what other initial states would make of it is taken out of the errors (starts.py).
The errors are taken at the samples of the blocks of each part.  A force on a disturbance input is fed back
from the outputs, in a system of the FMU and the force; only where candidates are ranked is their force
reckoned from the recorded motion.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from orchestrator.system import System
from reconcile.closed.box import Box, answer
from reconcile.closed.candidates import Sizes
from reconcile.closed.fitted import ClosedFit
from reconcile.closed.port import Passing, Port, Side, identifier
from reconcile.closed.starts import Starts, within
from reconcile.data import Parts, Run
from reconcile.fit.noise import high_pass_level, quantum
from reconcile.fit.solve import Free
from reconcile.fit.windows import STEP_S, Held
from reconcile.model import ALL_OUTPUTS, Attached
from reconcile.study import unique
from specs.errors import InputError, RunError

STEPS = (1e-2, 0.1, 0.5)  # of a parameter's size, for differences
EVALUATIONS = 12
REMEMBERED = 400  # answers of the FMU
FORCE_STEP = 0.2  # of a step: a force that is fed back is one step late
FELT = 0.3  # of the noise: a parameter whose prior spread moves the outputs by less is left alone


class ClosedProblem:
    """A box, its recordings in three parts, and what is remembered of its answers."""

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
        self.restart(self.prior())
        self.base = self._felt()

    def prior(self) -> dict[str, float]:
        """The FMU's parameters as it came."""
        return {f.name: f.prior[0] for f in self.base if f.prior}

    @property
    def free(self) -> list[str]:
        """Outputs whose initial value is free, as of a position that only its speed drives."""
        return [n for n in self.outputs if self.starts.hides(n)]

    @property
    def still_inputs(self) -> list[str]:
        """Inputs that are constant in every recording."""
        known = [n for n in self.box.ports.controls if n in self.recorded]
        return [n for n in known if max(float(np.ptp(r.inputs[n].values)) for r in self.runs) == 0.0]

    def restart(self, values: Mapping[str, float]) -> None:
        """Reckon what initial states do with these values of the FMU's parameters."""
        self.starts = Starts(self, values)

    def _noise(self, name: str) -> float:
        """Noise level of an output, by its high-pass content and its steps."""
        values = [r.outputs[name].values for r in self.runs]
        level = float(np.sqrt(np.mean([high_pass_level(v) ** 2 for v in values])))
        step, span = max(quantum(v) for v in values), max(float(np.ptp(v)) for v in values)
        if span == 0.0:
            raise InputError(f"output {name} is constant in every recording: it tells nothing; leave it out")
        return max(level, step / np.sqrt(12.0), 1e-7 * span)

    # ---------------------------------------------------------------- simulation

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

    # ---------------------------------------------------------------- errors and fits

    def errors(
        self, effects: Sequence[Attached], values: Mapping[str, float], reckoned: Sequence[Attached] = ()
    ):
        """Errors in units of the noise: part -> (run, output) -> [n]; RunError if the FMU fails."""
        found: dict[str, dict[tuple[str, str], np.ndarray]] = {"fit": {}, "confirm": {}, "holdout": {}}
        for run in self.runs:
            shown = self.simulate(run, effects, values, reckoned)
            left = {n: (run.outputs[n].values - shown[n]) / self.sigma[n] for n in self.outputs}
            left = self.starts.freed(run, left)
            for part, blocks in found.items():
                blocks |= {(run.name, n): left[n][i] for n, i in self.inside(run, part).items()}
        return found

    def inside(self, run: Run, part: str) -> dict[str, np.ndarray]:
        """Which samples [n] of a run's outputs are of a part; nothing if it has no block in the run."""
        spans = [self.starts.span(b) for b in getattr(self.parts, part) if b.run is run]
        return {n: within(run.outputs[n].time, spans) for n in self.outputs} if spans else {}

    def residual(
        self, effects: Sequence[Attached], values: Mapping[str, float], reckoned: Sequence[Attached] = ()
    ) -> np.ndarray | None:
        """Errors on the part to fit in one row [M]; None if the FMU fails or runs away."""
        try:
            e = np.concatenate(list(self.errors(effects, values, reckoned)["fit"].values()))
        except RunError:
            return None
        return e if np.isfinite(e).all() and np.abs(e).max() < 1e12 else None

    def slopes(self, effects: Sequence[Attached], values: Mapping[str, float], free: Sequence[Free]):
        """Errors [M] and their slopes [M, K] by the free parameters (differences); None if the FMU fails."""
        e = self.residual(effects, values)
        if e is None:
            return None
        columns = [self._slope(effects, values, f, e) for f in free]
        return e, np.column_stack(columns) if columns else np.zeros((len(e), 0))

    def _slope(
        self, effects: Sequence[Attached], values: Mapping[str, float], f: Free, e: np.ndarray
    ) -> np.ndarray:
        """By one parameter; longer steps where a short one changes nothing, as of a delay in whole ticks."""
        value = values[f.name]
        for step in (share * f.size for share in STEPS):
            if step > f.high - value:
                step = -step
            if value + step < f.low:
                break
            moved = self.residual(effects, {**values, f.name: value + step})
            if moved is not None and not np.array_equal(moved, e):
                return (moved - e) / step
        return np.zeros(len(e))

    def fit(self, effects: Sequence[Attached], start: Mapping[str, float]) -> ClosedFit | None:
        """Least squares over the parameters of FMU and effects; None if the FMU fails at `start`."""
        free = [*self.base, *(f for a in effects for f in self.sizes.free(a))]
        values = {**self.prior(), **start}
        if self.residual(effects, values) is None:
            return None
        if not free:
            e = self.residual(effects, values)
            return self._fitted(effects, values, free, np.zeros((0, 0)), 0.0 if e is None else float(e @ e))
        priors = [(k, *f.prior) for k, f in enumerate(free) if f.prior]

        def named(x: np.ndarray) -> dict[str, float]:
            return {**values, **dict(zip((f.name for f in free), map(float, x), strict=True))}

        def rows(x: np.ndarray) -> np.ndarray:
            e = self.residual(effects, named(x))
            held = [(x[k] - mean) / spread for k, mean, spread in priors]
            return np.concatenate([np.full(self._count, 1e6) if e is None else e, held])

        def by(x: np.ndarray) -> np.ndarray:
            found = self.slopes(effects, named(x), free)
            held = np.zeros((len(priors), len(free)))
            for row, (k, _, spread) in enumerate(priors):
                held[row, k] = 1.0 / spread
            return np.vstack([np.zeros((self._count, len(free))) if found is None else found[1], held])

        low, high = np.array([f.low for f in free]), np.array([f.high for f in free])
        done = least_squares(
            rows,
            _inside(np.array([values[f.name] for f in free]), low, high),
            jac=by,  # type: ignore[arg-type]
            bounds=(low, high),
            x_scale=np.array([f.size for f in free]),
            max_nfev=EVALUATIONS,
            ftol=1e-5,
            xtol=1e-6,
        )
        return self._fitted(effects, named(done.x), free, _covariance(done.jac), 2.0 * float(done.cost))

    def _fitted(self, effects, values, free, covariance, cost: float) -> ClosedFit:
        errors = self.errors(effects, values)
        return ClosedFit(tuple(effects), values, tuple(free), cost, errors, covariance)

    @property
    def _count(self) -> int:
        return len(np.concatenate(list(self.errors((), {})["fit"].values())))

    def _felt(self) -> list[Free]:
        """The FMU's parameters that the outputs feel."""
        values = self.prior()
        found = self.slopes((), values, self.base)
        if found is None:
            raise InputError(
                f"FMU {self.box.path} runs away or fails on the recordings from its own start: is it stable, "
                f"and are the recordings in its units?{self._why(values)}"
            )
        _, by = found
        kept = [f for f, s in zip(self.base, by.T, strict=True) if np.linalg.norm(s) * f.size > FELT]
        return [replace(f, low=max(f.low, 0.0) if f.prior and f.prior[0] > 0 else f.low) for f in kept]

    def _why(self, values: Mapping[str, float]) -> str:
        """What the FMU says of it, if it fails."""
        try:
            self.errors((), values)
        except RunError as error:
            return f" ({str(error).splitlines()[0]})"
        return ""


def _inside(x: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """A start that is strictly within its bounds."""
    room = 1e-9 * np.maximum(1.0, np.abs(np.clip(x, low, high)))
    return np.clip(
        x, low + np.where(np.isfinite(low), room, 0.0), high - np.where(np.isfinite(high), room, 0.0)
    )


def _covariance(slopes: np.ndarray) -> np.ndarray:
    information = slopes.T @ slopes
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    return np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-12) / np.outer(scale, scale)
