"""The next experiment in one or two sentences."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from reconcile.equations.model import Attached, Folder
from reconcile.experiment.excitation import commands, of_dict
from reconcile.experiment.limits import Limits
from reconcile.experiment.plan import units_of

KINDS = {
    "steps": "random steps of up to {a}, each held for about {p}",
    "ladder": "levels up to ±{a} to either side by turns, a pair of them in {p}",
    "binary": "reversals of ±{a} at random, each held for half of {s} to half of {p}",
    "reversals": "full reversals of ±{a}, one in {p} at first, one in {s} at last",
    "triangle": "a triangle of ±{a} and {p}",
    "sine": "a sine of ±{a} and {p}",
    "multisine": "a multisine of ±{a}, periods from {p} to {s}",
    "chirp": "a sweep of ±{a}, periods from twice {p} to {s}",
    "growing": "a sine of {p} that grows to ±{a}",
    "creep": "rest and slow slopes to ±{a}, a cycle in {p}",
    "strokes": "strokes of ±{a} with rests between, a cycle in {p}",
}
WHOLE = 0.75  # of an excitation's amplitude, to both sides: less is part of it
WHERE = ("input", "hydraulic", "force", "inertia", "coupling", "output")
SENSORS = {
    "input": "of what really arrives behind {port}",
    "hydraulic": "of the pressures at {port}",
    "force": "of the force or torque at {port}",
    "inertia": "of the force or torque at {port}",
    "coupling": "of the force or torque at {port}",
    "output": "of {port} a second time, of another kind",
}


def drive(folder: Folder, figures: dict[str, Any]) -> str:
    """What to drive."""
    e = of_dict(figures["excitation"])
    units = units_of(folder)
    low, high = figures["ranges"][e.inputs[0]]
    half, unit = 0.5 * (high - low), units[e.inputs[0]]
    shown = "" if unit == "1" else f" {unit}"
    text = KINDS[e.kind].format(
        a=f"{e.amplitude * half:.3g}{shown}",
        p=_seconds(e.period_s),
        s=_seconds(e.fastest_s),
    )
    centre = e.centre(low, high)
    around = f" about {centre:.3g}{shown}" if abs(centre) > 1e-9 * half else ""
    reached = commands(e, figures["ranges"], figures["tick_s"])[e.inputs[0]]
    low, high = float(np.min(reached)), float(np.max(reached))
    # of a shape longer than the experiment, or cut off by the input's range, only a part is driven
    cut = min(high - centre, centre - low) < WHOLE * e.amplitude * half
    around += f" (of that {low:.3g} to {high:.3g}{shown})" if cut else ""
    begin = "".join(f", {n} starting from {v:.3g}" for n, v in e.start)
    return f"drive {' and '.join(e.inputs)} with {text}{around} for {_seconds(e.duration_s)}{begin}"


def _seconds(time: float) -> str:
    """A time to three digits, without powers of ten where people write none."""
    return f"{float(f'{time:.3g}'):g} s"


def between(folder: Folder, figures: dict[str, Any], limits: Limits) -> str:
    """For candidates that cannot be told apart."""
    needed = figures["needed_margin"]
    told = [p for p in figures["pairs"] if p["predicted_margin"] >= needed]
    alike = [p for p in figures["pairs"] if p["predicted_margin"] < needed]
    parts = []
    if told:
        what = "; ".join(_pair(p) for p in told)
        least = min(p["predicted_margin"] for p in told)
        parts.append(
            f"To tell {what}, {drive(folder, figures)}: a margin of "
            f"{least:.3g} is predicted, {needed:.3g} is needed.{_range(figures, limits)}"
        )
    if alike:
        what = "; ".join(_pair(p) for p in alike)
        would = f"; a sensor {figures['sensors'][0]} would" if figures["sensors"] else ""
        parts.append(f"No excitation within the limits tells {what}{would}.")
    return " ".join(parts)


def parameters(folder: Folder, figures: dict[str, Any], limits: Limits) -> str:
    """For parameters that the recordings do not show."""
    needed = figures["needed_margin"]
    told = [p["name"] for p in figures["parameters"] if p["predicted_margin"] >= needed]
    hidden = [p["name"] for p in figures["parameters"] if p["predicted_margin"] < needed]
    parts = []
    if told:
        parts.append(f"To see {', '.join(told)}, {drive(folder, figures)}.{_range(figures, limits)}")
    if hidden:
        parts.append(f"No excitation within the limits shows {', '.join(hidden)} in these outputs.")
    return " ".join(parts)


def no_room(limits: Limits) -> str:
    """Where every excitation leaves the limits."""
    listed = ", ".join(f"{n} {v.low:.3g} … {v.high:.3g} ({v.source})" for n, v in limits.outputs.items())
    return f"No excitation stays within the limits: {listed}; state wider ones as min and max in model.py."


def sensors(apart: Sequence[tuple[Sequence[Attached], Sequence[Attached]]]) -> list[str]:
    """Where a further sensor would tell sets apart: at the first port at which they differ."""
    found = []
    for one, other in apart:
        differing = [a for a in (*one, *other) if (a in one) != (a in other)]
        differing.sort(key=lambda a: WHERE.index(a.effect.place))
        if differing:
            first = differing[0]
            found.append(SENSORS[first.effect.place].format(port=first.port))
    return list(dict.fromkeys(found))


def _pair(p: dict[str, Any]) -> str:
    """A pair of differing effects: a from b, a + b from c."""
    one, other = (" + ".join(p[k]) or "its absence" for k in ("one", "other"))
    return f"{one} from {other}"


def _range(figures: dict[str, Any], limits: Limits) -> str:
    """What was taken for a limit, where nothing is stated."""
    loose = [n for n, v in limits.outputs.items() if v.source == "none"]
    if not loose:
        return ""
    spans = figures["predicted_range"]
    moved = ", ".join(f"{n} from {spans[n][0]:.3g} to {spans[n][1]:.3g}" for n in loose)
    return f" No limits of the outputs are stated; with the model as it came and as fitted, expect {moved}."
