"""The machine against the step traces at 400 t m2, read through its sensors."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from fmus.models.slew import features, traces
from fmus.models.slew.features import ABSOLUTE, RELATIVE, Features
from fmus.models.slew.traces import Trace
from records.record import Record
from records.report.picture import Panel
from specs.progress import Report
from verification.dossier import svg
from verification.dossier.machine import Bench, Pose, pose, read_step
from verification.dossier.markdown import chapter, number, picture, table
from verification.dossier.section import MET, MISSED, Check, Section

INERTIA = 400e3  # kg m2
LEAST_COMMAND = 0.24
COMMANDS = (0.35, 0.5, 0.7, 1.0)  # of the step traces at 400 t m2, from LEAST_COMMAND on
SEED = 1
NAMES = {
    "speed_deg_s": "speed before release [°/s]",
    "t5_s": "time to 5 % [s]",
    "t63_s": "time to 63 % [s]",
    "t90_s": "time to 90 % [s]",
    "coast_deg": "angle coasted [°]",
}
COLUMNS = ("joystick", "feature", "traces", "machine, sensors", "difference", "allowed", "machine, true", "")
CAPTION = (
    "Steps at 400 t m²: traces of both directions (grey), the simulated reference machine through its "
    "velocity sensor (blue)."
)
DIGITS = {"speed_deg_s": 1, "coast_deg": 1}


def section(report: Report, bench: Bench) -> Section:
    """Steps of the machine's FMU in both directions, features against those of the traces."""
    known = traces.load()
    at = pose(INERTIA)
    rows, records = [], {}
    for i, command in enumerate(COMMANDS):
        report("steps of the reference machine", i, len(COMMANDS))
        pair = [bench.step(sign * command, at.parameters, SEED) for sign in (1, -1)]
        records[command] = pair[0]
        rows.append(_compare(command, pair, known))
    figures = {
        "inertia_kg_m2": INERTIA,
        "radius_m": at.radius,
        "start_q_boom": at.q_boom,
        "start_q_stick": at.q_stick,
        "seed": SEED,
        "steps": rows,
        "passed": not any(r["misses"] for r in rows),
    }
    pictures = {"steps.svg": _picture(known, records)}
    title = "The machine against the step traces"
    return Section("steps", title, _text(rows, at), figures, pictures, [_check(rows)])


def _check(rows: Sequence[Mapping[str, Any]]) -> Check:
    misses = float(sum(len(r["misses"]) for r in rows))
    return Check("features of the steps at 400 t m² off the traces", misses, 0.0, "", digits=0)


def _compare(command: float, pair: Sequence[Record], known: Mapping[str, Trace]) -> dict[str, Any]:
    name = f"step_{round(100 * command):03d}_I{round(INERTIA / 1e3)}"
    wanted = features.mean([features.of_trace(known[n]) for n in (name, name + traces.MIRROR)])
    found = features.mean([read_step(r) for r in pair])
    return {
        "command": command,
        "traces": asdict(wanted),
        "sensors": asdict(found),
        "true": asdict(features.mean([read_step(r, "true_") for r in pair])),
        "misses": features.misses(found, wanted),
    }


def allowed(name: str, wanted: float) -> float:
    """Largest difference of a feature to the traces' value `wanted`."""
    return max(RELATIVE * abs(wanted), getattr(ABSOLUTE, name))


def _text(rows: Sequence[Mapping[str, Any]], at: Pose) -> str:
    cells = [_cells(row, f.name) for row in rows for f in fields(Features)]
    return chapter(
        "steps",
        radius=number(at.radius),
        inertia=f"{INERTIA / 1e3:.0f}",
        seed=SEED,
        relative=f"{100 * RELATIVE:.0f} %",
        speed=f"{ABSOLUTE.speed_deg_s:g}",
        angle=f"{ABSOLUTE.coast_deg:g}",
        time=f"{ABSOLUTE.t5_s:g}",
        least=f"{LEAST_COMMAND:g}",
        passed=sum(c[-1] == MET for c in cells),
        count=len(cells),
        table=table(COLUMNS, cells, right=range(2, 7)),
        picture=picture("steps.svg", CAPTION),
    )


def _cells(row: Mapping[str, Any], name: str) -> list[str]:
    wanted, found, true = (row[k][name] for k in ("traces", "sensors", "true"))
    limit, digits = allowed(name, wanted), DIGITS.get(name, 2)
    difference = number(found - wanted, digits) if abs(found - wanted) >= 0.5 * 10**-digits else "0"
    values = [
        number(wanted, digits),
        number(found, digits),
        difference,
        number(limit, digits),
        number(true, digits),
    ]
    return [f"{row['command']:g}", NAMES[name], *values, MET if abs(found - wanted) <= limit else MISSED]


def _picture(known: Mapping[str, Trace], records: Mapping[float, Record]) -> str:
    entries = (("#59636d", "traces, both directions"), (svg.BLUE, "simulated reference machine, sensor"))
    parts = [svg.legend(60, 24, entries)]
    for i, (command, record) in enumerate(records.items()):
        name = f"step_{round(100 * command):03d}_I{round(INERTIA / 1e3)}"
        panel = Panel(60 + i * 230, 60, 185, 190, (0.0, 15.0), (-3.0, 55.0))
        parts.append(svg.axes(panel, f"u = {command:g}", "time [s]", "slew speed [°/s]" if i == 0 else ""))
        for trace, sign in ((known[name], 1.0), (known[name + traces.MIRROR], -1.0)):
            speed = np.degrees(sign * trace.qd[trace.first :])
            parts.append(
                svg.line(panel, trace.time[trace.first :], speed, "#59636d" if sign > 0 else "#b9c0c7")
            )
        rows = slice(0, None, 5)
        speed = np.degrees(record.column("qd_slew")[rows])
        parts.append(svg.line(panel, record.time[rows], speed, svg.BLUE, 1.5))
    return svg.document(960, 300, "Steps of the reference machine", parts)
