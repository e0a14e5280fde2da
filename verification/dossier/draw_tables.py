"""The chapter on the re-drawn machines in words and tables."""

from collections.abc import Mapping, Sequence
from typing import Any

from fmus.models.slew import fit
from specs.draws import Spread
from specs.parameters import Parameter
from verification.dossier.markdown import chapter, code, number, picture, significant, table

SENSORS = ("encoder_", "pressure_", "imu_")
NAMES = {"speed_deg_s": "speed [°/s]", "coast_deg": "coast [°]", "t63_s": "t63 [s]"}
ENOUGH = 2.0  # half range drawn over standard error
SHOWN = 6  # rows of the table of what moves the centre
CENTRED = 0.05  # mean of the drawn machines' speeds off the nominal one's, beyond which we say so
CAPTION = (
    "Steps at 400 t m²: the two directions of the traces (grey bars), the nominal machine (dark blue) and "
    "the drawn machines of the open sets."
)


def text(figures: Mapping[str, Any], spreads: Mapping[str, Spread], known: Mapping[str, Parameter]) -> str:
    """The whole chapter from the figures of `draws.section`."""
    distinct = list({id(s): s for s in spreads.values()}.values())
    sensors = [s for s in distinct if s.parameters[0].startswith(SENSORS)]
    machine = [s for s in distinct if not s.parameters[0].startswith(SENSORS)]
    fixed = [code(n) for n in fit.starts() if n not in spreads]
    open_sets = list(figures["bias"])
    steps = figures["steps"]
    return chapter(
        "draws",
        sizes=", ".join(f"{name} {size}" for name, size in figures["sets"].items()),
        prints=", ".join(f"{name} {code(value)}" for name, value in figures["fingerprint"].items()),
        machine=_spread_table(machine, known),
        errors=_error_table(figures["against_errors"], known),
        fixed=", ".join(fixed) or "none",
        outside=_outside(figures["nominal_outside"], spreads, known),
        coverage=_coverage_table(figures["coverage"]),
        sensors=_sensor_table(known),
        drawn_sensors=_spread_table(sensors, known),
        summary=_summary_table(steps, open_sets),
        inside=sum(_inside(r, open_sets[0]) for r in steps),
        count=len(steps),
        bias=bias_sentence(figures["bias"]),
        centre=_centre_table(figures["centre"], known),
        picture=picture("draws.svg", CAPTION),
    )


def _spread_table(chosen: Sequence[Spread], known: Mapping[str, Parameter]) -> str:
    rows = []
    for s in chosen:
        unit = known[s.parameters[0]].unit
        relation = {"absolute": unit, "factor": "× nominal", "offset": f"{unit}, added"}[s.relation]
        low, high = (significant(v) for v in s.range)
        kind = f"{low} … {high}" if s.sd is None else f"normal, sd {significant(s.sd)}"
        rows.append([_names(s), kind, relation, s.reason, s.status])
    return table(("parameters", "drawn", "unit", "reason", "status"), rows, right=())


def _names(s: Spread) -> str:
    shown = [code(n) for n in s.parameters]
    together = " (together)" if s.group else ""
    few = len(shown) <= 4
    return (", ".join(shown) if few else f"{shown[0]} … {shown[-1]} ({len(shown)})") + together


def _error_table(errors: Mapping[str, Mapping[str, float]], known: Mapping[str, Parameter]) -> str:
    rows = []
    for name, row in errors.items():
        verdict = "" if row["ratio"] >= ENOUGH else "**narrow**"
        values = [significant(row[k], 3) for k in ("half_range", "error")]
        rows.append([code(name), *values, known[name].unit, number(row["ratio"], 1), verdict])
    return table(("parameter", "half range", "standard error", "unit", "ratio", ""), rows, right=(1, 2, 4))


def _outside(names: Sequence[str], spreads: Mapping[str, Spread], known: Mapping[str, Parameter]) -> str:
    if not names:
        return "Every nominal value lies inside its own spread."
    parts = []
    for n in names:
        low, high = (significant(v) for v in spreads[n].limits(known[n].value))
        parts.append(f"{code(n)} {significant(known[n].value)} {known[n].unit} (drawn {low} … {high})")
    return f"**Nominal value outside its own spread:** {'; '.join(parts)}."


def _coverage_table(rows: Sequence[Mapping[str, Any]]) -> str:
    cells = []
    for r in rows:
        ranges = [" … ".join(significant(v, 3) for v in r[k]) for k in ("known", "drawn")]
        cells.append(
            [r["name"], *ranges, r["unit"], r["source"], "covered" if r["covered"] else "**not covered**"]
        )
    return table(("quantity", "known", "drawn", "unit", "whence", ""), cells, right=(1, 2))


def _sensor_table(known: Mapping[str, Parameter]) -> str:
    kinds = ("_noise", "_quantum", "_delay")
    rows = [
        [code(p.name), significant(p.value), p.unit, p.status, p.source]
        for p in known.values()
        if p.name.startswith(SENSORS) and p.name.endswith(kinds)
    ]
    return table(("sensor", "value", "unit", "status", "source"), rows, right=(1,))


def _summary_table(rows: Sequence[Mapping[str, Any]], open_sets: Sequence[str]) -> str:
    lines = []
    for r in rows:
        digits = 2 if r["quantity"] == "t63_s" else 1
        sets = [f"{number(r[n]['low'], digits)} … {number(r[n]['high'], digits)}" for n in open_sets]
        both = " … ".join(number(v, digits) for v in r["traces"])
        inside = "yes" if _inside(r, open_sets[0]) else "no"
        nominal = number(r["nominal"], digits)
        lines.append([f"{r['command']:g}", NAMES[r["quantity"]], both, nominal, *sets, inside])
    columns = ("joystick", "feature", "traces, both directions", "nominal", *open_sets)
    return table((*columns, f"traces in {open_sets[0]}"), lines, right=range(2, 4 + len(open_sets)))


def _inside(row: Mapping[str, Any], name: str) -> bool:
    low, high = row["traces"]
    return bool(row[name]["low"] <= low and high <= row[name]["high"])


def _centre_table(rows: Sequence[Mapping[str, Any]], known: Mapping[str, Parameter]) -> str:
    cells = []
    for row in rows[:SHOWN]:
        for i, (name, middle) in enumerate(row["middles"].items()):
            share = f"{number(100 * row['speed_share'], 1)} %" if i == 0 else ""
            values = [significant(v, 3) for v in (known[name].value, middle)]
            cells.append([code(name), *values, known[name].unit, share])
    return table(("parameter", "nominal", "middle of its spread", "unit", "speed"), cells, right=(1, 2, 4))


def bias_sentence(shares: Mapping[str, float]) -> str:
    parts = " and ".join(f"{number(100 * s, 1)} % ({name})" for name, s in shares.items())
    if max(abs(s) for s in shares.values()) <= CENTRED:
        return f"The mean speed of the drawn machines is off the nominal machine's by {parts}."
    return (
        f"**The spreads are not centred on the calibrated machine**: the mean speed of the drawn machines is "
        f"off the nominal one's by {parts}. Ranges whose middle is not the fitted value add up to that."
    )
