"""The physics checks as a chapter: limits, tables, pictures; with the effect of halving the step."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fmus.models.machine.model import MODEL
from records.record import Record
from records.report.picture import Panel
from specs.progress import Report
from verification.dossier import halving, physics, svg
from verification.dossier.machine import Bench
from verification.dossier.markdown import chapter, number, picture, table
from verification.dossier.section import Check, Section, check_table

GAP_LIMIT, REST_LIMIT_RAD, PERIOD_LIMIT, DECAY_LIMIT = 1.0, 1e-6, 2.0, 10.0  # all but the second in percent
LEAST_ORDER = physics.DESIGNED_ORDER - 0.2
ENERGIES = {
    "supply_j": "given by the pump",
    "valves_j": "lost in valves, orifices, leaks",
    "friction_j": "lost in friction, brake, dampers, end stops",
    "oil_j": "stored in the oil",
    "mechanical_j": "gained as kinetic and potential energy",
}
CAPTION = (
    "Left: free swing of the tool as shipped, true angles. Right: error after 0.5 s of motion by internal "
    "step; dashed: slope of the designed order."
)


def section(report: Report, bench: Bench, scenarios: Sequence[str]) -> Section:
    """All physics figures; `scenarios` are those run with half the internal step."""
    report("power balance")
    found: dict[str, Any] = {"power": physics.power_balance()}
    report("rest and free swing")
    found["drift_rad"] = physics.drift(bench)
    found["swing"], records = physics.free_swing(bench)
    report("order of the integrator")
    found["order"] = physics.order()
    found["halving"] = halving.figures(report, scenarios)
    checks = _checks(found)
    pictures = {"physics.svg": _picture(found, records)}
    return Section("physics", "Physics checks", _text(found, checks), found, pictures, checks)


def _checks(found: Mapping[str, Any]) -> list[Check]:
    gap, order = 100 * found["power"]["gap_share_of_mechanical"], found["order"]["order"]
    checks = [
        Check("power balance: gap, of the mechanical energy moved", gap, GAP_LIMIT, "%", digits=4),
        Check("largest movement of a joint in 60 s at rest", _drift(found), REST_LIMIT_RAD, "rad", digits=8),
        Check("observed order of the integrator", order, LEAST_ORDER, "", at_least=True),
    ]
    for name, s in found["swing"].items():
        period = 100 * abs(s["period_s"] / s["period_expected_s"] - 1)
        decay = 100 * abs(s["decay_1_s"] / s["decay_expected_1_s"] - 1)
        checks.append(Check(f"tool {name}: period off by", period, PERIOD_LIMIT, "%"))
        checks.append(Check(f"tool {name}: decay off by", decay, DECAY_LIMIT, "%"))
    return [*checks, halving.check(found["halving"])]


def _drift(found: Mapping[str, Any]) -> float:
    return max(v for joints in found["drift_rad"].values() for v in joints.values())


def _text(found: Mapping[str, Any], checks: Sequence[Check]) -> str:
    power, order = found["power"], found["order"]
    energies = [[label, number(power[key] / 1e3, 1)] for key, label in ENERGIES.items()]
    columns = ("swing", "period [s]", "expected [s]", "decay [1/s]", "as shipped [1/s]", "expected [1/s]")
    return chapter(
        "physics",
        checks=check_table(checks),
        balance_s=f"{physics.BALANCE_S:g}",
        gap=number(power["largest_gap_j"], 1),
        moved=number(power["mechanical_swing_j"] / 1e3, 0),
        energies=table(("energy over the run", "kJ"), energies),
        rest_s=f"{physics.REST_S:g}",
        drift=f"{_drift(found):.2g}",
        push_n=f"{physics.PUSH_N:g}",
        push_s=f"{physics.PUSH_S:g}",
        knee=f"{physics.HELD_KNEE:g}",
        swings=table(columns, [_swing_row(n, s) for n, s in found["swing"].items()]),
        designed=physics.DESIGNED_ORDER,
        serves=MODEL.serves,
        order=number(order["order"]),
        steps=", ".join(f"{1e3 * h:g}" for h in order["steps_s"]),
        finest=f"{1e3 * physics.FINEST:g}",
        picture=picture("physics.svg", CAPTION),
        seed=halving.SEED,
        halving=halving.rows(found["halving"]),
        apart=_apart(found["halving"]["apart_deg"]),
    )


def _apart(degrees: Mapping[str, float]) -> str:
    return "; ".join(f"{number(value, 3)}° ({scenario})" for scenario, value in degrees.items()) or "none run"


def _swing_row(name: str, swing: Mapping[str, float]) -> list[str]:
    periods = [number(swing[k], 3) for k in ("period_s", "period_expected_s")]
    return [
        name,
        *periods,
        *(number(swing[k], 4) for k in ("decay_1_s", "decay_as_is_1_s", "decay_expected_1_s")),
    ]


def _picture(found: Mapping[str, Any], records: Mapping[str, Record]) -> str:
    left = Panel(60, 56, 560, 200, (0.0, physics.SWING_S), (-1.5, 1.5))
    parts = [svg.axes(left, "Tool after a push, brake on, joysticks neutral", "time [s]", "angle [°]")]
    colors = dict(zip(records, svg.COLORS, strict=False))
    for name, joint in (("pitch", "tool_y"), ("roll", "tool_x")):
        rows = slice(0, None, 5)
        angle = np.degrees(records[name].column(f"true_q_{joint}")[rows])
        parts.append(svg.line(left, records[name].time[rows], angle, colors[name], 1.3))
    parts.append(svg.legend(60, 24, [(color, name) for name, color in colors.items()]))
    parts.append(_order_panel(found["order"]))
    return svg.document(960, 310, "Free swing of the tool and order of the integrator", parts)


def _order_panel(order: Mapping[str, Any]) -> str:
    steps, errors = np.log10(order["steps_s"]), np.log10(order["errors"])
    low, high = math.floor(errors.min()), math.ceil(errors.max())
    panel = Panel(720, 56, 210, 200, (float(steps.min()) - 0.2, float(steps.max()) + 0.2), (low, high))
    names = {float(s): f"{1e3 * 10**s:.3g}" for s in steps}
    decades = {float(k): f"1e{k}".replace("-", "−") for k in range(low, high + 1)}
    title = f"Error by step: order {number(order['order'])}"
    ideal = errors[0] + physics.DESIGNED_ORDER * (steps - steps[0])
    return (
        svg.axes(panel, title, "internal step [ms]", "", names, decades)
        + svg.line(panel, steps, ideal, svg.GREY, 1.2, "4 3")
        + svg.dots(panel, steps, errors, svg.BLUE, 4)
    )
