"""Units and signs asked first: outputs that are rates of others must change them by what they say."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

DEGREES = {57.29578: "degrees against radians"}
TURNING = DEGREES | {9.549297: "revolutions per minute against rad/s"}
THOUSAND = {1000.0: "a factor of 1000, such as mm against m or ms against s"}
HUNDRED = {100.0: "a factor of 100, such as per cent against 1 or cm against m"}
OTHER = THOUSAND | {3.6: "km/h against m/s"}
RATIOS = TURNING | HUNDRED | OTHER | {-1.0: "the sign is turned"}
USUAL = (
    (("rad", "deg"), DEGREES),
    (("rad/s", "deg/s", "rpm"), TURNING),
    (("m/s", "km/h"), OTHER),
    (("1", "%", "m", "cm"), HUNDRED | THOUSAND),
)
CLOSE = 0.02  # of a ratio, relative
SURE = 0.95  # correlation between changes of a position and its integrated speed
LAGS = (1, 2, 5, 10, 20, 50)  # samples
SHORTEST = 12  # changes to compare
FAR_BEYOND = 3.0  # times the limits that a model states of an input: no command, another unit
OFTEN = 0.25  # of an output's samples, that lie outside of its limits: another unit or sign
NEARLY = 0.1  # of what it spans, by which a sample may lie outside: noise, a zero that is off
SATURATED = 0.5  # share of samples at one extreme value, and not all of them


@dataclass(frozen=True)
class Doubt:
    """A channel whose unit or sign is not what it is taken for; `sentence` says it and what settles it."""

    rate: str
    position: str
    ratio: float
    sentence: str


def doubts(model: Any, runs: Sequence[Any], names: Mapping[str, str] | None = None) -> list[Doubt]:
    """Pairs of recorded channels, one the rate of the other by the model, whose ratio is a known mistake.

    `names`: the map, {their column: ours}, to say the line that settles it.
    """
    found = []
    for position, rate in pairs(model):
        measured = [m for r in runs if (m := _ratio(r, position, rate)) is not None]
        if not measured:
            continue
        ratio = float(np.median(measured))
        for known, words in known_ratios().items():
            if abs(ratio / known - 1.0) < CLOSE:
                text = _sentence(model, position, rate, ratio, words, names or {})
                found.append(Doubt(rate, position, ratio, text))
                break
    return found


def question(model: Any, runs: Sequence[Any], names: Mapping[str, str] | None = None) -> str:
    """What is asked before anything is fitted; "" where nothing is."""
    return beyond(model, runs, names) or next((d.sentence for d in doubts(model, runs, names)), "")


def beyond(model: Any, runs: Sequence[Any], names: Mapping[str, str] | None = None) -> str:
    """A question on an input far beyond its limits in model.py, or an output often outside; "" without."""
    theirs = {bare(ours): column for column, ours in (names or {}).items()}
    for v in model.inputs:
        values = [np.abs(r.inputs[v.name].values).max() for r in runs if v.name in r.inputs]
        most = max(abs(v.min or 0.0), abs(v.max or 0.0))
        if values and most and (reach := max(values)) > FAR_BEYOND * most:
            column = str(theirs.get(v.name, v.name))
            said = f"column {column} reaches {reach:g}, and {v.name} [{v.unit}] at most {most:g} by model.py"
            return f"{said}: {_unit_line(column, v)}, or correct model.py"
    return next(
        (s for v in model.outputs if (s := _outside(v, runs, str(theirs.get(v.name, v.name)), names or {}))),
        "",
    )


def _unit_line(column: str, v: Any) -> str:
    return f"state its unit in [names] of --map, as in '{column}' = '{v.name} [unit]'"


def _outside(v: Any, runs: Sequence[Any], column: str, names: Mapping[str, str]) -> str:
    """The same of an output whose values often lie outside of its limits."""
    each = [r.outputs[v.name].values for r in runs if v.name in r.outputs]
    if not each or (v.min is None and v.max is None):
        return ""
    values, low, high = np.concatenate(each), v.min, v.max
    near = NEARLY * float(np.ptp(values))
    low, high = (-np.inf if low is None else low), (np.inf if high is None else high)
    out = lambda y: float(np.mean((y < low - near) | (y > high + near)))  # noqa: E731
    if out(values) <= OFTEN:
        return ""
    said = f"column {column} has values from {values.min():g} to {values.max():g}, often outside of "
    said += f"{v.name}'s limits in model.py, {low:g} to {high:g} {v.unit}"
    how = _unit_line(column, v)
    if out(-values) <= OFTEN:
        how = f"is its sign turned? Then write {turned_line(v.name, names)} in [names] of --map"
    return f"{said}: {how}, or correct model.py"


def notes(runs: Sequence[Any]) -> list[str]:
    """Sentences about channels that keep one value, or lie at an extreme value for long."""
    found = []
    for name in dict.fromkeys(n for r in runs for n in (*r.inputs, *r.outputs)):
        values = np.concatenate([s.values for r in runs if (s := r.inputs.get(name) or r.outputs.get(name))])
        if np.ptp(values) == 0.0:
            found.append(f"{name} keeps one value, {values[0]:g}")
            continue
        for word, extreme in (("largest", values.max()), ("smallest", values.min())):
            share = float(np.mean(values == extreme))
            if share > SATURATED and len(np.unique(values)) > 3:
                found.append(
                    f"{name} is at its {word} value, {extreme:g}, for {100 * share:.0f} % of the time"
                )
    return found


def pairs(model: Any) -> list[tuple[str, str]]:
    """(position, rate): outputs, the second (or an input) being the first's derivative in the model."""
    if model.kind != "continuous" or model.symbolic == "MX":
        return []
    x, u, m, p = model.symbols
    h, f = model.h(x, u, m, p), model.f(x, u, m, p)
    slope = ca.jtimes(h, x, f)
    still = [not ca.depends_on(h[i], u) if model.inputs else True for i in range(len(model.outputs))]
    both = ca.Function("rates", [x, u, m, p], [slope, ca.vertcat(h, u)])
    rng = np.random.default_rng(0)  # points to compare at, no matter which
    p0, m0 = model.start_parameters(), ca.DM([v.start for v in model.modes])
    points = [
        (rng.uniform(0.1, 1, len(model.states)), rng.uniform(0.1, 1, len(model.inputs))) for _ in range(3)
    ]
    seen = [[np.asarray(a).ravel() for a in both(a, b, m0, p0)] for a, b in points]
    slopes, values = (np.array([s[k] for s in seen]) for k in (0, 1))
    names = [v.name for v in (*model.outputs, *model.inputs)]
    return [
        (o.name, names[j])
        for i, o in enumerate(model.outputs)
        if still[i]
        for j in range(len(names))
        if j != i and np.any(slopes[:, i]) and np.allclose(slopes[:, i], values[:, j], rtol=1e-6)
    ]


def turns(model: Any, recorded: Sequence[str]) -> list[list[str]]:
    """Recorded outputs that turn together: a position with its rate; others alone."""
    both = [[p, r] for p, r in pairs(model) if p in recorded and r in recorded]
    rest = [[n] for n in recorded if not any(n in pair for pair in both)]
    return both + rest


def turned_line(name: str, names: Mapping[str, str]) -> str:
    """The line of [names] that turns a channel's sign, with the unit that it states there.

    `names`: the map, {their column: ours}.
    """
    for column, ours in names.items():
        if bare(ours) == name:
            own = ours.strip()
            return f"'{column}' = '{own[1:].strip() if own.startswith('-') else '-' + own}'"
    return f"'{name}' = '-{name}'"


def known_ratios() -> dict[float, str]:
    """Ratios to recognise, their inverses and both signs."""
    signed = {r: w for k, w in RATIOS.items() for r in ({k, 1 / k} if k > 0 else {k})}
    turned = {-r: w + ", and the sign is turned" for r, w in signed.items() if r > 0}
    return signed | turned


def other_units(unit: str) -> list[float]:
    """What a channel of a unit may have to be multiplied by, if it is in another one."""
    usual = next((ratios for units, ratios in USUAL if unit in units), THOUSAND)
    return both_ways(usual)


def both_ways(ratios: Iterable[float]) -> list[float]:
    """Ratios and their inverses: either side may be in the other unit."""
    return [r for k in ratios for r in (1 / k, k)]


def _ratio(run: Any, position: str, rate: str) -> float | None:
    """Integral of the rate over the change of the position; None where they do not go together."""
    q = run.outputs.get(position)
    v = run.outputs.get(rate) or run.inputs.get(rate)
    if q is None or v is None:
        return None
    values = np.interp(q.time, v.time, v.values)
    area = np.append(0.0, np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(q.time)))
    best, found = SURE, None
    for lag in LAGS:
        if len(area) < lag + SHORTEST:
            break
        a, b = area[lag:] - area[:-lag], q.values[lag:] - q.values[:-lag]
        kept = np.abs(b) < 0.5 * np.ptp(q.values) + 1e-300  # where a sensor wraps, it jumps
        a, b = a[kept], b[kept]
        if len(a) < SHORTEST or not np.ptp(a) or not np.ptp(b):
            continue
        c = float(np.corrcoef(a, b)[0, 1])
        if abs(c) > best:
            best, found = abs(c), float(np.copysign(np.sqrt(np.mean(a**2) / np.mean(b**2)), c))
    return found


def _sentence(
    model: Any, position: str, rate: str, ratio: float, words: str, names: Mapping[str, str]
) -> str:
    units = {v.name: v.unit for v in (*model.outputs, *model.inputs)}
    theirs = {bare(ours): column for column, ours in names.items()}
    column, base = theirs.get(rate, rate), theirs.get(position, position)
    if ratio < 0 and abs(ratio + 1) < CLOSE:
        either = f"{turned_line(rate, names)} or {turned_line(position, names)}"
        line = f"{either} in [names] of --map turns one of them"
    else:
        line = (
            f"state the unit of the wrong one in [names] of --map: '{column}' = '{rate} [unit]' or "
            f"'{base}' = '{position} [unit]'{_of_clock(ratio, theirs)}"
        )
    return (
        f"column {column} ({rate} in {units[rate]}) is {ratio:.4g} times the slope of column {base} "
        f"({position} in {units[position]}): {words}; {line}"
    )


def _of_clock(ratio: float, theirs: Mapping[str, str]) -> str:
    """The line that would settle it where the clock's times are in ms or us."""
    unit = {1000.0: "ms", 1e6: "us"}.get(10.0 ** round(float(np.log10(abs(ratio)))))
    column = theirs.get("time", "time")
    return f", or '{column}' = 'time [{unit}]' if it is the times that are in {unit}" if unit else ""


def bare(ours: str) -> str:
    """The name in an entry of the map, without sign and unit."""
    return ours.partition("[")[0].strip().removeprefix("-").strip()
