"""Figures 6 to 8: four targets with driver and controller, five with circles, strategies by load."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from typing import Any

import numpy as np

from orchestrator.run.processes import interrupts_held, warm_up
from records.metrics import compute, tool_rate_deg
from records.record import Record
from records.report.picture import Panel, picture
from specs.scenario import Load, Scenario, Target, load as load_scenario
from verification.dossier import svg
from verification.dossier.markdown import table
from verification.paper.asked import WHERE, Asked, plant
from verification.paper.made import COLUMNS, Made
from verification.paper.trained import controller
from verification.plants.trial import NEEDED, Job, simulated

DRIVER, POLICY = "operator_experienced", "paper"
COLUMNS_KEPT = (*NEEDED, "qd_boom_ref", "qd_stick_ref")
Runs = Mapping[str, Mapping[str, Record]]  # column -> name of the run -> record
Wanted = Mapping[str, tuple[str, Scenario]]  # name of the run -> controller, scenario
THIN = 5  # rows of 0.02 s between drawn points


def _run(asked: Asked, wanted: Wanted) -> Runs:
    """All runs on all plants."""
    jobs: list[Job] = []
    for column in COLUMNS:
        for name, scenario in wanted.values():
            own = controller(asked, name)
            asked.report(f"building {name} on {column}")
            ssp = plant(column).pack(own.models, own.name)
            jobs.append(Job(ssp, plant(column), scenario, asked.seed, 1.0, own.parameters))
    with ProcessPoolExecutor(asked.workers, get_context("spawn"), initializer=warm_up) as pool:
        with interrupts_held():
            coming = pool.map(_record, jobs)
        records = iter(list(coming))
    return {column: {name: next(records) for name in wanted} for column in COLUMNS}


def _record(job: Job) -> Record:
    return simulated(job, COLUMNS_KEPT)


def four_targets(asked: Asked) -> Made:
    """Fig. 6: the same four targets for the driver and for the controller."""
    scenario = load_scenario("four_targets_empty")
    runs = _run(asked, {"operator": (DRIVER, scenario), "policy": (POLICY, scenario)})
    found = {c: {name: _metrics(record) for name, record in runs[c].items()} for c in COLUMNS}
    pictures = {
        f"four-targets-{c}.svg": picture(runs[c], f"Four targets, {WHERE[c]}", height=True) for c in COLUMNS
    }
    return Made({"targets": 4, "driver": "15 years of experience"}, **found,
                text=_four_table(found), pictures=pictures)  # fmt: skip


def _metrics(record: Record) -> dict[str, Any]:
    m = compute(record)
    keys = ("speed", "overshoot", "error", "tool", "missed", "within_1m", "within_2m", "targets")
    return {key: getattr(m, key) for key in keys}


def _four_table(found: Mapping[str, Any]) -> str:
    rows = [
        [WHERE[c], name, *(f"{cell[k]:.2f}" for k in ("speed", "overshoot", "error", "tool"))]
        for c, by_name in found.items()
        for name, cell in by_name.items()
    ]
    return table(("where", "", "speed °/s", "overshoot °", "error m", "tool °/s"), rows, right=range(2, 6))


def five_targets(asked: Asked) -> Made:
    """Fig. 7: five targets with circles of 1 m and 2 m, empty and with a load that is not told."""
    wanted = {load: (POLICY, load_scenario(f"five_targets_{load}")) for load in ("empty", "unknown")}
    runs = _run(asked, wanted)
    found = {c: {load: _metrics(record) for load, record in runs[c].items()} for c in COLUMNS}
    pictures = {f"five-targets-{c}.svg": _circles(runs[c], f"Five targets, {WHERE[c]}") for c in COLUMNS}
    rows = [
        [WHERE[c], load, f"{cell['within_1m']} of 5", f"{cell['within_2m']} of 5", f"{cell['error']:.2f}"]
        for c, by_load in found.items()
        for load, cell in by_load.items()
    ]
    text = table(("where", "load", "within 1 m", "within 2 m", "error m"), rows, right=range(2, 5))
    return Made({"targets": 5, "tolerances_m": [1.0, 2.0]}, **found, text=text, pictures=pictures)


def _circles(runs: Mapping[str, Record], title: str) -> str:
    """Path of the tool from above, left empty and right with a load that is not told."""
    from records.targets import targets

    parts = [svg.text(24, 24, title, weight=600, size=15)]
    for number, (load, record) in enumerate(runs.items()):
        panel = Panel(70 + 450 * number, 66, 380, 380, (-14.0, 14.0), (-14.0, 14.0))
        heading = "without load" if load == "empty" else "unknown load, not told"
        parts.append(svg.axes(panel, heading, "x [m]", "y [m]"))
        scale = panel.width / 28.0
        for target in targets(record):
            parts += [
                _circle(panel, target.x, target.y, r * scale, color)
                for r, color in ((2, svg.ORANGE), (1, GREEN))
            ]
            parts.append(
                svg.text(panel.at_x(target.x) + 5, panel.at_y(target.y) - 5, str(target.number), weight=600)
            )
        x, y = (record.column(f"true_tool_{axis}")[::THIN] for axis in "xy")
        parts.append(svg.line(panel, x, y, svg.BLUE))
        parts.append(svg.text(panel.at_x(x[0]) + 5, panel.at_y(y[0]) + 14, "0", weight=600))
    parts.append(svg.legend(24, 505, [(GREEN, "1 m"), (svg.ORANGE, "2 m"), (svg.BLUE, "path of the tool")]))
    return svg.document(940, 520, title, parts)


GREEN = "#3c8d40"


def _circle(panel: Panel, x: float, y: float, radius: float, color: str) -> str:
    at = f"cx='{panel.at_x(x):.1f}' cy='{panel.at_y(y):.1f}' r='{radius:.1f}'"
    return f"<circle {at} stroke='{color}' fill='{color}' fill-opacity='0.12'/>"


def strategies(asked: Asked) -> Made:
    """Fig. 8: one turn at a constant height, with an empty grab and with 2 t that are not told."""
    runs = _run(asked, {name: (POLICY, _turn(name, kg)) for name, kg in (("empty", 0.0), ("loaded", 2000.0))})
    found = {c: {name: _effort(record) for name, record in runs[c].items()} for c in COLUMNS}
    pictures = {f"strategies-{c}.svg": _strategy(runs[c], f"One turn of 90°, {WHERE[c]}") for c in COLUMNS}
    rows = [
        [WHERE[c], name, *(f"{value:.2f}" for value in cell.values())]
        for c, by_name in found.items()
        for name, cell in by_name.items()
    ]
    head = ("where", "grab", "height varies m", "radius varies m", "tool °/s", "arm moves rad")
    return Made({"said": "a large height variation without load, a direct path with it"}, **found,
                text=table(head, rows, right=range(2, 6)), pictures=pictures)  # fmt: skip


def _turn(name: str, kg: float) -> Scenario:
    known = load_scenario("four_targets_empty")
    load = Load(name=name, description="Not told", low_kg=kg, high_kg=kg, told_kg=0.0)
    target = Target(slew_deg=90.0, radius_m=9.95, height_m=6.18)  # radius and height of the start
    return replace(known, base="turn", targets=(target,), load=load)


def _effort(record: Record) -> dict[str, float]:
    """What the arm and the tool do on the way."""
    radius = np.hypot(record.column("true_tool_x"), record.column("true_tool_y"))
    refs = np.abs(record.column("qd_boom_ref")) + np.abs(record.column("qd_stick_ref"))
    return {
        "height_m": float(np.ptp(record.column("true_tool_z"))),
        "radius_m": float(np.ptp(radius)),
        "tool": float(tool_rate_deg(record).mean()),
        "arm_rad": float(refs.sum() * (record.time[1] - record.time[0])),
    }


def _strategy(runs: Mapping[str, Record], title: str) -> str:
    """Commands, slew and tool over time, empty and loaded."""
    rows = (
        ("Slew joystick [1]", lambda r: r.column("u_slew")),
        ("Boom reference [rad/s]", lambda r: r.column("qd_boom_ref")),
        ("Stick reference [rad/s]", lambda r: r.column("qd_stick_ref")),
        ("Slew angle [°]", lambda r: np.degrees(r.column("true_q_slew"))),
        ("Tool height [m]", lambda r: r.column("true_tool_z")),
        ("Tool rate [°/s]", tool_rate_deg),
    )
    looks = (("empty", svg.BLUE), ("loaded", svg.ORANGE))
    parts = [svg.text(24, 24, title, weight=600, size=15)]
    parts.append(svg.legend(24, 46, [(svg.BLUE, "empty grab"), (svg.ORANGE, "2 t, not told")]))
    for number, (what, column) in enumerate(rows):
        curves = {name: column(record)[::THIN] for name, record in runs.items()}
        parts.append(_over_time(number, what, curves, looks, next(iter(runs.values())).time[::THIN]))
    return svg.document(960, 610, title, parts)


def _over_time(
    number: int,
    what: str,
    curves: Mapping[str, np.ndarray],
    looks: Sequence[tuple[str, str]],
    time: np.ndarray,
) -> str:
    low, high = min(v.min() for v in curves.values()), max(v.max() for v in curves.values())
    room = 0.06 * max(high - low, 0.05)
    place = (66 + 470 * (number % 2), 84 + 175 * (number // 2))
    panel = Panel(*place, 400, 120, (0.0, float(time[-1])), (float(low - room), float(high + room)))
    label = "time [s]" if number > 3 else ""
    return svg.axes(panel, what, label, y_ticks=svg.ticks(panel.y, 4.5)) + "".join(
        svg.line(panel, time, curves[n], color) for n, color in looks
    )
