"""What the machine's slew drive is calibrated on, and how well it follows what it was not fitted to."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fmus.models.slew import assessment, fit, score, traces
from fmus.models.slew.score import Run
from fmus.models.slew.traces import Trace
from records.report.picture import Panel
from specs.progress import Report
from verification.dossier import svg
from verification.dossier.markdown import chapter, number, picture, table
from verification.dossier.section import Check, Section, check_table

SHOWN = (  # traces that were not used for the fit, of every shape
    ("step_035_I400", "step to 0.35, 400 t m²"),
    ("step_100_I400", "step to 1.0, 400 t m²"),
    ("bump_I250", "bump, 250 t m²"),
    ("reversal_I550", "reversal, 550 t m²"),
    ("sine_I250", "sine, 250 t m²"),
    ("trapezoid_I550", "trapezoid, 550 t m²"),
)
USES = (
    ("fitted", "`step_*` at 250 and 550 t m², both directions"),
    ("held out, scored", "every other trace up to 550 t m²: steps at 400, bump, reversal, sine, trapezoid"),
    ("apart, not judged", "`step_*` at 700 t m²"),
)
MEANS = {
    "velocity_mae_deg_s": "speed [°/s]",
    "angle_mae_deg": "angle, windows of 10 s [°]",
    "angle_mae_whole_run_deg": "angle, whole runs [°]",
    "pressure_mae_bar": "pressure [bar]",
}
COLUMNS = (
    "trace",
    "speed [°/s]",
    "half mirror difference [°/s]",
    "angle, 10 s windows [°]",
    "angle, whole run [°]",
    "pressure [bar]",
    "sign of Δp",
)
CAPTION = (
    "Slew speed of held-out traces: the trace, its mirrored partner with the sign turned, and the model. "
    "Where the two grey lines part, no symmetric model can follow both."
)


def section(report: Report) -> Section:
    """Score the shipped parameters on all traces."""
    report("scoring the slew drive on the traces")
    known = traces.load()
    figures = assessment.assess(known)
    checks = _checks(figures)
    halves = {t.name: _half(known, t) for t in known.values()}
    pictures = {"traces.svg": _overlays(known)}
    figures = {k: v for k, v in figures.items() if k != "steps"} | {
        "limits": {c.name: c.figures for c in checks}
    }
    return Section(
        "calibration",
        "What it is calibrated on",
        _text(known, figures, checks, halves),
        figures,
        pictures,
        checks,
    )


def _checks(figures: Mapping[str, Any]) -> list[Check]:
    speed, angle = assessment.LIMITS["velocity_mae_deg_s"], assessment.LIMITS["angle_mae_deg"]
    whole, sign = figures["angle_mae_whole_run_deg"], 100 * figures["pressure_sign"]
    least = 100 * assessment.LEAST_PRESSURE_SIGN
    return [
        Check("speed, mean absolute error", figures["velocity_mae_deg_s"], speed, "°/s"),
        Check("angle, mean absolute error over windows of 10 s", figures["angle_mae_deg"], angle, "°"),
        Check("angle, mean absolute error over whole runs", whole, angle, "°", judged=False),
        Check("right sign of Δp where it exceeds 30 bar", sign, least, "%", at_least=True, digits=1),
    ]


def _half(known: Mapping[str, Trace], trace: Trace) -> float:
    return score.mirror_difference(known, [trace])["velocity_mae_deg_s"]


def _text(
    known: Mapping[str, Trace],
    figures: Mapping[str, Any],
    checks: Sequence[Check],
    halves: Mapping[str, float],
) -> str:
    groups = [traces.fit_set(dict(known)), traces.held_out(dict(known)), traces.unphysical(dict(known))]
    sizes = [str(len(group)) for group in groups]
    uses = [[use, size, which] for (use, which), size in zip(USES, sizes, strict=True)]
    scores = {**figures["traces"], **figures["I700"]["traces"]}
    return chapter(
        "calibration",
        count=len(known),
        half_count=len(known) // 2,
        held=sizes[1],
        uses=table(("use", "traces", "which"), uses, right=(1,)),
        checks=check_table(checks),
        floor=number(figures["mirror_difference"]["held_out"]["angle_mae_whole_run_deg"], 1),
        summary=_summary(figures),
        overlays=picture("traces.svg", CAPTION),
        traces=table(COLUMNS, [_row(n, s, halves[n]) for n, s in scores.items()]),
    )


def _summary(figures: Mapping[str, Any]) -> str:
    mirror = figures["mirror_difference"]["held_out"]
    groups = (figures["fit"], figures, figures["I700"])
    rows = [[name, *(number(g[key]) for g in (*groups, mirror))] for key, name in MEANS.items()]
    rows.append(["sign of Δp [%]", *(number(100 * g["pressure_sign"], 1) for g in groups), "–"])
    return table(
        ("mean absolute error", "fitted", "held out", "700 t m²", "half mirror difference, held out"), rows
    )


def _row(name: str, one: Mapping[str, float], half: float) -> list[str]:
    keys = ("angle_mae_deg", "angle_mae_whole_run_deg", "pressure_mae_bar")
    rest = [number(one[k], 1) for k in keys]
    return [
        name,
        number(one["velocity_mae_deg_s"]),
        number(half),
        *rest,
        f"{100 * one['pressure_sign']:.0f} %",
    ]


def _overlays(known: Mapping[str, Trace]) -> str:
    runs = fit.simulate([known[name] for name, _ in SHOWN])
    parts = [svg.legend(60, 24, (("#59636d", "trace"), ("#b9c0c7", "mirrored trace"), (svg.BLUE, "model")))]
    for i, (name, title) in enumerate(SHOWN):
        left, top = 60 + (i % 3) * 305, 60 + (i // 3) * 215
        parts.append(_overlay(left, top, title, known[name], known[known[name].partner], runs[name]))
    return svg.document(960, 480, "Held-out traces and the slew model", parts)


def _overlay(left: float, top: float, title: str, trace: Trace, partner: Trace, run: Run) -> str:
    rest = slice(trace.first, None)
    speeds = [-np.degrees(partner.qd[rest]), np.degrees(trace.qd[rest]), np.degrees(run.qd)]
    low, high = min(float(s.min()) for s in speeds), max(float(s.max()) for s in speeds)
    room = 0.06 * (high - low)
    panel = Panel(left, top, 240, 145, (0.0, float(trace.time[-1])), (low - room, high + room))
    looks = (("#b9c0c7", 1.8), ("#59636d", 1.8), (svg.BLUE, 1.6))
    drawn = svg.axes(panel, title, "time [s]", "slew speed [°/s]" if left < 100 else "")
    return drawn + "".join(
        svg.line(panel, trace.time[rest], s, color, width)
        for s, (color, width) in zip(speeds, looks, strict=True)
    )
