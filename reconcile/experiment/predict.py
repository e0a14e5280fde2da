"""What an experiment would show: played with fitted sets of effects, and how far that sets two of them apart.

The margin of a set over a rival is twice the nats by which recordings and experiment together favour it if it
is true.  The set's play is filtered with the rival; the rival's parameters go where play and recordings
together want them, and the recordings hold them by their information.  A play is without noise: what noise
adds to the innovations is what the true set's own filter expects.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from reconcile.experiment.carried import Carrier
from reconcile.experiment.excitation import LEAD, Excitation, commands, smooth
from reconcile.experiment.limits import Limits
from reconcile.filter.fit import Fitter
from reconcile.filter.kalman import NOISE, Kalman, Values
from reconcile.filter.point import Point
from reconcile.filter.record import Record
from reconcile.recordings.data import Run, Signal
from reconcile.search.core import Core
from reconcile.tolerances import OUTPUT_FLOOR, STUDENT

SAMPLES = 1000  # of an experiment while excitations are compared
COMMANDS = 200  # in that time, at least
MEMORIES = 10.0  # of the outputs in it, where the recordings are as long
FOLLOWS = 0.5  # of the outputs' memory: lag, twice, of an input that another follows; a machine moves it
STEPPED, FINEST = 0.1, 8  # of the noise, by which a play may depend on its steps; times the filter's substeps
DOUBT, WAYS = 2.0, 2  # deviations by which parameters may be off, in the ways in which they are known least
RESTS = 0.05  # of the motion: a machine that moves less by itself stays where it is
THOROUGH = 6  # steps of a rival's fit to an experiment that was chosen
CERTAIN = 1e6  # margin over a rival that cannot even follow the experiment
LENGTHS = (1.0, 0.4, 0.1)  # of a step of that fit, which are tried


@dataclass(frozen=True)
class Played:
    """An experiment as a fitted set predicts it; `loss`, `noise` [N]: what its own filter expects of it."""

    chosen: Excitation
    run: Run
    fitter: Fitter
    loss: np.ndarray
    noise: np.ndarray


class Bench:
    """Plays excitations with fitted sets; inputs change every `tick_s`.

    `fixed_start`: the machine cannot be asked to start elsewhere than in the recordings.  `carrier`: takes
    the commands and moves the model's inputs.
    """

    def __init__(
        self,
        core: Core,
        limits: Limits,
        tick_s: float,
        fixed_start: bool = False,
        carrier: Carrier | None = None,
    ):
        self.core, self.limits, self.tick_s, self.fixed_start = core, limits, tick_s, fixed_start
        self.carrier = carrier
        self._carried: dict[Excitation, dict[str, np.ndarray]] = {}  # motion of the carrier, found once
        self.substeps = core.kalman.substeps
        recorded = max(r.end_s - r.start_s for r in core.runs)
        remembered = min(MEMORIES * core.memory_s, recorded)
        self.duration_s = max(SAMPLES * core.period, COMMANDS * tick_s, remembered)
        # of a recording that a later fit takes; the rest judges it
        self.share = float(np.mean([r.fit.mean() for r in core.records if r.fit.any()]))

    # ---------------------------------------------------------------- playing

    def inputs(self, chosen: Excitation) -> dict[str, Signal]:
        """The model's inputs over time: driven, what follows from that, and the others as they were."""
        limits, tick = self.limits, self.tick_s
        if self.carrier is not None:
            moved = self.carrier.inputs(self._moved(self.carrier, chosen))
            time = next(iter(moved.values())).time
            return {n: Signal(time, np.full(len(time), v)) for n, v in limits.held.items()} | moved
        told = self.told(chosen)
        for rate, place in limits.followers.items():
            told[rate] = smooth(told[rate], FOLLOWS * max(self.core.memory_s, tick) / tick)
            told[place] = limits.held[place] + tick * np.cumsum(told[rate])
        time = tick * np.arange(len(next(iter(told.values()))))
        held = {n: np.full(len(time), v) for n, v in limits.held.items()}
        return {n: Signal(time, u) for n, u in (held | told).items()}

    def told(self, chosen: Excitation) -> dict[str, np.ndarray]:
        """What is commanded at every tick, [n] each."""
        return commands(chosen, self.limits.inputs, self.tick_s)

    def _moved(self, carrier: Carrier, chosen: Excitation) -> dict[str, np.ndarray]:
        if chosen not in self._carried:
            self._carried[chosen] = carrier.moved(self.told(chosen), self.tick_s)
        return self._carried[chosen]

    def motion(self, chosen: Excitation, point: Point) -> Run | None:
        """The whole experiment from rest, without noise; None if the model runs away."""
        core, kalman = self.core, self.core.kalman
        time = np.arange(0.0, chosen.duration_s - 1e-6 * core.period, core.period)
        p = np.array([point.values[n] for n in kalman.whole.index])
        late = {n: kalman.delays.of_output(n, p) for n in core.outputs}
        first = self.limits.start | dict(chosen.start)
        start = {
            n: Signal(np.array([d / (1.0 - drift)]), np.array([first[n]])) for n, (d, drift) in late.items()
        }
        run = Run("experiment", 0.0, chosen.duration_s, self.inputs(chosen), start)
        shown = self._shown(run, time, point)
        if shown is None:
            return None
        outputs = {
            n: Signal(time, np.interp(time - d - drift * time, time, shown[:, o]))
            for o, (n, (d, drift)) in enumerate(late.items())
        }
        return replace(run, outputs=outputs)

    def _shown(self, run: Run, time: np.ndarray, point: Point) -> np.ndarray | None:
        """Outputs [n, NY] of the model by itself.

        What is driven harder than it was may need finer steps: from then on they are taken.
        """
        alone = [(np.arange(len(time)) > 0).astype(int)]
        noise = np.array([point.values[NOISE + n] for n in self.core.outputs])

        def by(substeps: int) -> np.ndarray | None:
            found = self._over(run, time, substeps).run(point.values, point.present, alone, own=True)
            shown = found[0].free if found else None
            if shown is None or not np.isfinite(shown[1:]).all():
                return None
            shown[0] = shown[1]
            return shown

        shown = by(self.substeps)
        while self.core.model.kind == "continuous" and self.substeps < FINEST * self.core.kalman.substeps:
            finer = by(2 * self.substeps)
            if finer is None:
                break
            if shown is not None and np.all(np.mean((finer - shown) ** 2, 0) < (STEPPED * noise) ** 2):
                break
            shown, self.substeps = finer, 2 * self.substeps
        return shown

    def _over(self, run: Run, time: np.ndarray, substeps: int) -> Kalman:
        every = np.ones(len(time), bool)
        found = self.core.kalman.over([Record(run, time, every, ~every, ~every)])
        found.substeps = substeps
        return found

    def play(self, chosen: Excitation, point: Point) -> Played | None:
        """The experiment as a set predicts it, with what its filter expects; None if it runs away."""
        run = self.motion(chosen, point)
        if run is None:
            return None
        time = next(iter(run.outputs.values())).time
        rest = 0.5 * LEAD * chosen.duration_s  # delays move samples there, and nothing else does
        inside = (time >= rest) & (time < chosen.duration_s - rest)
        fitter = Fitter(self._over(run, time, self.substeps), [inside])
        found = fitter.innovations(seen_by(point.values, run), point.present, own=True)
        if found is None:
            return None
        loss = fitter.loss(np.hypot(found[0], np.sqrt(found[1])), found[1])
        return Played(chosen, run, fitter, loss, found[1])

    def excess(self, chosen: Excitation, run: Run) -> float:
        """By what factor the outputs leave their limits, seen from their start; at most 1 if they do not."""
        moving = {n: s.values for n, s in (*run.inputs.items(), *run.outputs.items())}
        if self.carrier is not None:
            moving = self._moved(self.carrier, chosen) | moving
        return max((limit.excess(moving[n]) for n, limit in self.limits.outputs.items()), default=0.0)

    def doubtful(self, chosen: Excitation, points: Sequence[Point]) -> float:
        """The largest excess with parameters off by DOUBT errors, the ways they are known least."""
        runs = [self.motion(chosen, replace(p, values=v)) for p in points for v in self._off(p)]
        return max((np.inf if r is None else self.excess(chosen, r) for r in runs), default=0.0)

    def _off(self, point: Point) -> list[Values]:
        at = self.moving(point)
        values, vectors = np.linalg.eigh(point.covariance()[np.ix_(at, at)])
        found = []
        for i in range(max(0, len(at) - WAYS), len(at)):
            for side in (-DOUBT, DOUBT):
                off = side * np.sqrt(max(values[i], 0.0)) * vectors[:, i]
                found.append(_moved_by(point, at, _coordinates(point.values, point)[at] + off))
        return found

    def rests(self, chosen: Excitation, run: Run) -> bool:
        """Whether the machine stays where the experiment starts until it is driven."""
        for name, place in chosen.start:
            signal = run.outputs[name]
            moved = np.abs(signal.values[signal.time < LEAD * chosen.duration_s] - place)
            if np.max(moved) > RESTS * np.ptp(signal.values) + 3.0 * self.core.floors[name].level:
                return False
        return True

    # ---------------------------------------------------------------- margins

    def moving(self, point: Point, noise: bool = False) -> np.ndarray:
        """Free coordinates that are at no limit; with those of the noise, or without."""
        left = set() if noise else {f.name for f in self.core.noise_free}
        free = zip(point.free, point.held, strict=True)
        return np.array([k for k, (f, held) in enumerate(free) if not held and f.name not in left], int)

    def margin(self, played: Played, truth: Point, rival: Point, thorough: bool = False) -> float:
        """Predicted margin of `truth`, whose play it is, over `rival`; see the module."""
        left = self._refitted(played, rival, thorough)
        return min(2.0 * (rival.total - truth.total + left), CERTAIN)

    def _refitted(self, played: Played, rival: Point, thorough: bool) -> float:
        """Nats that the rival loses on play and recordings; few steps from where the recordings left it."""
        at = self.moving(rival, thorough)
        held = rival.information[np.ix_(at, at)] + np.eye(len(at))
        begin = _coordinates(rival.values, rival)[at]

        def lost(values: Values):
            found = played.fitter.innovations(seen_by(values, played.run), rival.present, own=True)
            if found is None:
                return np.inf, None
            loss = played.fitter.loss(np.hypot(found[0], np.sqrt(played.noise)), found[1])
            both = ~np.isnan(found[0]) & ~np.isnan(played.noise)
            off = _coordinates(values, rival)[at] - begin
            return self.share * float((loss - played.loss)[both].sum()) + 0.5 * float(off @ held @ off), found

        values = rival.values
        most, found = lost(values)
        for _ in range(THOROUGH if thorough else 1):
            now, before = _coordinates(values, rival)[at], most
            step = found and self._step(played, rival, values, found, at, held, now - begin)
            if step is None:
                break
            for length in LENGTHS:
                trial = _moved_by(replace(rival, values=values), at, now + length * step)
                less, there = lost(trial)
                if less < most:
                    values, most, found = trial, less, there
                    break
            if before - most < 0.01 * max(abs(most), 1.0):
                break
        return most

    def _step(self, played: Played, rival: Point, values: Values, found, at, held, off) -> np.ndarray | None:
        """Of Fisher scoring, with the noise that the play's innovations would have."""
        e, s = found
        free = [rival.free[k] for k in at]
        values = seen_by(values, played.run)
        slopes = played.fitter.columns(values, rival.present, free, e, s, own=True)
        if slopes is None or not free:
            return None
        both = ~np.isnan(e) & ~np.isnan(played.noise)
        (de, ds), e, s, noise = (x[both] for x in slopes), e[both], s[both], played.noise[both]
        weight = (STUDENT + 1.0) / (STUDENT * s + e * e + noise)
        gradient = de.T @ (weight * e) + ds.T @ (0.5 - 0.5 * weight * (e * e + noise))
        _, information = played.fitter.score(e, s, de, ds)
        pulled = self.share * gradient + held @ off
        return np.clip(-np.linalg.solve(self.share * information + held, pulled), -3.0, 3.0)


def information(bench: Bench, played: Played, point: Point, at: np.ndarray) -> np.ndarray:
    """What an experiment would tell of some free coordinates of a set, whose play it is [K, K]."""
    values, free = seen_by(point.values, played.run), [point.free[k] for k in at]
    found = played.fitter.innovations(values, point.present, own=True)
    if found is None:
        return np.zeros((len(at), len(at)))
    slopes = played.fitter.columns(values, point.present, free, *found, own=True)
    if slopes is None:
        return np.zeros((len(at), len(at)))
    return bench.share * played.fitter.score(*found, *slopes)[1]


def seen_by(values: Values, run: Run) -> Values:
    """The values with the noise that a later fit allows each output at least, by how it moves."""
    least = {NOISE + n: OUTPUT_FLOOR * float(np.std(s.values)) for n, s in run.outputs.items()}
    return values | {n: max(values[n], low) for n, low in least.items()}


def _coordinates(values: Mapping[str, float], point: Point) -> np.ndarray:
    return np.array([f.coordinate(values[f.name]) for f in point.free])


def _moved_by(point: Point, at: np.ndarray, z: np.ndarray) -> Values:
    """Values with some coordinates elsewhere, within their limits."""
    return dict(point.values) | {
        point.free[k].name: point.free[k].value(c) for k, c in zip(at, z, strict=True)
    }
