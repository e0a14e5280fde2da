"""What an experiment would show: played with fitted models, and how far apart that sets two of them.

The margin of a pair is twice the difference in log-likelihood that recordings and experiment together will
show between the true set and its rival, once the rival is fitted to both.  It is worked out to first order:
what the true set's outputs differ by is freed of what the rival's parameters and initial states could make
up for; that the recordings at hand hold the rival's parameters counts in full.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from reconcile import evidence, starting
from reconcile.data import PATTERN, WHOLE, Block, Run, Signal
from reconcile.experiment.carried import Carrier
from reconcile.experiment.excitation import LEAD_S, Excitation, commands, smooth
from reconcile.experiment.limits import Limits
from reconcile.fit import whitening
from reconcile.fit.point import Point
from reconcile.fit.problem import Problem
from reconcile.fit.solve import Fitted
from reconcile.fit.whitening import Whitener
from reconcile.fit.windows import STEP_S, WINDOW_S, Window, span
from reconcile.study import Study, unique

FOLLOWS_S = 0.5  # lag, twice, of an input that another follows: it is moved by a machine
FINER = 4.0
QUICK_BIN_S = 0.5  # of the noise's forces, while excitations are compared
DOUBT, WAYS = 2.0, 2
RESTS = 0.05  # of the motion: a machine that moves less by itself stays where it is


@dataclass(frozen=True)
class Played:
    """An experiment as a fitted set of effects predicts it: the run, and states [n + 1, NX] at `step_s`."""

    chosen: Excitation
    run: Run
    states: np.ndarray
    step_s: float

    def at(self, time_s: float) -> np.ndarray:
        """States at a time."""
        return self.states[min(round(time_s / self.step_s), len(self.states) - 1)]


class Bench:
    """Plays excitations with the fitted sets of a study; inputs change every `tick_s`.

    `fixed_start`: the machine cannot be asked to start elsewhere than in the recordings.  `carrier`: takes
    the commands and moves the model's inputs.
    """

    def __init__(
        self,
        study: Study,
        limits: Limits,
        tick_s: float,
        fixed_start: bool = False,
        carrier: Carrier | None = None,
    ):
        self.study, self.limits, self.tick_s, self.fixed_start = study, limits, tick_s, fixed_start
        self.carrier = carrier
        self._carried: dict[Excitation, dict[str, np.ndarray]] = {}  # motion of the carrier, found once
        self.finer = 1.0  # steps of the simulation than the fits'
        self.runs = unique([b.run for b in (*study.parts.fit, *study.parts.confirm, *study.parts.holdout)])
        self.period_s = min(r.period_s for r in self.runs)

    def checking(self) -> "Bench":
        """The same with finer steps: what differs between the two is no property of the machine."""
        found = Bench(self.study, self.limits, self.tick_s, self.fixed_start, self.carrier)
        found.finer, found._carried = FINER, self._carried
        return found

    # ---------------------------------------------------------------- playing

    def inputs(self, chosen: Excitation) -> dict[str, Signal]:
        """The model's inputs over time: driven, what follows from that, and the others as they were."""
        limits, tick = self.limits, self.tick_s
        told = self.told(chosen)
        if self.carrier is not None:
            moved = self.carrier.inputs(self._moved(self.carrier, chosen))
            time = next(iter(moved.values())).time
            return {n: Signal(time, np.full(len(time), v)) for n, v in limits.held.items()} | moved
        for rate, place in limits.followers.items():
            told[rate] = smooth(told[rate], FOLLOWS_S / tick)
            told[place] = limits.held[place] + tick * np.cumsum(told[rate])
        time = tick * np.arange(len(next(iter(told.values()))))
        for name, value in limits.held.items():
            told.setdefault(name, np.full(len(time), value))
        return {n: Signal(time, u) for n, u in told.items()}

    def told(self, chosen: Excitation) -> dict[str, np.ndarray]:
        """What is commanded at every tick, [n] each."""
        return commands(chosen, self.limits.inputs, self.tick_s)

    def _moved(self, carrier: Carrier, chosen: Excitation) -> dict[str, np.ndarray]:
        if chosen not in self._carried:
            self._carried[chosen] = carrier.moved(self.told(chosen), self.tick_s)
        return self._carried[chosen]

    def play(self, chosen: Excitation, fitted: Fitted) -> Played | None:
        """The whole experiment from rest, without noise; None if the model runs away."""
        time = np.arange(0.0, chosen.duration_s - 1e-9, self.period_s)
        first = self.limits.start | dict(chosen.start)
        rest = {n: Signal(time, np.full(len(time), y)) for n, y in first.items()}
        run = Run("experiment", 0.0, chosen.duration_s, self.inputs(chosen), rest)
        h = self._step()
        zero = {n: np.zeros(len(time)) for n in rest}
        window = Window(run, 0.0, int(np.ceil(chosen.duration_s / h)), h, dict.fromkeys(rest, time), zero)
        problem = self._problem([window])
        point = self._point(problem, fitted)
        found = problem.simulate(point, 0)
        if found is None:
            return None
        errors = problem.compare(point, 0, found)[0]
        outputs = {n: Signal(time, -e * problem.sigma[n]) for n, e in errors.items()}
        return Played(chosen, replace(run, outputs=outputs), found[0], h)

    def excess(self, played: Played) -> float:
        """By what factor the outputs leave their limits, seen from their start; at most 1 if they do not."""
        moving = {n: s.values for n, s in (*played.run.inputs.items(), *played.run.outputs.items())}
        if self.carrier is not None:
            moving = self._moved(self.carrier, played.chosen) | moving
        return max(limit.excess(moving[n]) for n, limit in self.limits.outputs.items())

    def doubtful(self, chosen: Excitation, fits: Sequence[Fitted]) -> float:
        """The largest excess with parameters off by DOUBT errors, the ways they are known least."""
        found = 0.0
        for fitted in fits:
            for p in _off(self.study, fitted):
                played = self.play(chosen, replace(fitted, point=replace(fitted.point, p=p)))
                found = max(found, np.inf if played is None else self.excess(played))
        return found

    def rests(self, chosen: Excitation, played: Played) -> bool:
        """Whether the machine stays where the experiment starts until it is driven."""
        for name, place in chosen.start:
            signal = played.run.outputs[name]
            moved = np.abs(signal.values[signal.time < LEAD_S] - place)
            if np.max(moved) > RESTS * np.ptp(signal.values) + 3.0 * self.study.floors[name].level:
                return False
        return True

    def _step(self) -> float:
        if self.study.step_s is not None:
            return self.study.step_s
        return float(np.clip(0.5 * self.period_s, *STEP_S)) / self.finer

    def _problem(self, windows: list[Window]) -> Problem:
        known = self.study.fit_problem
        problem = Problem(self.study.compiled, windows, known.sigma)
        problem.set_scale(known.scale)
        return problem

    def _point(self, problem: Problem, fitted: Fitted) -> Point:
        """Initial states from the outputs, parameters and effects of a fit."""
        start = problem.start(self.study.named(fitted.point.p))
        return problem.with_present(start, fitted.point.present)

    # ---------------------------------------------------------------- what a later fit will see

    def windows(self, played: Played) -> list[Window]:
        """The windows of the new run that a later fit will take: as much of it as is not held out."""
        run = played.run
        whole = len(self.runs) + 1 >= WHOLE or _whole(self.study)
        share = 1.0 if whole else 1.0 - PATTERN.count("holdout") / len(PATTERN)
        block = Block(run, run.start_s, run.start_s + share * (run.end_s - run.start_s))
        return span([block], WINDOW_S, self._step())

    def there(
        self, played: Played, fitted: Fitted, whiteners: list[Whitener] | None = None
    ) -> tuple[Problem, Point]:
        """The fit's problem on the new run, at a fit's parameters and the states that were played."""
        problem = self._problem(self.windows(played))
        point = self._point(problem, fitted)
        x0 = point.x0.copy()
        own = len(self.study.model.states)
        for k, window in enumerate(problem.windows):
            x0[k, :own] = played.at(window.start_s)[:own]
        problem.whiteners = whiteners
        return problem, replace(point, x0=x0)

    def whiteners(self, played: Played, fitted: Fitted, bin_s: float = QUICK_BIN_S) -> list[Whitener] | None:
        """Of the windows of the new run, with the noise that the recordings showed."""
        noise = getattr(self.study, "noise", None)
        if noise is None or not noise.present or self.study.fit_problem.whiteners is None:
            return None
        problem, point = self.there(played, fitted)
        felt = replace(noise, sources=tuple(s for s in noise.sources if s.size > 0.0))
        blurred = starting.blurred(self.study, point)
        return whitening.transferred(felt, problem, point, bin_s, blurred).whiteners()

    # ---------------------------------------------------------------- margins

    def margin(
        self, played: Played, truth: Fitted, rival: Fitted, whiteners: list[Whitener] | None = None
    ) -> float:
        """Predicted margin of `truth`, whose play it is, over `rival`, to first order; see the module."""
        problem, point = self.there(played, rival, whiteners)
        linear = problem.linear(point, [problem.parameter(f.name) for f in rival.free])
        if linear is None:
            return np.inf  # the rival cannot even be simulated
        left = remaining(self.study, linear.errors, linear.slopes, rival)
        return gain(truth, rival.cost - truth.cost + left, len(linear.errors))

    def as_fitted(
        self, fine: Played, truth: Fitted, rival: Fitted, whiteners: list[Whitener] | None
    ) -> float:
        """The margin to first order with a play of finer steps than the fits' in the machine's place.

        Where the steps of a later fit are too coarse for what differs, both sets leave as much.
        """
        left = []
        for fitted in (truth, rival):
            problem, point = self.there(fine, fitted, whiteners)
            linear = problem.linear(point, [problem.parameter(f.name) for f in fitted.free])
            if linear is None:
                return self.margin(fine, truth, rival, whiteners)
            left.append(fitted.cost + remaining(self.study, linear.errors, linear.slopes, fitted))
        return gain(truth, left[1] - left[0], sum(len(s.values) for s in fine.run.outputs.values()))

    def refitted(self, played: Played, truth: Fitted, rival: Fitted) -> float:
        """The same with both sets really fitted to recordings and experiment together."""
        costs, whiteners = [], self.whiteners(played, truth, whitening.BIN_S)
        for fitted in (truth, rival):
            found = self._joint(played, fitted, whiteners)
            if found is None:
                return self.margin(played, truth, rival, whiteners)
            costs.append(found.cost)
        samples = sum(len(s.values) for s in played.run.outputs.values())
        return gain(truth, costs[1] - costs[0], samples)

    def _joint(self, played: Played, fitted: Fitted, whiteners: list[Whitener] | None) -> Fitted | None:
        """A fit to the recordings and the played run."""
        study, known = self.study, self.study.fit_problem
        problem, point = self.there(played, fitted, whiteners)
        joint = self._problem([*known.windows, *problem.windows])
        if known.whiteners is not None or problem.whiteners is not None:
            joint.whiteners = [*_whiteners(known), *_whiteners(problem)]
        start = replace(fitted.point, x0=np.vstack([fitted.point.x0, point.x0]))
        study.fit_problem = joint
        try:
            return study.fit_set(start, fitted.point.present, {})
        finally:
            study.fit_problem = known


def _whiteners(problem: Problem) -> list:
    return problem.whiteners or [lambda values: values] * len(problem.windows)


def _off(study: Study, fitted: Fitted) -> list[np.ndarray]:
    """Parameters off by DOUBT standard errors to both sides, in the WAYS in which they are known least."""
    if not fitted.free:
        return []
    size = np.array([f.size for f in fitted.free])
    columns = [study.extended.index[f.name] for f in fitted.free]
    values, vectors = np.linalg.eigh(fitted.covariance / np.outer(size, size))
    found = []
    for i in range(max(0, len(size) - WAYS), len(size)):
        for sign in (-1.0, 1.0):
            p = fitted.point.p.copy()
            # what nothing tells is off by its own size, and not by as much as it may be
            p[columns] += sign * DOUBT * np.sqrt(np.clip(values[i], 0.0, 1.0)) * vectors[:, i] * size
            p[columns] = np.clip(p[columns], [f.low for f in fitted.free], [f.high for f in fitted.free])
            found.append(p)
    return found


def gain(truth: Fitted, more: float, samples: int) -> float:
    """Twice the log-likelihood that `more` cost is worth, with new `samples` and noise as `truth` met it."""
    s = evidence.sample(truth)
    count = s.count + samples
    expected = count * max(1.0, truth.linear.cost / max(1, s.count))
    return evidence.likelihood_gain(max(expected + more, 1e-9), expected, evidence.Sample(count, s.share))


def information(fitted: Fitted) -> np.ndarray:
    """Of the free parameters, from recordings and priors [K, K]."""
    found = fitted.linear.slopes.T @ fitted.linear.slopes
    return found + np.diag([1.0 / f.prior[1] ** 2 if f.prior else 0.0 for f in fitted.free])


def remaining(study: Study, errors: np.ndarray, slopes: np.ndarray, fitted: Fitted) -> float:
    """Squares left of new `errors`, and lost on the old ones, once the free parameters moved (in bounds)."""
    if not fitted.free:
        return float(errors @ errors)
    size = np.array([f.size for f in fitted.free])
    values, vectors = np.linalg.eigh(information(fitted) * np.outer(size, size))
    held = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    q, r = np.linalg.qr(np.vstack([slopes * size, held]))
    target = q.T @ np.concatenate([errors, np.zeros(len(size))])
    outside = float(errors @ errors) - float(target @ target)
    now = np.array([fitted.point.p[study.extended.index[f.name]] for f in fitted.free])
    low, high = (np.array([getattr(f, end) for f in fitted.free]) for end in ("low", "high"))
    room = (np.minimum((low - now) / size, -1e-9), np.maximum((high - now) / size, 1e-9))
    return max(0.0, outside) + 2.0 * float(lsq_linear(r, target, room).cost)


def _whole(study: Study) -> bool:
    return all(b.start_s <= b.run.start_s and b.end_s >= b.run.end_s for b in study.parts.fit)
