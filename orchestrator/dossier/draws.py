"""How the re-drawn machines spread, why, and how that compares with what the traces leave open."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from fmus.slew import evidence, features, traces
from fmus.slew.features import Features
from orchestrator.dossier import svg
from orchestrator.dossier.machine import Bench, pose, read_step
from orchestrator.dossier.physics import expected_swing
from orchestrator.dossier.section import Report, Section, number, picture, significant, table
from orchestrator.dossier.steps import COMMANDS, INERTIA
from records.report.picture import Panel
from specs import draws, parameters as parameter_specs
from specs.draws import Spread
from specs.parameters import Parameter

OPEN = tuple(name for name in draws.sets() if name != draws.SEALED)  # the sealed set is never drawn here
SENSORS = ("encoder_", "pressure_", "imu_")
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
LENGTH = (1.5, 2.5)  # m, of the pitch pendulum: period 2.5-3.2 s
QUANTITIES = ("speed_deg_s", "coast_deg", "t63_s")


def section(report: Report, bench: Bench, machines: int | None = None) -> Section:
    """Tables of the spreads, and steps of the drawn machines (the first `machines` of each set, default all)."""
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
        "coverage": coverage(spreads, known),
        "steps": _summaries(drawn, nominal, wanted),
    }
    pictures = {"draws.svg": _picture(drawn, nominal, wanted)}
    title = "How the machines are re-drawn"
    return Section("draws", title, _text(figures, spreads, known), figures, pictures)


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


def coverage(spreads: Mapping[str, Spread], known: Mapping[str, Parameter]) -> list[dict[str, Any]]:
    """Known ranges, the drawn ones, and whether these contain those."""
    rows = []
    for name, low, high, source in KNOWN:
        limits = spreads[name].limits(known[name].value) if name in spreads else (known[name].value,) * 2
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


def _text(figures: Mapping[str, Any], spreads: Mapping[str, Spread], known: Mapping[str, Parameter]) -> str:
    sizes = ", ".join(f"{name} {size}" for name, size in figures["sets"].items())
    prints = ", ".join(f"{name} `{value}`" for name, value in figures["fingerprint"].items())
    distinct = _distinct(spreads)
    sensors = [s for s in distinct if s.parameters[0].startswith(SENSORS)]
    machine = [s for s in distinct if s not in sensors]
    fixed = [n for n in evidence.shipped().values if n not in spreads]
    return f"""
A controller that works on one machine only has learned that machine. The machine is therefore re-drawn from
`specs/draws.toml` in disjoint sets: {
        sizes
    }. Each number is the quantile of the parameter's distribution at the first 53
bits of the SHA-256 of "draw/*set*/*index*/*parameter or group*", so the sets share nothing and nothing depends on platform or order.
Fingerprints of the drawn values: {
        prints
    }. **The test set is sealed**: it is opened once for a released controller,
every opening is logged in `specs/test_openings.log`, and this page never draws from it.

*sourced*: the range is known from the traces, the paper or a data sheet; *assumed*: our estimate. For fitted
parameters, *error* is the standard error of chapter 2 as a share of the half range drawn.

{_spread_table(machine, known)}
{len(fixed)} fitted parameters are not drawn: {", ".join(f"`{n}`" for n in fixed) or "none"}.
{_outside_text(figures["nominal_outside"], spreads, known)}
Ranges that the spreads had to cover:

{
        table(
            ("quantity", "known", "drawn", "unit", "whence", ""),
            [_coverage_row(r) for r in figures["coverage"]],
            right=(1, 2),
        )
    }
**Sensors.** Every sensor has noise; no figure of this machine's sensors is public. Nominal values:

{_sensor_table(known)}
Drawn:

{_spread_table(sensors, known)}
**What comes of it.** Steps of every drawn machine of the open sets at the pose of chapter 5, true states, positive
direction, against both directions of the traces:

{_summary_table(figures["steps"])}
{
        picture(
            "draws.svg",
            "Steps at 400 t m²: the two directions of the traces (grey bars), the nominal machine (dark "
            "blue) and the drawn machines of the open sets.",
        )
    }
Where the drawn range contains both directions of the traces, the difference between left and right, which the symmetric machine
cannot show, is covered by drawing it.
"""


def _outside_text(names: Sequence[str], spreads: Mapping[str, Spread], known: Mapping[str, Parameter]) -> str:
    if not names:
        return "Every nominal value lies inside its own spread.\n"
    parts = []
    for n in names:
        low, high = spreads[n].limits(known[n].value)
        parts.append(
            f"`{n}` {significant(known[n].value)} (drawn {significant(low)} … {significant(high)} {known[n].unit})"
        )
    return f"**Nominal value outside its own spread:** {'; '.join(parts)}.\n"


def _spread_table(chosen: Sequence[Spread], known: Mapping[str, Parameter]) -> str:
    errors = evidence.parameters(evidence.shipped())
    rows = []
    for s in chosen:
        first = s.parameters[0]
        low, high = s.range
        kind = f"normal, sd {s.sd:g}" if s.sd is not None else f"{low:g} … {high:g}"
        relation = {
            "absolute": known[first].unit,
            "factor": "× nominal",
            "offset": f"{known[first].unit} added",
        }
        half = np.diff(s.limits(known[first].value))[0] / 2
        error = f"{100 * errors[first]['deviation'] / half:.0f} %" if first in errors else "–"
        rows.append([_names(s), kind, relation[s.relation], error, s.reason, s.status])
    return table(("parameters", "drawn", "unit", "error", "reason", "status"), rows, right=(3,))


def _names(s: Spread) -> str:
    shown = [f"`{n}`" for n in s.parameters]
    together = " (together)" if s.group else ""
    return (", ".join(shown) if len(shown) <= 4 else f"{shown[0]} … {shown[-1]} ({len(shown)})") + together


def _coverage_row(row: Mapping[str, Any]) -> list[str]:
    ranges = [" … ".join(significant(v, 3) for v in row[k]) for k in ("known", "drawn")]
    return [
        row["name"],
        *ranges,
        row["unit"],
        row["source"],
        "covered" if row["covered"] else "**not covered**",
    ]


def _sensor_table(known: Mapping[str, Parameter]) -> str:
    kinds = ("_noise", "_quantum", "_delay")
    rows = [
        [f"`{p.name}`", significant(p.value), p.unit, p.status, p.source]
        for p in known.values()
        if p.name.startswith(SENSORS) and p.name.endswith(kinds)
    ]
    return table(("sensor", "value", "unit", "status", "source"), rows, right=(1,))


def _summary_table(rows: Sequence[Mapping[str, Any]]) -> str:
    names = {"speed_deg_s": "speed [°/s]", "coast_deg": "coast [°]", "t63_s": "t63 [s]"}
    lines = []
    for r in rows:
        sets = [f"{number(r[n]['low'], 1)} … {number(r[n]['high'], 1)}" for n in OPEN]
        first = r[OPEN[0]]
        inside = first["low"] <= r["traces"][0] and r["traces"][1] <= first["high"]
        both = " … ".join(number(v, 1) for v in r["traces"])
        what = f"{r['command']:g}", names[r["quantity"]]
        lines.append([*what, both, number(r["nominal"], 1), *sets, "yes" if inside else "no"])
    columns = ("joystick", "feature", "traces, both directions", "nominal", *OPEN, f"in {OPEN[0]}'s range")
    return table(columns, lines, right=range(2, 6))


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
