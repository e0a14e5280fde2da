"""Where a closed FMU and the recordings disagree: errors of its outputs against the channels that exist.

Its states are unknown.  In their place are its recorded outputs, and the sample differences of a position
whose speed is not recorded; regimes of these, of commands and of loads are as for an open model.

An output of an FMU that is pushed wrongly stays wrong for a while.  What tells the regime is when the error
arises: the part of it that does not follow from the errors shortly before as the FMU's free responses do
(starts.py).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from fmus.definition import Variable
from reconcile.closed.box import VELOCITIES
from reconcile.closed.fitted import ClosedFit
from reconcile.closed.problem import ClosedProblem
from reconcile.closed.windows import MARGIN_S, Window, cut
from reconcile.equations.ports import Axis
from reconcile.errors import localise
from reconcile.errors.localise import Located
from reconcile.errors.residual import Residual
from reconcile.recordings.data import Run, Signal

CHANGE_S = 0.2  # over which a rate is taken
LAGS, LAG_S = 2, 0.1  # earlier errors that later ones follow from
OWN = 0.3  # of a speed's size: by which a position's sample differences may differ from it


class Channels:
    """Recorded channels in the form of a study: outputs and their rates stand for states."""

    def __init__(self, problem: ClosedProblem):
        self.parts, self.floors = problem.parts, problem.sigma
        outputs = [v for v in problem.box.model.outputs if v.name in problem.outputs]
        axes = _axes(problem, outputs)
        units = {v.name: v.unit for v in outputs}
        rates = [Variable(a.velocity, f"{units[a.name]}/s") for a in axes if a.velocity not in units]
        self.states = [*outputs, *rates]
        names = [v.name for v in self.states]
        self.model = SimpleNamespace(
            name=problem.box.model.name,
            states=self.states,
            inputs=problem.box.model.inputs,
            outputs=problem.box.model.outputs,
            index=lambda _, name: names.index(name),
        )
        ports = SimpleNamespace(axes=axes, controls=problem.box.ports.controls)
        self.folder = SimpleNamespace(ports=ports)

    def at(self, run: Run, times: np.ndarray) -> np.ndarray:
        """The channels that stand for states at times [n] of a run: [n, NX]."""
        return np.column_stack([self._one(run, v.name, times) for v in self.states])

    def _one(self, run: Run, name: str, times: np.ndarray) -> np.ndarray:
        if name in run.outputs:
            signal = run.outputs[name]
            return np.interp(times, signal.time, signal.values)
        axis = next(a for a in self.folder.ports.axes if a.velocity == name)
        return _rate(run.outputs[axis.name], times)


def locate(problem: ClosedProblem, base: ClosedFit) -> tuple[Channels, list[Located]]:
    """Every output whose error stands above its noise, the largest first, and the channels it is set against.

    Errors are looked at as they arise; where nothing stands out of the noise so, as they are.
    """
    channels, left = Channels(problem), _left(problem, base)
    if left is None:
        return channels, []
    arising = localise.gathered(channels, [_arising(problem, channels, n, left) for n in problem.outputs])
    return channels, arising or localise.gathered(
        channels, [_residual(problem, channels, n, left) for n in problem.outputs]
    )


def rows(problem: ClosedProblem, base: ClosedFit) -> list[dict]:
    """The report's `where`, in the form of an open model's: of the re-estimated FMU without effects."""
    return localise.rows(*locate(problem, base))


# -------------------------------------------------------------------------------- channels


def _axes(problem: ClosedProblem, outputs: Sequence[Variable]) -> list[Axis]:
    """Every recorded speed, with the position of which it is the rate; of other positions the differences."""
    speeds = [v for v in outputs if v.unit in VELOCITIES]
    found, taken = [], set()
    for p in (v for v in outputs if f"{v.unit}/s" in VELOCITIES):
        own = (v for v in speeds if v.unit == f"{p.unit}/s" and v.name not in taken)
        speed = next((v.name for v in own if _is_rate(problem, p.name, v.name)), f"d{p.name}/dt")
        taken.add(speed)
        found.append(Axis(p.name, speed, p.name, ""))
    return found + [Axis(v.name, v.name, None, "") for v in speeds if v.name not in taken]


def _is_rate(problem: ClosedProblem, position: str, speed: str) -> bool:
    """Whether the one is the rate of the other in the longest run."""
    run = max(problem.runs, key=lambda r: r.end_s - r.start_s)
    v = run.outputs[speed]
    differs = v.values - _rate(run.outputs[position], v.time)
    return float(np.mean(differs**2)) < OWN**2 * float(np.mean(v.values**2))


def _rate(signal: Signal, times: np.ndarray) -> np.ndarray:
    """Differences of a signal over CHANGE_S about each time [n], by second."""
    ends = np.clip([times - 0.5 * CHANGE_S, times + 0.5 * CHANGE_S], signal.time[0], signal.time[-1])
    before, after = (np.interp(e, signal.time, signal.values) for e in ends)
    return (after - before) / (ends[1] - ends[0])


# -------------------------------------------------------------------------------- what is left


@dataclass(frozen=True)
class _Left:
    """Errors and slopes by base parameters [n, 1 + K] in units of the noise, at `times` [n] to fit."""

    times: Mapping[tuple[str, str], np.ndarray]
    values: Mapping[tuple[str, str], np.ndarray]

    def at(self, run: Run, name: str, times: np.ndarray) -> np.ndarray:
        """Those of an output at times [m]: [m, 1 + K]."""
        known, table = self.times[run.name, name], self.values[run.name, name]
        return np.column_stack([np.interp(times, known, column) for column in table.T])


def _left(problem: ClosedProblem, base: ClosedFit) -> _Left | None:
    found = problem.slopes(base.effects, base.values, problem.base)
    if found is None:
        return None
    table = np.column_stack([found[0], found[1] * [f.size for f in problem.base]])
    insides = {r.name: (r, problem.inside(r, "fit")) for r in problem.runs}
    times = {(r, n): insides[r][0].outputs[n].time[insides[r][1][n]] for r, n in base.errors["fit"]}
    ends = np.cumsum([len(t) for t in times.values()])
    return _Left(times, dict(zip(times, np.split(table, ends[:-1]), strict=True)))


def _residual(
    problem: ClosedProblem,
    channels: Channels,
    name: str,
    left: _Left,
    past: Mapping[tuple[str, float], float] | None = None,
) -> Residual:
    """Error of one output; less `past`, weights of the outputs' errors a time (s) before, if it is given."""
    moments, past = _moments(problem, name), past or {}
    now = np.vstack([left.at(w.run, name, t) for w, t in moments])
    for (n, late), weight in past.items():
        now = now - weight * np.vstack([left.at(w.run, n, t - late) for w, t in moments])
    level = problem.sigma[name]
    noise = np.full(len(now), level * float(np.sqrt(1.0 + sum(w**2 for w in past.values()))))
    unit = next(v.unit for v in problem.box.model.outputs if v.name == name)
    said = f"error of {name}" + (", as it arises" if past else "")
    where = (moments, np.vstack([channels.at(w.run, t) for w, t in moments]))
    return Residual(said, unit, None, (name,), level * now[:, 0], noise, *where, level * now[:, 1:])


def _moments(problem: ClosedProblem, name: str) -> tuple[tuple[Window, np.ndarray], ...]:
    """Windows of the part to fit with the times of an output's samples; evenly chosen of many."""
    found = []
    for w in cut(problem.parts.fit):
        first = w.run.start_s + MARGIN_S + LAGS * LAG_S  # errors before must be known as well
        found.append((w, w.times[name][w.times[name] >= first]))
    return tuple((w, t) for w, t in found if len(t))


def _arising(problem: ClosedProblem, channels: Channels, name: str, left: _Left) -> Residual:
    """The part of an output's error that does not follow from earlier errors, as free responses follow.

    Weights are of least squares, for errors of the size met and with the noise that they would add.
    """
    pairs = [(n, LAG_S * (k + 1)) for n in problem.outputs for k in range(LAGS)]
    moments = _moments(problem, name)
    now = np.concatenate([_free(problem, w.run, name, t) for w, t in moments])
    past = [np.concatenate([_free(problem, w.run, n, t - late) for w, t in moments]) for n, late in pairs]
    size = max(float(np.max(np.abs(v[:, 0]))) for v in left.values.values()) * np.sqrt(max(len(now), 1))
    rows = np.vstack([size * np.column_stack(past), np.sqrt(max(len(now), 1)) * np.eye(len(pairs))])
    target = np.concatenate([size * now, np.zeros(len(pairs))])
    weights = np.linalg.lstsq(rows, target, rcond=None)[0]
    return _residual(problem, channels, name, left, dict(zip(pairs, map(float, weights), strict=True)))


def _free(problem: ClosedProblem, run: Run, name: str, times: np.ndarray) -> np.ndarray:
    """The free responses of an output at times [n] of a run, one after the other [n K]."""
    known = problem.starts.bases[run.name][name]
    time = run.outputs[name].time
    return np.concatenate([times[:0], *(np.interp(times, time, column) for column in known.T)])
