"""Start values and limits of a template's parameters, by least squares where a recording tells them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from reconcile.start import estimate, templates
from reconcile.start.columns import Column
from reconcile.start.templates import ESTIMATED, GUESS, SCALED, Motion, Quantity
from records.formats.units import converted
from specs.errors import InputError

SURE = 3.0  # deviations from zero that a coefficient must have to be used


@dataclass(frozen=True)
class Drive:
    """What drives an axis: its column, its unit in the model, and the command at which it does nothing.

    `middle` is None where that is zero, or where the axis is (`follows`).
    """

    column: Column
    unit: str
    middle: float | None
    follows: bool = False


def si(column: Column, unit: str) -> np.ndarray:
    """A column in a unit of the model; as it is where it has none, or that of another quantity."""
    if not column.unit:
        return column.values
    try:
        return converted(column.values, column.unit, unit, column.name)
    except InputError:
        return column.values


def _positive(name: str, unit: str, text: str, value: float, sure: bool, guess: float) -> Quantity:
    found = value if sure and np.isfinite(value) and value > 0 else guess
    source = ESTIMATED if found == value else GUESS
    return Quantity(name, unit, text, found, 1e-3 * found, 1e3 * found, source)


def _damped(name: str, unit: str, text: str, value: float, sure: bool, guess: float) -> Quantity:
    q = _positive(name, unit, text, value, sure, guess)
    return Quantity(name, unit, text, q.start, 0.0, 1e3 * q.start, q.source)


def axis(template: str, kind: Motion, found: Mapping[str, Column], drive: Drive | None) -> list[Quantity]:
    """Of one axis, of which position, velocity or both are `found`."""
    base = found.get("velocity") or found["position"]
    t, q = base.time, np.zeros_like(base.time)
    if "position" in found:
        q = np.interp(t, found["position"].time, si(found["position"], kind.position))
    v = si(base, kind.velocity) if "velocity" in found else estimate.speed(t, q)
    if "position" not in found:
        q = estimate.swung(t, v)
    columns = {"damping": -v}
    if drive is not None:
        still = q if drive.follows else drive.middle or 0.0
        columns["gain"] = np.interp(t, drive.column.time, si(drive.column, drive.unit)) - still
    if drive is None or drive.middle is not None:
        columns["constant"] = np.ones_like(t)
    if template == "pendulum":
        columns["gravity"] = -np.sin(q)
    c, deviation = estimate.slopes(t, v, list(columns.values()))
    told = {n: (float(x), bool(abs(x) > SURE * d)) for n, x, d in zip(columns, c, deviation, strict=True)}
    if drive is not None and drive.unit == kind.force:
        return _forced(kind, told)
    return _commanded(kind, told, drive)


Told = Mapping[str, tuple[float, bool]]  # coefficients, and whether the recording tells them


def _forced(kind: Motion, told: Told) -> list[Quantity]:
    """Of an axis that a force in its own unit drives: all is in proportion to the inertia."""
    (gain, sure), (damping, damped) = told["gain"], told["damping"]
    inertia = _positive(kind.named, kind.inertia, "Of all that moves", 1 / gain if gain else 0.0, sure, 1.0)
    own = inertia.start
    rows = [inertia, _damped("friction", kind.friction, "Viscous friction", damping * own, damped, 0.1 * own)]
    if "gravity" in told:
        weight, known = told["gravity"]
        text = "Weight times its distance from the axis, lying"
        rows.append(_positive("gravity_torque", "N.m", text, weight * own, known, 9.81 * own))
    if inertia.source == GUESS:
        rows[1:] = [replace(q, source=SCALED) if q.source == ESTIMATED else q for q in rows[1:]]
    return rows


def _commanded(kind: Motion, told: Told, drive: Drive | None) -> list[Quantity]:
    """Of an axis that a command of any unit drives, or none: all is an acceleration."""
    rate, rows = kind.velocity + "2", []
    if drive is not None:
        unit = templates.per(rate, drive.unit)
        rows.append(_about("gain", unit, "Acceleration for one unit of command", *told["gain"], 1.0))
    if drive is not None and drive.middle is not None:
        rows.append(_neutral(drive, drive.middle, told))
    if "gravity" in told:
        rows.append(Quantity("gravity", "m/s2", "Acceleration of free fall", 9.81, None, None, "known", 1e-3))
        weight, known = told["gravity"]
        text = "From the axis to the weight, of a point mass"
        rows.append(_positive("length", "m", text, 9.81 / weight if weight else 0.0, known, 1.0))
    elif drive is None:
        text = "Of a constant force, such as a weight"
        rows.append(_about("acceleration", rate, text, *told["constant"], 0.0))
    damping, damped = told["damping"]
    return [*rows, _damped("damping", "1/s", "Viscous friction by inertia", damping, damped, 0.1)]


def _about(name: str, unit: str, text: str, value: float, sure: bool, guess: float) -> Quantity:
    """A quantity of either sign."""
    start = value if sure else guess
    wide = 1e3 * (abs(start) or 1.0)
    return Quantity(name, unit, text, start, -wide, wide, ESTIMATED if sure else GUESS)


def _neutral(drive: Drive, middle: float, told: Told) -> Quantity:
    (gain, sure), (constant, known) = told["gain"], told["constant"]
    wide = float(np.ptp(si(drive.column, drive.unit))) or 1.0
    at = float(np.clip(middle - constant / gain, middle - wide, middle + wide)) if sure and known else middle
    source = ESTIMATED if sure and known else GUESS
    text = "Command at which nothing is driven"
    return Quantity("neutral", drive.unit, text, at, middle - wide, middle + wide, source)


def chain(n: int, kind: Motion, used: dict[str, Column]) -> list[Quantity]:
    """Of `n` inertias in a row; `used`: columns by the model's name."""
    rows = []
    for i in range(1, n + 1):
        value = [0.0, 0.0]
        sure = [False, False]
        force, v = used.get(f"{kind.noun}{i}"), used.get(f"velocity{i}")
        if force is not None and v is not None:
            speed = si(v, kind.velocity)
            c, deviation = estimate.slopes(
                v.time, speed, [-speed, np.interp(v.time, force.time, si(force, kind.force))]
            )
            value = [1 / c[1] if c[1] else 0.0, c[0] / c[1] if c[1] else 0.0]
            sure = [bool(abs(c[k]) > SURE * deviation[k]) for k in (1, 0)]
        rows.append(_positive(f"{kind.named}{i}", kind.inertia, f"Of joint {i}", value[0], sure[0], 1.0))
        rows.append(_damped(f"friction{i}", kind.friction, f"Viscous, of joint {i}", value[1], sure[1], 0.1))
        if i < n:
            rows.append(_damped(f"stiffness{i}", kind.stiffness, f"Between {i} and {i + 1}", 0, False, 1.0))
            rows.append(_damped(f"damping{i}", kind.friction, f"Between {i} and {i + 1}", 0, False, 0.1))
    return rows


def first_order(
    out: tuple[str, str], drive: tuple[str, str] | None, ours: dict[str, Column], length: float
) -> list[Quantity]:
    """Of a plant of first order; signals are (name, unit), `ours` their columns, `length` (s) the time."""
    y = ours[out[0]]
    values, moved_by = si(y, out[1]), []
    if drive:
        u = ours[drive[0]]
        moved_by = [np.interp(y.time, u.time, si(u, drive[1]))]
    lag, (offset, *gains) = estimate.response(y.time, values, moved_by)
    told = bool(np.isfinite(lag))
    rows = [_positive("time_constant", "s", "Time to 63 % of a step", lag, told, length / 10)]
    if drive:
        unit = templates.per(out[1], drive[1])
        rows.append(_about("gain", unit, "Output for one of input", float(gains[0]), told, 1.0))
    text = "Output without input"
    return [*rows, _about("offset", out[1], text, float(offset), told, float(np.mean(values)))]


def free(
    outs: Sequence[tuple[str, str]], ins: Sequence[tuple[str, str]], ours: dict[str, Column]
) -> list[Quantity]:
    """Of outputs that are linear in themselves and in the inputs."""
    rows = []
    for name, unit in outs:
        y = ours[name]
        values = si(y, unit)
        columns = [np.ones_like(values), -values]
        columns += [np.interp(y.time, ours[n].time, si(ours[n], u)) for n, u in ins]
        c, _ = estimate.slopes(y.time, values, columns)
        rate = unit + "/s" if "/" not in unit else f"{unit.partition('/')[0]}/({unit.partition('/')[2]}.s)"
        rate = "1/s" if unit == "1" else "m/s2" if unit == "m/s" else "rad/s2" if unit == "rad/s" else rate
        units = [rate, "1/s", *(templates.per(rate, u) for _, u in ins)]
        labels = [f"pull_{name}", f"decay_{name}", *(f"gain_{name}_{n}" for n, _ in ins)]
        for label, u, value in zip(labels, units, c, strict=True):
            wide = 1e3 * max(abs(float(value)), 1e-3)
            rows.append(Quantity(label, u, "Linear coefficient", float(value), -wide, wide, ESTIMATED))
    return rows
