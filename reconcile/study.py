"""What a search works on: the compiled model with all candidates, three problems, sizes and noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fmus.definition import Model, Variable
from reconcile import sites, smoothing, starting
from reconcile.catalogue import Effect, Scales
from reconcile.catalogue.effect import Parameter
from reconcile.data import Parts, Run, still
from reconcile.extended import Extended
from reconcile.fit import whitening
from reconcile.fit.compiled import Compiled
from reconcile.fit.point import Point
from reconcile.fit.problem import Problem
from reconcile.fit.solve import LONGER, Fitted, Free, fit
from reconcile.fit.windows import FIRST_S, HOLDOUT_S, SHORT_S, WINDOW_S, Window, cut, few, span
from reconcile.model import ALL_OUTPUTS, Attached, Folder, candidates
from reconcile.noise import high_pass_level, quantum
from reconcile.slopes import Slopes
from reconcile.starting import WIDTHS
from specs.errors import InputError

SPREAD = 0.5  # of a base parameter, as a share of its start: how far it may be wrong
FAR = 0.1  # of what an output moves by: with larger errors a model goes elsewhere
BEYOND = 30.0  # times the grid of starts to which a shape may go
FIT, ANSWER = 1e-3, 1e-5  # shares of its cost that a step of a fit must gain: of thousands of errors a
# thousandth is many, and an answer's parameters are to lie well within their intervals
RANKING, CHOOSING = 20.0, 5.0  # times the tolerance of steps where sets are ranked, and where they are judged
FOLLOWS = 0.01  # of a sample period: time in which play is taken up
AHEAD = {"position": 0.1, "velocity": 0.3}  # s, 1: of an axis's speed, by which another end of it is ahead
WITHIN = 0.01  # of a gear's gap: over which its kinks are rounded, however small it is beside the travel


@dataclass(frozen=True)
class Floor:
    """Noise level of an output and where it is from."""

    level: float
    source: str


class Study:
    """A model folder against its recordings, in three parts."""

    def __init__(self, folder: Folder, parts: Parts, catalogue=None):
        self.folder, self.parts, self.model = folder, parts, folder.model
        runs = unique([b.run for b in (*parts.fit, *parts.confirm, *parts.holdout)])
        recorded = set.intersection(*({*r.inputs, *r.outputs} for r in runs))
        units = {v.name: v.unit for v in self.model.outputs}
        recorded -= {n for n in units if n in recorded and units[n] in ("", "1") and _switches(runs, n)}
        # a sensor that is dead tells nothing
        self.still = still(runs, [n for n in folder.ports.outputs if n in recorded])
        recorded -= self.still
        options = {} if catalogue is None else {"catalogue": catalogue}
        constant = still(runs, [v.name for v in self.model.inputs])
        self.candidates = candidates(folder, sorted(recorded), **options, constant=constant)
        self.extended = Extended(folder, self.candidates)
        self.compiled = Compiled(self.extended)
        shown = [n for n in folder.ports.outputs if n in recorded]
        if not shown:
            raise InputError(f"the recordings hold no output of {self.model.name} that varies")
        self.floors = {n: _floor(self.model, n, runs) for n in shown}
        sigma = {n: f.level for n, f in self.floors.items()}
        # s, of a discrete model; None: windows choose theirs
        self.step_s = self.model.step if self.model.kind == "discrete" else None
        self.problems = {
            which: Problem(self.compiled, windows(_blocks(parts, which), seconds, self.step_s), sigma)
            for which, windows, seconds in (
                ("fit", span, WINDOW_S),
                ("first", few, FIRST_S),
                ("short", cut, SHORT_S),
                ("confirm", span, WINDOW_S),
                ("holdout", cut, HOLDOUT_S),
            )
        }
        self.fit_problem = self.problems["short"]
        self.patience = CHOOSING  # 1 for the answer
        nominal = [v.nominal or 1.0 for v in self.model.states]
        hidden = len(self.extended.state_names) - len(nominal)
        for problem in self.problems.values():
            problem.set_scale(np.array(nominal + [1.0] * hidden))
        self.lost = False  # whether the base model goes elsewhere than the recordings within a few seconds
        self.noise = whitening.Noise(())
        self.slopes = Slopes(self)
        self.values = self._neutral()
        self.scales = self._scales(runs)
        self.values = self._neutral()
        self.base_free = self._base_free()

    # ---------------------------------------------------------------- fits

    def free(self, present: Sequence[Attached]) -> list[Free]:
        """What a fit with these effects moves."""
        own = [
            Free(a.name(q.name), *self._bounds(a, q), self._size(a, q.name))
            for a in present
            for q in a.effect.parameters
        ]
        return [*self.base_free, *own]

    def base(self, name: str) -> Free:
        """Bounds, size and prior of a base parameter, whether or not the outputs feel it."""
        return _free(next(v for v in self.model.parameters if v.name == name))

    def fit_set(
        self,
        start: Point,
        present: Sequence[Attached],
        values: Mapping[str, float],
        coarse: bool = False,
        hopeless: float = np.inf,
        near: bool = False,
        tolerance: float = FIT,
    ) -> Fitted | None:
        """Fit a set of effects: from `start` with `values` of the new effects' parameters in place.

        `coarse` stops at kinks wide enough to be quick; `near`: the start is near enough to be sharp at once;
        `tolerance`: as of `fit`.  None if it cannot be simulated or is `hopeless`.
        """
        self.fit_problem.patience = RANKING if coarse else self.patience
        point = starting.placed(self, start, present, values)
        for share in (widths := starting.widths(self, point, coarse, near)):
            budget = (12, tolerance) if share == WIDTHS[-1] else (6, 1e-2)
            longer = 2 if coarse else LONGER
            at = starting.rounded(self, point, share)
            gone = hopeless if share == widths[-1] else starting.MAY_FALL * hopeless
            found = fit(self.fit_problem, at, self.free(present), *budget, gone, longer)
            if found is None:
                return None
            point = found.point
        return found

    def refitted(self, fitted: Fitted, tolerance: float = FIT) -> Fitted:
        """A fit again, from where it ended: the noise, or the data, are others now.

        With kinks it is fitted from wide ones as well: judged more sharply than before, a stop that a window
        meets a little early holds everything else up.
        """
        point, present = fitted.point, fitted.point.present
        ways = (True, False) if any(a.effect.width for a in present) else (True,)
        found = [self.fit_set(point, present, {}, near=near, tolerance=tolerance) for near in ways]
        return min((f for f in found if f is not None), key=lambda f: f.cost, default=fitted)

    def elsewhere(self, fitted: Fitted, which: str) -> Fitted | None:
        """The same parameters on another part, with initial states of their own."""
        return self._carried(self.problems[which], replace(fitted, free=()))

    def named(self, p: np.ndarray) -> dict[str, float]:
        """All parameters by name."""
        return dict(zip(self.extended.parameter_names, map(float, p), strict=True))

    def estimate_noise(self, fitted: Fitted, more: np.ndarray | None = None) -> bool:
        """Fit the noise model to what a fit leaves, and judge by it from here on; whether it changed much.

        `more`: slopes [N, F], not whitened, of what may be missing and is not to count as noise.
        Where the base model goes elsewhere there is no noise model: random forces as large as what makes it
        do so would explain any friction as well.  Errors count as white, and as fewer by their correlation.
        """
        if self.lost:
            return False
        before, self.noise = self.noise, self._noise_of(fitted, more)
        self.fit_problem.whiteners = self.noise.whiteners()
        return self.noise.differs(before)

    def smooth_inputs(self, fits: Sequence[Fitted]) -> None:
        """Drive the model by inputs freed of noise from here on, where the best of fits then leaves less."""
        if self.lost:
            return
        widths = smoothing.widths(self.fit_problem, [f.point for f in fits])
        for problem in (self.fit_problem, *self.problems.values()):
            problem.smooth(widths)

    def deviance(self, fitted: Fitted, more: np.ndarray | None = None) -> float:
        """Minus twice the log-likelihood of a fit by a noise model of its own, where there is one.

        `more`: slopes [N, F], not whitened, of terms that are fitted beside it.
        """
        return self._noise_of(fitted, more).deviance()

    def price(self, fitted: Fitted, more: np.ndarray) -> float:
        """BIC of what a fit leaves, as terms with slopes `more` [N, F] and as noise: both have parameters."""
        noise, (n, terms) = self._noise_of(fitted, more), more.shape
        return noise.deviance() + (terms + noise.parameters) * float(np.log(n))

    def _noise_of(self, fitted: Fitted, more: np.ndarray | None) -> whitening.Noise:
        """The noise model of greatest likelihood for what a fit leaves; `more` as for estimate_noise."""
        columns = [self.extended.index[f.name] for f in fitted.free]
        ends = np.cumsum([sum(map(len, w.values())) for w in fitted.linear.raw])[:-1]
        parts = [] if more is None else np.split(more, ends)
        blurred = starting.blurred(self, fitted.point)
        return whitening.estimate(self.fit_problem, fitted.point, columns, parts, blurred)

    def whiten_confirm(self, fitted: Fitted) -> None:
        """Judge by the same noise on confirm."""
        self._whiten(self.problems["confirm"], fitted)

    def _whiten(self, problem: Problem, fitted: Fitted, known: int = 0) -> None:
        """Carry the noise model over to another problem; `known` as for carried."""
        problem.whiteners = None
        if self.lost:
            return
        there = self._carried(problem, fitted, known=known)
        if there is not None:
            blurred = starting.blurred(self, there.point)
            found = whitening.transferred(self.noise, problem, there.point, blurred=blurred)
            problem.whiteners = found.whiteners()

    def beside(self, catalogue: Sequence[Effect]) -> "Study":
        """A study of the same windows with other candidates, judged by no noise model yet."""
        found = Study(self.folder, self.parts, catalogue)
        found.fit_problem = found._problem(self.fit_problem.windows)
        found.fit_problem.smooth(self.fit_problem.widths)
        found.base_free, found.lost, found.patience = self.base_free, self.lost, self.patience
        return found

    def follows(self, fitted: Fitted) -> bool:
        """Whether a fit goes where the recordings go: within FAR of what each output moves by."""
        for name, floor in self.floors.items():
            left = np.concatenate([w[name] for w in fitted.linear.raw if name in w])
            moved = np.concatenate([b.run.outputs[name].values for b in self.parts.fit])
            if floor.level * np.sqrt(np.mean(left**2)) > max(FAR * np.std(moved), 2.0 * floor.level):
                return False
        return True

    def lengthen(self, fitted: Fitted) -> None:
        """Fit to whole runs from here on, where weak and slow effects show; strong ones must be in by now.

        A model that went elsewhere without them, and over whole runs still does, stays with short windows:
        small errors grow there (a pendulum that turns over), and the fit's minima are many.
        """
        whole = self._carried(self.problems["fit"], fitted) if self.lost else None
        if self.lost and (whole is None or not self.follows(whole)):
            self.problems["confirm"] = self._problem(cut(self.parts.confirm, SHORT_S, self.step_s))
            return
        self.lost = False
        self._whiten(self.problems["fit"], fitted)
        self.fit_problem = self.problems["fit"]

    def use_all(self, fitted: Fitted) -> None:
        """Fit to the parts fit and confirm together from here on, with the noise as a fit has it."""
        known = self.fit_problem.windows
        problem = self._problem([*known, *self.problems["confirm"].windows])
        self._whiten(problem, fitted, len(known))
        self.fit_problem = problem

    def _problem(self, windows: Sequence[Window]) -> Problem:
        """Further windows to meet like those in use."""
        problem = Problem(self.compiled, windows, self.fit_problem.sigma)
        problem.set_scale(self.fit_problem.scale)
        problem.smooth(self.fit_problem.widths)
        return problem

    def carried(
        self, fitted: Fitted, values: Mapping[str, float] | None = None, known: int = 0
    ) -> Fitted | None:
        """A fit's parameters on the problem in use, with initial states of their own.

        `values`: its parameters by name where the fit is another study's; its effects are candidates here.
        `known`: so many windows are first in both, and begin as in the fit: what bounces ends elsewhere else.
        """
        return self._carried(self.fit_problem, fitted, values, known)

    def _carried(
        self,
        problem: Problem,
        fitted: Fitted,
        values: Mapping[str, float] | None = None,
        known: int = 0,
    ) -> Fitted | None:
        values = self.named(fitted.point.p) if values is None else {**self.values, **values}
        point = problem.start(values)
        point = problem.with_present(point, fitted.point.present)
        point = replace(point, x0=np.vstack([fitted.point.x0[:known], point.x0[known:]]))
        return fit(problem, point, fitted.free, iterations=0)

    # ---------------------------------------------------------------- sizes

    def port_scales(self, a: Attached) -> Scales:
        """Scales at the port of a candidate."""
        return self.scales[a.port]

    def _neutral(self) -> dict[str, float]:
        """All effects absent, their shapes at the first start, kinks rounded by what the data show."""
        values = self.extended.base_start()
        known = getattr(self, "scales", {})
        for a in self.candidates:
            s = known.get(a.port, Scales())
            values |= {a.name(n): v for n, v in a.effect.start(s, 0).items()}
            if a.effect.gated:
                values[a.name("gate")] = 0.0
            if a.effect.width:
                values[a.name("width")] = _width(a, s)
        return values

    def _bounds(self, a: Attached, q: Parameter) -> tuple[float, float]:
        """Bounds of a parameter: a shape stays within BEYOND times its grid, past which it cannot be told.

        Where the least is declared it counts: a stop may have no damping at all.
        """
        scales = self.port_scales(a)
        starts, (low, high) = tuple(q.starts(scales)), q.bounds(scales)
        if q.amplitude or min(starts) <= 0.0:
            return low, high
        declared = q.least(scales) > -np.inf
        return low if declared else max(low, min(starts) / BEYOND), min(high, BEYOND * max(starts))

    def _size(self, a: Attached, parameter: str) -> float:
        s = self.port_scales(a)
        starts = next(q for q in a.effect.parameters if q.name == parameter).starts(s)
        return max(abs(v) for v in starts) or 1.0

    def _scales(self, runs: Sequence[Run]) -> dict[str, Scales]:
        period = min(r.period_s for r in runs)
        found: dict[str, Scales] = {ALL_OUTPUTS: Scales(period_s=period)}
        for name in self.folder.ports.controls:
            values = np.concatenate([r.inputs[name].values for r in runs if name in r.inputs] or [np.ones(1)])
            found[name] = Scales(u=float(np.max(np.abs(values))) or 1.0, period_s=period)
        for name in self.floors:
            values = np.concatenate([r.outputs[name].values for r in runs])
            found[name] = Scales(y=_span(values), period_s=period)
        states = self._seen_states()
        self._set_state_scales(states)
        found |= sites.scales(self.folder.model, self.folder.ports, states, runs, period)
        for axis in self.folder.ports.axes:
            v = states[:, self.model.index("states", axis.velocity)]
            q = (
                states[:, self.model.index("states", axis.position)]
                if axis.position
                else np.array([-1.0, 1.0])
            )
            unit = next((x.unit for x in self.model.states if x.name == axis.position), "")
            found[axis.name] = Scales(
                v=float(np.quantile(np.abs(v), 0.98)) or 1.0,
                q=float(np.max(np.abs(q))) or 1.0,
                q_low=float(np.min(q)),
                q_high=float(np.max(q)) if np.ptp(q) > 0 else float(np.min(q)) + 1.0,
                angular=unit == "rad",
                inertia=self.extended.inertia(axis),
                period_s=period,
            )
        return found

    def _seen_states(self) -> np.ndarray:
        """States [rows, NX] in the fit windows: as recorded where outputs show them, else as simulated."""
        problem, rows = self.fit_problem, []
        point = problem.start(self.values)
        shown = {i: n for i, (n, order) in problem.shown.items() if order == 0}
        for k, window in enumerate(problem.windows):
            run = problem.simulate(point, k)
            if run is not None:
                times = window.start_s + window.step_s * np.arange(len(run[0]))
                for i, n in shown.items():
                    run[0][:, i] = np.interp(times, window.run.outputs[n].time, window.run.outputs[n].values)
                rows.append(run[0])
        if not rows:
            raise InputError(
                f"model {self.model.name} runs away in every window of the recordings: is it stable, "
                "and are the recordings in its units?"
            )
        return np.vstack(rows)

    def _set_state_scales(self, states: np.ndarray) -> None:
        scale = np.maximum(np.quantile(np.abs(states), 0.95, axis=0), 1e-9)
        for i, v in enumerate(self.model.states):
            if scale[i] <= 1e-9:
                scale[i] = v.nominal or 1.0
        hidden = self.extended.state_names[len(self.model.states) :]
        for i, n in enumerate(hidden, len(self.model.states)):
            port, _, state = n.split("@")[1].partition(".")
            signals = (port.split("+")[0], state.removeprefix("lagged_"))  # of a group it is the member's
            runs = [b.run for b in self.parts.fit]
            inputs = [r.inputs[s].values for r in runs for s in signals if s in r.inputs]
            outputs = [r.outputs[s].values for r in runs for s in signals if s in r.outputs]
            found = [np.max(np.abs(x)) for x in (*inputs, *outputs)]
            scale[i] = max([float(x) for x in found] or [1.0]) or 1.0
        for hidden, role, axis in self.extended.beside():
            speed = scale[self.model.index("states", axis.velocity)]
            scale[self.extended.state_names.index(hidden)] = AHEAD[role] * speed
        for problem in self.problems.values():
            problem.set_scale(scale)

    def _base_free(self) -> list[Free]:
        """Base parameters that the outputs feel."""
        model = self.model
        left = {n for s in model.sensors.values() for n in (s.noise, s.bias, s.quantum) if n}
        left |= {n for m in model.modes for n in (m.on_delay, m.off_delay) if n}
        doubtful = self.folder.ports.doubtful
        names = [v for v in model.parameters if not v.fixed and v.name not in left]
        names = [v for v in names if doubtful is None or v.name in doubtful]
        columns = [self.extended.index[v.name] for v in names]
        point = self.fit_problem.start(self.values)
        linear = self.fit_problem.linear(point, columns)
        if linear is None:
            raise InputError(f"model {model.name} runs away on the recordings from its start parameters")
        felt = [np.linalg.norm(linear.slopes[:, i]) * _spread(v) > 0.3 for i, v in enumerate(names)]
        return [_free(v) for v, f in zip(names, felt, strict=True) if f]


def _blocks(parts: Parts, which: str):
    """Blocks of a problem: the short windows are those to fit as well."""
    return parts.fit if which in ("first", "short") else getattr(parts, which)


def _free(v: Variable) -> Free:
    low = -np.inf if v.min is None else v.min
    high = np.inf if v.max is None else v.max
    if v.unit == "s":
        low = max(low, 0.0)
    return Free(v.name, low, high, _spread(v), (v.start, _spread(v)))


def _spread(v: Variable) -> float:
    if v.start:
        return SPREAD * abs(v.start)
    if v.min is not None and v.max is not None and v.max - v.min < 1e6:
        return 0.25 * (v.max - v.min)
    return v.nominal or 1.0


def _width(a: Attached, s: Scales) -> float:
    sizes = {"u": s.u, "v": s.v, "q": s.q, "y": s.y}
    if a.effect.width == "time":
        return FOLLOWS * s.period_s
    if a.effect.width == "gap":
        return WITHIN
    return WIDTHS[-1] * sizes[a.effect.width or "u"]


def _span(values: np.ndarray) -> float:
    return float(np.max(np.abs(values))) or 1.0


def unique(runs: Sequence[Run]) -> list[Run]:
    """Each run once, in order."""
    return list({id(r): r for r in runs}.values())


def _switches(runs: Sequence[Run], name: str) -> bool:
    """Whether an output is a switch, which a simulation error says nothing about."""
    return all(np.isin(r.outputs[name].values, (0.0, 1.0)).all() for r in runs if name in r.outputs)


def _floor(model: Model, name: str, runs: Sequence[Run]) -> Floor:
    """Noise of an output: the sensor's specification, unless the recording is noisier than that."""
    values = [r.outputs[name].values for r in runs if name in r.outputs]
    seen = float(np.sqrt(np.mean([high_pass_level(v) ** 2 for v in values])))
    step = max(quantum(v) for v in values)
    seen = max(seen, step / np.sqrt(12.0), 1e-7 * max(_span(v) for v in values))
    sensor = model.sensors.get(name)
    if sensor and sensor.noise:
        start = next(p.start for p in model.parameters if p.name == sensor.noise)
        if start > 0 and seen < 1.5 * start:
            return Floor(float(np.hypot(start, step / np.sqrt(12.0))), "sensor specification")
    return Floor(seen, "high-pass estimate")
