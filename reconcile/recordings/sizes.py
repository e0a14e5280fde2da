"""Columns without a unit whose size says that they are in another one: degrees for radians, mm for m, rpm.

What is looked at: the range that the model states for the variable; speed against position where both are
recorded; and what the model itself answers to the recorded inputs.  A factor of 57.3 or 1000 is no missing
effect and no wrong parameter, nor is one of 9.55 between a speed and its position; a column that states its
unit is taken at its word.

Two signals are compared by their changes, and only where these go together: of a machine that hardly moves
they are noise, or what disturbs it, whose size beside anything else says nothing of units.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from fmus.definition import Model
from fmus.toolchain.discrete import DiscreteStepper
from fmus.toolchain.stepper import Stepper
from reconcile.recordings.noise import high_pass_level
from records.formats.text.clock import UNTIMED
from records.measurement import Channel, Measurement
from specs.errors import InputError, RunError
from specs.units import UNITS, compatible

FACTORS = (180.0 / np.pi, 1000.0)
EXACT, ROUGH = 1.25, 2.0  # times which a ratio may be from a factor: of speeds, of a model's answer
OTHERS = 3.0  # least factor by which numbers of a speed are larger in the other units that are looked for
CLOSE = 1.1  # times which a ratio may be from such a factor
EVERY_S = 0.2  # changes over this are compared
RANGE = 1.5  # times the stated range that a value may be
LONGEST_S = 20.0  # of simulation for a comparison
TOGETHER, CHANCE = 0.5, 4.0  # least correlation of changes, and how many times what chance makes of so many
MOVES = 4.0  # noise levels by which an input moves


def check(measured: Measurement, channels: Mapping[str, Channel], folder, where: str) -> None:
    """Raise InputError for a column without a unit, or a time, whose size is that of another unit."""
    model = folder.model
    if isinstance(model, Model):
        _check_time(measured, channels, model.step, where)
    variables = {v.name: v for v in (*model.inputs, *model.outputs)}
    bare = [n for n in channels if _unstated(measured, n) and variables[n].unit not in ("", "1")]
    if bare and isinstance(model, Model):
        _refuse(where, bare, variables, _against_speed(channels, model))
    for n in bare:
        bounds = [abs(b) for b in (variables[n].min, variables[n].max) if b is not None]
        size = float(np.max(np.abs(channels[n].values)))
        limit = RANGE * max(bounds, default=np.inf)
        if size > limit and any(size / f <= limit for f in FACTORS):
            factor = next(f for f in FACTORS if size / f <= limit)
            said = f"it reaches {size:.4g} where the model has {max(bounds):.4g} {variables[n].unit} at most"
            raise InputError(_sentence(where, n, said, variables[n].unit, factor))
    if bare and isinstance(model, Model):
        _refuse(where, bare, variables, _against_model(channels, model))


def _check_time(measured: Measurement, channels: Mapping[str, Channel], step: float, where: str) -> None:
    """A time without a unit in which a sample takes a thousand of the model's steps (s), or a million."""
    every = min(c.period_s for c in channels.values())
    for factor, unit in ((1e3, "ms"), (1e6, "us")):
        if UNTIMED in measured.repairs and factor / CLOSE < every / step < factor * CLOSE:
            raise InputError(
                f"{where}: its time states no unit; in seconds a sample comes every {every:.4g} s, "
                f"{factor:g} steps of the model ({step:g} s). In [names] of --map write 'THEIRS' = "
                f"'time [{unit}]', THEIRS its column, or 'time [s]' if that is right"
            )


def _refuse(
    where: str, bare: Sequence[str], variables: Mapping[str, Any], found: Iterable[tuple[str, str, float]]
) -> None:
    """Raise InputError for a column without a unit that is off; first one whose unit can be said."""
    off = [(n, said, factor) for n, said, factor in found if n in bare]
    if off:
        n, said, factor = next((x for x in off if _likely(variables[x[0]].unit, x[2])), off[0])
        raise InputError(_sentence(where, n, said, variables[n].unit, factor))


def _unstated(measured: Measurement, name: str) -> bool:
    """Whether the file gives no unit (a signal of the project is then taken in its own, which is noted)."""
    noted = any(r.startswith(f"{name}: the file states no unit") for r in measured.repairs)
    return noted or not measured[name].unit


def _sentence(where: str, name: str, said: str, unit: str, factor: float) -> str:
    likely = _likely(unit, factor)
    hint = f" Is it in {likely}?" if likely else ""
    return (
        f"{where}: column {name} states no unit, and {said}.{hint}\n"
        f"Say which with --map: '{name}' = '{name} [{likely or unit}]' (as it is: [{unit}])"
    )


def _likely(unit: str, factor: float) -> str | None:
    """The unit of the same quantity whose numbers are `factor` times those in `unit`."""
    if unit not in UNITS:
        return None
    fitting = [u for u in UNITS if u != unit and compatible(u, unit)]
    near = [u for u in fitting if abs(UNITS[unit].factor / UNITS[u].factor / factor - 1.0) < 0.05]
    return near[0] if near else None


def _factor(ratio: float, slack: float) -> float | None:
    """Which of the factors a ratio is, or 1 over which; None if none."""
    return _near(ratio, slack, [v for f in FACTORS for v in (f, 1.0 / f)])


def _near(ratio: float, slack: float, factors: Iterable[float]) -> float | None:
    return next((f for f in factors if 1.0 / slack < ratio / f < slack), None)


def _others(unit: str) -> list[float]:
    """How many times as large the numbers of a speed are in its other units (rad/s: 57.3 and 9.55)."""
    if unit not in UNITS:
        return []
    found = [UNITS[unit].factor / UNITS[u].factor for u in UNITS if compatible(u, unit)]
    return [f for f in found if f > OTHERS]


def _against_speed(channels: Mapping[str, Channel], model: Model) -> Iterator[tuple[str, str, float]]:
    """Positions whose changes are not what the speed recorded beside them adds up to."""
    units = {o.name: o.unit for o in model.outputs}
    for q, v in _rates(model):
        if q in channels and v in channels:
            travelled = channels[v].values.astype(float)
            travelled = np.concatenate([[0.0], np.cumsum(travelled[:-1] * np.diff(channels[v].time))])
            ratio = _ratio(channels[q], Channel(v, "", channels[v].time, travelled))
            factor = _factor(ratio, EXACT) or _near(ratio, CLOSE, [1.0 / f for f in _others(units[v])])
            if factor:
                yield q, f"its slope is {factor:.4g} times {v}", factor
                yield v, f"it is {1 / factor:.4g} times the slope of {q}", 1.0 / factor


def _rates(model: Model) -> list[tuple[str, str]]:
    """Pairs of outputs (position, speed): states shown as they are, one the rate of the other."""
    if model.kind != "continuous" or model.symbolic != "SX":
        return []
    x, h, f = model.symbols[0], model.h(*model.symbols), model.f(*model.symbols)
    shown = {
        i: v.name for k, v in enumerate(model.outputs) for i in range(x.numel()) if ca.is_equal(h[k], x[i])
    }
    return [(shown[i], shown[j]) for i in shown for j in shown if i != j and ca.is_equal(f[i], x[j])]


def _against_model(channels: Mapping[str, Channel], model: Model) -> Iterator[tuple[str, str, float]]:
    """Outputs, or the input before them, whose changes are off from what the model answers."""
    moving = [v.name for v in model.inputs if v.name in channels and _moves(channels[v.name])]
    answer = _answer(channels, model) if moving else {}
    ratios = {n: _ratio(channels[n], answer[n]) for n in answer if n in channels}
    factors = {n: _factor(r, ROUGH) for n, r in ratios.items() if np.isfinite(r)}
    common = set(factors.values())
    if len(common) == 1 and len(moving) == 1 and (factor := common.pop()):
        said = f"the outputs are {factor:.4g} times what the model answers to it"
        yield moving[0], said, 1.0 / factor
    for n, factor in factors.items():
        if factor:
            yield n, f"its changes are {factor:.4g} times what the model answers to the inputs", factor


def _moves(channel: Channel) -> bool:
    values = channel.values.astype(float)
    return float(np.std(values)) > MOVES * high_pass_level(values)


def _ratio(one: Channel, other: Channel) -> float:
    """How many times the changes of another signal those of one are; NaN where they do not go together."""
    start, end = max(one.time[0], other.time[0]), min(one.time[-1], other.time[-1])
    at = np.arange(start, min(end, start + LONGEST_S), EVERY_S)
    changes = [np.diff(np.interp(at, c.time, c.values.astype(float))) for c in (one, other)]
    if len(at) < 2:
        return np.nan
    a, b = (c - np.median(c) for c in changes)
    sizes = float(np.sqrt(np.mean(a**2))), float(np.sqrt(np.mean(b**2)))
    least = max(TOGETHER, CHANCE / np.sqrt(len(a)))
    together = abs(float(np.mean(a * b))) > least * sizes[0] * sizes[1]
    return sizes[0] / sizes[1] if together else np.nan


def _answer(channels: Mapping[str, Channel], model: Model) -> dict[str, Channel]:
    """Outputs every EVERY_S of the model from its own start under the recorded inputs; {} if it runs away."""
    if model.symbolic != "SX" or (model.kind == "discrete" and (model.modes or model.sensors)):
        return {}
    stepper = Stepper(model) if model.kind == "continuous" else DiscreteStepper(model)
    driven = [channels[v.name] for v in model.inputs if v.name in channels]
    start = max(c.time[0] for c in channels.values())
    end = min(start + LONGEST_S, min(c.time[-1] for c in channels.values()))
    per = max(1, round(EVERY_S / model.step))
    period = min((c.period_s for c in driven), default=0.02)
    ticks = max(1, round(period / model.step))
    edges = range(0, int((end - start) / model.step), per)
    rows = []
    try:
        for first, last in pairwise(edges):
            rows.append(list(stepper.outputs().values()))
            for k in range(first, last, ticks):
                now = start + k * model.step
                stepper.set(**{c.name: float(c.values[c.held(np.array([now]), 1e-6)[0][0]]) for c in driven})
                stepper.advance(min(ticks, last - k))
    except RunError:
        return {}
    columns = np.array(rows).T
    good = len(rows) > 3 and np.isfinite(columns).all() and np.abs(columns).max() < 1e30
    time = start + model.step * np.array(edges[: len(rows)], float)
    return (
        {v.name: Channel(v.name, "", time, columns[i]) for i, v in enumerate(model.outputs)} if good else {}
    )
