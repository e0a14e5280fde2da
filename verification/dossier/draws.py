"""How the re-drawn machines spread, and how that compares with what the traces leave open."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from fmus.models.slew import evidence, features, traces
from fmus.models.slew.features import Features
from records.report.picture import Panel
from specs import draws, parameters as parameter_specs
from specs.draws import Spread
from specs.parameters import Parameter
from specs.progress import Report
from verification.dossier import draw_tables, svg
from verification.dossier.machine import Bench, pose, read_step
from verification.dossier.physics import expected_swing
from verification.dossier.section import Section
from verification.dossier.steps import INERTIA

OPEN = tuple(name for name in draws.sets() if name != draws.SEALED)  # the sealed set is never drawn here
KNOWN = (  # parameter, known range (SI), whence: what the spreads must cover
    ("slew_delay", 0.10, 0.15, "usual for mobile hydraulics"),
    ("slew_dead_band", 0.15, 0.18, "read off the networks"),
    ("slew_friction_viscous", 35e3, 53e3, "regressions on the traces"),
    ("slew_friction_dry", 6e3, 11e3, "regressions on the traces"),
    ("slew_boost_pressure", 15e5, 20e5, "low side of the traces at rest"),
    ("slew_bulk_modulus", 0.7e9, 1.2e9, "literature"),
    ("slew_chamber_volume", 1e-3, 2e-3, "usual for such machines"),
    ("grab_damping_pitch", 0.05, 0.2, "estimate"),
    ("grab_damping_roll", 0.05, 0.2, "estimate"),
)
COMMANDS = (0.35, 0.7, 1.0)  # joystick of the steps of the drawn machines
LENGTH = (1.5, 2.5)  # m, of the pitch pendulum: period 2.5-3.2 s
OFF_CENTRE = 0.02  # of the nominal value, by which the middle of a spread must be off to be looked at
QUANTITIES = ("speed_deg_s", "coast_deg", "t63_s")


def section(report: Report, bench: Bench, machines: int | None = None) -> Section:
    """Tables of the spreads, and steps of the drawn machines (the first `machines` of each set)."""
    report("steps of the drawn machines")
    known = parameter_specs.load(*draws.FILES)
    spreads = draws.spreads()
    drawn = {name: _steps(name, bench, report, machines) for name in OPEN}
    nominal = _one({}, bench)
    wanted = _wanted()
    figures = {
        "sets": draws.sets(),
        "fingerprint": {name: fingerprint(name) for name in OPEN},
        "spreads": [_spread_figures(s, known) for s in _distinct(spreads)],
        "nominal_outside": outside(spreads, known),
        "against_errors": against_errors(spreads, known),
        "coverage": coverage(spreads, known),
        "steps": _summaries(drawn, nominal, wanted),
    }
    figures["bias"] = bias(figures["steps"])
    report("what moves the centre of the draws")
    figures["centre"] = centre(off_centre(spreads, known)[:machines], nominal, bench)
    pictures = {"draws.svg": _picture(drawn, nominal, wanted)}
    title = "How the machines are re-drawn"
    return Section("draws", title, draw_tables.text(figures, spreads, known), figures, pictures)


def fingerprint(name: str) -> str:
    """Short hash of all parameter values of an open set."""
    values = [draws.draw(name, i) for i in range(draws.sets()[name])]
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]


def outside(spreads: Mapping[str, Spread], known: Mapping[str, Parameter]) -> list[str]:
    """Parameters whose nominal value their own spread does not contain."""
    found = []
    for name, spread in spreads.items():
        low, high = spread.limits(known[name].value)
        if not low <= known[name].value <= high:
            found.append(name)
    return found


def against_errors(
    spreads: Mapping[str, Spread], known: Mapping[str, Parameter]
) -> dict[str, dict[str, float]]:
    """Half range drawn and standard error of every fitted parameter that is drawn, SI."""
    found = {}
    for name, row in evidence.parameters(evidence.shipped()).items():
        if name in spreads:
            low, high = spreads[name].limits(known[name].value)
            half = (high - low) / 2
            found[name] = {"half_range": half, "error": row["deviation"], "ratio": half / row["deviation"]}
    return found


def bias(steps: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Mean speed of the drawn machines over the nominal machine's, less one, mean over the commands."""
    rows = [r for r in steps if r["quantity"] == "speed_deg_s"]
    return {name: float(np.mean([r[name]["mean"] / r["nominal"] - 1 for r in rows])) for name in OPEN}


def off_centre(spreads: Mapping[str, Spread], known: Mapping[str, Parameter]) -> list[dict[str, float]]:
    """The middle of each spread that is not its nominal value; those of sensors left out."""
    found = []
    for spread in _distinct(spreads):
        middles = {n: sum(spread.limits(known[n].value)) / 2 for n in spread.parameters}
        off = any(abs(v - known[n].value) > OFF_CENTRE * abs(known[n].value) for n, v in middles.items())
        if off and not spread.parameters[0].startswith(draw_tables.SENSORS):
            found.append(middles)
    return found


def centre(
    middles: Sequence[Mapping[str, float]], nominal: list[Features], bench: Bench
) -> list[dict[str, Any]]:
    """How the speeds move (share, mean over the commands) with one spread at its middle, largest first."""
    rows = []
    for values in middles:
        pairs = zip(_one(values, bench), nominal, strict=True)
        share = float(np.mean([drawn.speed_deg_s / usual.speed_deg_s - 1 for drawn, usual in pairs]))
        rows.append({"middles": dict(values), "speed_share": share})
    return sorted(rows, key=lambda row: -abs(row["speed_share"]))


def coverage(spreads: Mapping[str, Spread], known: Mapping[str, Parameter]) -> list[dict[str, Any]]:
    """Known ranges, the drawn ones, and whether these contain those."""
    rows = []
    for name, low, high, source in KNOWN:
        nominal = known[name].value
        limits = spreads[name].limits(nominal) if name in spreads else (nominal, nominal)
        rows.append(_covered(name, (low, high), limits, known[name].unit, source))
    rows.append(
        _covered("pitch pendulum's length", LENGTH, _lengths(spreads, known), "m", "period 2.5–3.2 s")
    )
    return rows


def _covered(name: str, wanted: svg.Span, drawn: svg.Span, unit: str, source: str) -> dict[str, Any]:
    room = 1e-9 * abs(wanted[1])
    inside = drawn[0] <= wanted[0] + room and drawn[1] >= wanted[1] - room
    return {
        "name": name,
        "known": list(wanted),
        "drawn": list(drawn),
        "unit": unit,
        "source": source,
        "covered": inside,
    }


def _lengths(spreads: Mapping[str, Spread], known: Mapping[str, Parameter]) -> svg.Span:
    names = [n for n in ("grab_com", "grab_gyration") if n in spreads]
    ends = [{n: spreads[n].limits(known[n].value)[i] for n in names} for i in (0, 1)]
    low, high = (expected_swing("pitch", values)["length_m"] for values in ends)
    return low, high


def _steps(name: str, bench: Bench, report: Report, machines: int | None) -> list[list[Features]]:
    """True features of the drawn machines, one row a machine, one entry a command."""
    count = draws.sets()[name] if machines is None else min(machines, draws.sets()[name])
    found = []
    for i in range(count):
        report(f"steps of the {name} machines", i, count)
        found.append(_one(draws.draw(name, i), bench))
    return found


def _one(values: Mapping[str, float], bench: Bench) -> list[Features]:
    at = pose(INERTIA).parameters
    return [read_step(bench.step(command, {**values, **at}), "true_") for command in COMMANDS]


def _wanted() -> list[tuple[Features, Features]]:
    """Features of the traces at 400 t m2, both directions."""
    known = traces.load()
    names = [f"step_{round(100 * c):03d}_I{round(INERTIA / 1e3)}" for c in COMMANDS]
    return [(features.of_trace(known[n]), features.of_trace(known[n + traces.MIRROR])) for n in names]


def _summaries(
    drawn: Mapping[str, list[list[Features]]],
    nominal: list[Features],
    wanted: list[tuple[Features, Features]],
) -> list[dict[str, Any]]:
    rows = []
    for i, command in enumerate(COMMANDS):
        for quantity in QUANTITIES:
            pair = sorted(getattr(f, quantity) for f in wanted[i])
            row: dict[str, Any] = {"command": command, "quantity": quantity, "traces": pair}
            row["nominal"] = getattr(nominal[i], quantity)
            for name, machines in drawn.items():
                values = np.array([getattr(m[i], quantity) for m in machines])
                row[name] = {
                    "low": float(values.min()),
                    "mean": float(values.mean()),
                    "high": float(values.max()),
                }
            rows.append(row)
    return rows


def _distinct(spreads: Mapping[str, Spread]) -> list[Spread]:
    return list({id(s): s for s in spreads.values()}.values())


def _spread_figures(spread: Spread, known: Mapping[str, Parameter]) -> dict[str, Any]:
    limits = {n: list(spread.limits(known[n].value)) for n in spread.parameters}
    return {**asdict(spread), "parameters": list(spread.parameters), "limits": limits}


def _picture(
    drawn: Mapping[str, list[list[Features]]],
    nominal: list[Features],
    wanted: list[tuple[Features, Features]],
) -> str:
    colors = dict(zip(drawn, (svg.TEAL, svg.ORANGE), strict=True))
    entries = [("#8a949e", "traces, both directions"), (svg.BLUE, "nominal machine")]
    parts = [svg.legend(60, 24, [*entries, *((c, f"{n} machines") for n, c in colors.items())])]
    titles = (
        ("speed_deg_s", "Speed before release", "slew speed [°/s]"),
        ("coast_deg", "Angle coasted", "angle [°]"),
    )
    for k, (quantity, title, unit) in enumerate(titles):
        every = [getattr(f, quantity) for m in drawn.values() for row in m for f in row]
        every += [getattr(f, quantity) for pair in wanted for f in pair]
        panel = Panel(60 + 470 * k, 60, 400, 250, (0.0, float(len(COMMANDS))), (0.0, 1.08 * max(every)))
        names = {i + 0.5: f"{c:g}" for i, c in enumerate(COMMANDS)}
        parts.append(svg.axes(panel, title, "joystick", unit, names))
        for i in range(len(COMMANDS)):
            low, high = sorted(getattr(f, quantity) for f in wanted[i])
            middle, least = (low + high) / 2, 0.004 * panel.y[1]
            bar = (min(low, middle - least), max(high, middle + least))
            parts.append(svg.box(panel, (i + 0.12, i + 0.88), bar, "#8a949e", 0.55))
            for j, (name, machines) in enumerate(drawn.items()):
                values = [getattr(m[i], quantity) for m in machines]
                parts.append(svg.dots(panel, [i + 0.33 + 0.34 * j] * len(values), values, colors[name], 2.4))
            parts.append(svg.dots(panel, [i + 0.5], [getattr(nominal[i], quantity)], svg.BLUE, 4.5))
    return svg.document(960, 365, "Spread of the drawn machines", parts)
