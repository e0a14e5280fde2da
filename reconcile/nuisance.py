"""Clocks of recordings: a time offset between inputs and outputs, or a drift of it, that differs by run.

An offset that all runs share cannot be told from a delay of the inputs or of all sensors: it is a hypothesis
of the catalogue.  One that differs from run to run is not the machine's.  It is estimated with the answer of
a search, from the slopes of its errors by a delay of all outputs; where the runs differ, the offsets are
taken out of the recordings, which are then examined again.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from reconcile import evidence
from reconcile.data import Run, Signal, split
from reconcile.fit.solve import Fitted
from reconcile.model import Attached
from reconcile.search import Answer
from reconcile.study import Study

GAIN = 10.0  # of twice the log-likelihood, beyond what the parameters cost
MOST_S = 0.5  # told from slopes: what is later is not told by them, and comes from a model that is wrong
ASTRAY = 5.0  # deviations: a model that leaves more with clocks than that tells nothing of them by its slopes
LEAST = 0.2  # of a sample period: smaller offsets do no harm
ROUNDS = 3
SETTLED = 0.02  # of a sample period: what another round may change
ALIKE = ("input_delay", "sensor_delay")
Given = Sequence[Sequence[Run]]  # to fit, to confirm, held out


@dataclass(frozen=True)
class Clock:
    """A run's outputs against its inputs: late by `offset_s` + `drift` times the time since its start."""

    offset_s: float = 0.0
    drift: float = 0.0
    offset_error: float = 0.0
    drift_error: float = 0.0

    def figures(self) -> dict[str, object]:
        """As the report has it."""
        found: dict[str, object] = {
            "time_offset_s": self.offset_s,
            "time_offset_ci95": _interval(self.offset_s, self.offset_error),
        }
        if self.drift:
            found |= {
                "clock_drift": self.drift,
                "clock_drift_ci95": _interval(self.drift, self.drift_error),
            }
        return found


def differing(study: Study, answer: Answer) -> dict[str, Clock]:
    """Clocks by run where they differ between runs by more than their errors; {} where they do not.

    The run whose outputs are least late is the reference, at 0: what all have in common is a delay.
    """
    rows = _rows(study, answer.fitted)
    if rows is None or len(rows.runs) < 2:
        return {}
    pays = {n: _pays(rows, n) for n in range(1, rows.late.shape[1] + 1)}
    count = max(pays, key=lambda n: pays[n])
    if pays[count] <= GAIN or not _explains(rows, count):
        return {}
    clocks = _clocks(rows, count, delay(study, answer))
    largest = max(abs(c.offset_s) + abs(c.drift) * _length(study) for c in clocks.values())
    return clocks if LEAST * period(study) < largest < MOST_S else {}


def settled(given: Given, clocks: dict[str, Clock], study: Study, answer: Answer) -> dict[str, Clock]:
    """The same once the recordings, set right so far, are fitted and looked at again; few rounds will do."""
    reference = next((n for n, c in clocks.items() if c.offset_s == c.drift == 0.0), "")
    count = 2 if any(c.drift for c in clocks.values()) else 1
    values = study.named(answer.fitted.point.p)
    for _ in range(ROUNDS):
        again = Study(study.folder, split(*(corrected(runs, clocks) for runs in given)))
        start = again.fit_problem.start(again.values | {f.name: values[f.name] for f in answer.fitted.free})
        fitted = again.fit_set(start, answer.present, {})
        rows = None if fitted is None else _rows(again, fitted)
        if rows is None or set(rows.runs) != set(clocks):
            return clocks
        more = _clocks(rows, count, reference=reference)
        clocks = {n: _sum(c, more[n]) for n, c in clocks.items()}
        if max(abs(c.offset_s) for c in more.values()) < SETTLED * period(study):
            break
    return clocks


def corrected(runs: Sequence[Run], clocks: Mapping[str, Clock]) -> list[Run]:
    """The runs with their outputs' times set right."""
    return [_corrected(r, clocks[r.name]) if r.name in clocks else r for r in runs]


def said(clocks: Mapping[str, Clock]) -> str:
    """What was found, in one sentence."""
    worst = max(clocks, key=lambda n: abs(clocks[n].offset_s))
    return (
        f"Outputs of {worst} are {clocks[worst].offset_s:+.3g} s late against those of other recordings: a "
        "matter of their clocks, which was taken out"
    )


def alike(present: Sequence[Attached], runs: Sequence[Run]) -> dict[str, dict[str, object]]:
    """A note on each run if a delay is in the answer: a time offset of every recording looks the same."""
    late = sorted({a.effect.name for a in present} & set(ALIKE))
    return {r.name: {"looks_like": late} for r in runs} if late else {}


def column(study: Study, name: str) -> int | None:
    """Parameter of a delay, or a drift, of all outputs."""
    several = len(study.floors) > 1
    fitting = [
        a
        for a in study.candidates
        if a.effect.name == name
        and len(study.folder.ports.members(a.port)) >= len(study.floors)
        and (several or a.port in study.floors)
    ]
    return study.extended.index[fitting[0].free[0]] if fitting else None


def delay(study: Study, answer: Answer) -> float:
    """The delay (s) that the effects of an answer are, of inputs and of outputs together."""
    late = [a.free[0] for a in answer.present if a.effect.name in ALIKE]
    return float(sum(answer.fitted.point.p[study.extended.index[n]] for n in late))


def period(study: Study) -> float:
    """Shortest sample period (s) of the recordings that are fitted."""
    return min(b.run.period_s for b in study.parts.fit)


@dataclass(frozen=True)
class _Rows:
    """Errors [M], slopes by what is free anyway [M, K], by an offset and a drift [M, 2], run of each row."""

    errors: np.ndarray
    slopes: np.ndarray
    late: np.ndarray
    run: np.ndarray
    runs: list[str]
    ridge: np.ndarray
    excess: float  # variance of the errors, and how many of them count as one
    effective: float
    length_s: float  # of the longest run


def _rows(study: Study, fitted: Fitted) -> _Rows | None:
    """Rows of fit and holdout; a run that is fitted counts with what is fitted of it."""
    delay, drift = (column(study, n) for n in ("sensor_delay", "clock_drift"))
    if delay is None:
        return None
    free = [study.extended.index[f.name] for f in fitted.free]
    names: list[str] = []
    found = []
    for which in ("short", "holdout"):  # the model gets not far
        problem = study.problems[which]
        point = getattr(study.elsewhere(fitted, which), "point", None)
        linear = point and problem.linear(point, [*free, delay, *([drift] if drift is not None else [])])
        if not linear:
            continue
        fresh = [w.run.name not in names for w in problem.windows]
        names += dict.fromkeys(w.run.name for w, new in zip(problem.windows, fresh, strict=True) if new)
        counts = [sum(len(e) for e in raw.values()) for raw in linear.raw]
        keep = np.repeat(fresh, counts)
        at = np.repeat([names.index(w.run.name) for w in problem.windows], counts)
        found.append((linear.errors[keep], linear.slopes[keep], at[keep]))
    if not found:
        return None
    errors, slopes, at = (np.concatenate(x) for x in zip(*found, strict=True))
    s = evidence.sample(fitted)
    ridge = np.array([1.0 / f.prior[1] ** 2 if f.prior else 0.0 for f in fitted.free])
    k = len(free)
    rows = _Rows(errors, slopes[:, :k], slopes[:, k:], at, names, ridge, 1.0, s.effective, _length(study))
    left = _solved(rows, _by_run(rows, rows.late.shape[1]))[0]  # with clocks at their best: the noise
    return replace(rows, excess=max(1.0, left / max(1, len(errors) - k)) / s.share)


def _pays(rows: _Rows, count: int) -> float:
    """Gain of offsets (2: and drifts) by run over what all share, in BIC; 2 may also beat 1."""
    together = _solved(rows, rows.late[:, :1])[0]
    gain = (together - _solved(rows, _by_run(rows, count))[0]) / rows.excess
    return gain - (count * len(rows.runs) - 1) * np.log(rows.effective)


def _explains(rows: _Rows, count: int) -> bool:
    """Whether clocks by run leave about the noise, or at least half of what stood above it goes by them.

    A model that is wrong otherwise is out of step with every run in its own way.
    """
    together, left = (_solved(rows, late)[0] for late in (rows.late[:, :1], _by_run(rows, count)))
    noise = len(rows.errors)
    half = left < ASTRAY**2 * noise and together - left > 0.5 * (together - noise)
    return left < evidence.AT_FLOOR**2 * noise or half


def _by_run(rows: _Rows, count: int) -> np.ndarray:
    return np.hstack([rows.late[:, :count] * (rows.run == r)[:, None] for r in range(len(rows.runs))])


def _clocks(rows: _Rows, count: int, late: float = 0.0, reference: str = "") -> dict[str, Clock]:
    """Clocks by run against the reference: the run named, else that which with `late` is nearest to 0."""
    _, values, covariance = _solved(rows, _by_run(rows, count))
    values = values.reshape(-1, count)
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0) * rows.excess).reshape(-1, count)
    ends = values[:, 0] + (values[:, 1] * rows.length_s if count > 1 else 0.0)
    least = int(np.argmin(np.maximum(np.abs(values[:, 0] + late), np.abs(ends + late))))
    found = values - values[rows.runs.index(reference) if reference in rows.runs else least]
    none = np.zeros((len(found), 2 - count))
    table = zip(rows.runs, np.hstack([found, none]), np.hstack([errors, none]), strict=True)
    return {name: Clock(float(v[0]), float(v[1]), float(e[0]), float(e[1])) for name, v, e in table}


def _sum(c: Clock, more: Clock) -> Clock:
    offset, drift = c.offset_s + more.offset_s, c.drift + more.drift
    return Clock(offset, drift, more.offset_error, more.drift_error)


def _solved(rows: _Rows, late: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Cost that is left, values of the last columns and their covariance for errors of unit variance."""
    whole = np.hstack([rows.slopes, late])
    information = whole.T @ whole
    k = rows.slopes.shape[1]
    information[:k, :k] += np.diag(rows.ridge)
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    inverse = np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-12) / np.outer(scale, scale)
    x = inverse @ (whole.T @ rows.errors)
    left = rows.errors - whole @ x
    return float(left @ left + rows.ridge @ x[:k] ** 2), x[k:], inverse[k:, k:]


def _length(study: Study) -> float:
    return max(b.run.end_s - b.run.start_s for b in study.parts.fit)


def _corrected(run: Run, clock: Clock) -> Run:
    outputs = {
        n: Signal(s.time - clock.offset_s - clock.drift * (s.time - run.start_s), s.values)
        for n, s in run.outputs.items()
    }
    start = max(run.start_s, *(s.time[0] for s in outputs.values()))
    end = min(run.end_s, *(s.time[-1] for s in outputs.values()))
    return replace(run, start_s=float(start), end_s=float(end), outputs=outputs)


def _interval(value: float, error: float) -> list[float]:
    return [value - 1.96 * error, value + 1.96 * error]
