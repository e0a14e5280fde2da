"""The pages of the showcases: the figures in Markdown, between the markers of docs/results/showcases."""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.showcases.showcases import METRIC_UNITS, METRICS, SCENARIOS, Showcase
from records.report import markers


def page(chosen: Showcase, figures: Mapping[str, Any]) -> str:
    """The figures in Markdown."""
    asked = f"--only {chosen.name} --seed {figures['seed']} --markdown docs/results/showcases"
    command = f"python -m benchmarks showcases {asked}"
    lines = [f"`{command}` makes this part; version {figures['versions']['slewright']}.", ""]
    for which, use in (("train", "fitted"), ("validation", "confirm"), ("test", "held out")):
        lines.append(f"- {use}: " + ", ".join(f"`{n}`" for n in figures["recordings"][which]))
    lines += ["", f"**{figures['verdict']}**: {figures['sentence']}", ""]
    parts = (_effects(figures), _gap(figures), _isolated(chosen, figures), _whole(chosen, figures))
    return "\n".join([*lines, *(line for part in parts for line in (*part, ""))])


def _effects(figures: Mapping[str, Any]) -> list[str]:
    rows = ["| effect | equation | parameter | value | 95 % |", "|---|---|---|--:|---|"]
    for e in figures["effects"]:
        for name, q in e["parameters"].items():
            low, high = q["ci95"]
            equation = e["equation"].replace("|", "\\|")
            value = f"{q['value']:.4g} {q['unit']}".removesuffix(" 1")
            rows.append(f"| `{e['name']}` | {equation} | {name} | {value} | {low:.4g} … {high:.4g} |")
    return rows


def _gap(figures: Mapping[str, Any]) -> list[str]:
    rows = [
        "Gap above the floor, on what is held out:",
        "",
        "| signal | floor | plain | re-estimated | extended |",
        "|---|--:|--:|--:|--:|",
    ]
    for name, g in figures["gap"].items():
        values = " | ".join(_number(g[k]) for k in ("floor", "nominal", "reestimated", "after"))
        rows.append(f"| `{name}` [{g['unit']}] | {values} |")
    return rows


def _isolated(chosen: Showcase, figures: Mapping[str, Any]) -> list[str]:
    return [
        "The model by itself: the scenarios below once more, the model moved as the simulated reference",
        f"machine moved in them. {ALONE[chosen.name]}",
        "",
        *_metrics(figures["isolated"], "", chosen.moves),
    ]


def _whole(chosen: Showcase, figures: Mapping[str, Any]) -> list[str]:
    return [
        f"The whole nominal system: `slewright verify` on {' and '.join(f'`{s}`' for s in SCENARIOS)},",
        f"mean of the two. {WHOLE[chosen.name]}",
        "",
        *_metrics(figures["whole"], "nominal system, ", METRICS),
    ]


ALONE = {
    "tool": "Slew and arm are the machine's own, and with them speed and overshoot.",
    "slew": (
        "It gets the machine's joystick and the inertia of the machine's arm,\nand its angle begins anew at "
        "the machine's with every target; the tool is the machine's own."
    ),
}
WHOLE = {
    "tool": (
        "Slew and arm of this system move otherwise than the machine's\nand swing the tool otherwise, "
        "whatever the tool's model; nothing in it feels the tool, so speed and overshoot stay."
    ),
    "slew": "Arm and tool of this system move otherwise than the machine's, whatever the slew's model.",
}


def _metrics(compared: Mapping[str, Any], where: str, names: Iterable[str]) -> list[str]:
    """Table of a comparison, and a sentence on what moved away."""
    names = tuple(names)
    rows = [
        "| | " + " | ".join(f"{_said(m)} [{METRIC_UNITS[m]}]" for m in names) + " |",
        "|---|" + "--:|" * len(names),
    ]
    called = {"plain": f"{where}plain model", "extended": f"{where}extended model"}
    called["machine"] = "simulated reference machine"
    for s, found in compared["mean"].items():
        rows.append(f"| {called[s]} | " + " | ".join(f"{found[m]:.2f}" for m in names) + " |")
    for s, found in compared["distance"].items():
        values = " | ".join(f"{found[m]:.2f}" for m in names)
        rows.append(f"| {s} model's distance to the machine, mean over the targets | {values} |")
    told = " | ".join(_share(compared["closer"][m]) for m in names)
    away = [_said(m) for m in names if (compared["closer"][m] or 0.0) < 0.0]
    warned = ["", f"Moved away from the machine: {', '.join(away)}."] if away else []
    return [*rows, f"| extended against plain | {told} |", *warned]


def _said(metric: str) -> str:
    return metric.replace("_", " ")


def _share(share: float | None) -> str:
    if share is None or share == 0.0:
        return "as far"
    return f"{100 * share:.0f} % closer" if share > 0 else f"{-100 * share:.0f} % farther"


def _number(value: float | None) -> str:
    return "runs away" if value is None or math.isnan(value) else f"{value:.3g}"


def pages(folder: Path, chosen: Sequence[Showcase], figures: Mapping[str, Any]) -> None:
    """Fill the part between the markers of every showcase's page in a folder."""
    for showcase in chosen:
        markers.fill(folder / f"{showcase.name}.md", "showcase", page(showcase, figures[showcase.name]))
