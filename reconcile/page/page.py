"""DIR/report.html from the figures of report.json and what is drawn beside them."""

from collections.abc import Mapping, Sequence
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any

from reconcile.judging.answer import Answer
from reconcile.page import plots, sections
from reconcile.page.drawn import Shown
from reconcile.page.shown import missing, shown
from reconcile.reporting.findings import gather
from reconcile.search.core import Core
from reconcile.words import number, percent
from records.report import shell
from records.report.figures import Figure

MOST = 3  # held-out stretches drawn
LONG = 90  # characters of a sentence that need a smaller letter
PUSH = (
    "What would have to push there for the model to follow the recordings "
    "(smoothed; the band is two standard deviations)."
)
TONES = {"named": "good", "agrees": "good", "reestimated": "good", "unexplained": "bad"}


def write_for(path: Path, answers: Sequence[Answer], figures: Mapping[str, Any], title: str) -> Path:
    """Write the page of an answer, or of the answers of a system's parts; `figures`: the report as JSON."""
    each = [shown(gather(answer)) for answer in answers]
    stretches = [s for one in each for s in one.stretches[: max(1, MOST // len(each))]]
    rest = ([x for one in each for x in getattr(one, n)] for n in ("whole", "gathered", "missing"))
    return write_page(path, figures, Shown(stretches, *rest), title)


def write_page(path: Path, figures: Mapping[str, Any], shown: Shown, title: str) -> Path:
    """Write the page; `title`: the model's name.  The same content gives the same bytes."""
    overlays = [plots.whole(i, s) for i, s in enumerate(shown.whole)]
    overlays += [plots.overlay(i, s) for i, s in enumerate(shown.stretches)]
    gap = plots.gaps(figures["gap"])
    pairs = [(plots.gathered(i, g), plots.accounts(i, g)) for i, g in enumerate(shown.gathered)]
    forces = [f for i, m in enumerate(shown.missing) for f in plots.missing(i, m)]
    sure = _sure(figures)
    curves = [plots.curve(i, row) for i, row in enumerate(figures.get("free_form") or ())]
    body = [
        f"<style>{_style()}</style>",
        _head(figures, title),
        _forces(forces),
        sections.named(figures),
        _curves(curves),
        _grid(sure),
        sections.doubt(figures),
        _overlays(overlays),
        f"<h2>The gap</h2>{sections.gap(figures)}{_grid([gap])}{sections.by_regime(figures)}",
        f"<h2>Where they disagree</h2>{sections.where(figures)}",
        _grid([f for pair in pairs for f in pair]),
        sections.parameters(figures),
        sections.considered(figures),
        sections.steps(figures),
        sections.unidentifiable(figures),
        sections.driven(figures),
        sections.next_experiment(figures),
        sections.measured(figures),
    ]
    drawn = [*forces, *curves, *overlays, *sure, gap, *(f for pair in pairs for f in pair)]
    return shell.write_whole(path, shell.document(f"reconcile {title}", body, drawn))


def write_first(path: Path, core: Core, title: str) -> Path:
    """Write what there is to see before effects are looked for: what the fitted model lacks."""
    forces = [f for i, m in enumerate(missing(core, core.shown, core.shown)) for f in plots.missing(i, m)]
    report = path.stem.removesuffix("-first")
    body = [
        f"<style>{_style()}</style><header><h1>Slewright · reconcile {escape(title)}</h1>"
        "<p class='verdict none long'>The model by itself is fitted; effects are being looked for. "
        f"This page goes when {escape(report)}/report.html is there.</p></header>",
        f"<h2>The missing force so far</h2><p>{PUSH}</p>{_grid(forces)}",
    ]
    return shell.write_whole(path, shell.document(f"reconcile {title}", body, forces))


def _head(figures: Mapping[str, Any], title: str) -> str:
    sentence, _, more = figures["sentence"].partition(". ")
    tone = TONES.get(figures["verdict"], "none") + (" long" if len(sentence) > LONG else "")
    return (
        f"<header><h1>Slewright · reconcile {escape(title)}</h1>"
        f"<p class='verdict {tone}'>{escape(sentence + '.' * bool(more))}</p>"
        f"{sections.meaning(figures)}<p>{escape(more)}</p>"
        f"{shell.facts(_facts(figures))}</header>"
    )


def _facts(figures: Mapping[str, Any]) -> list[tuple[str, str]]:
    rated = figures["iso18571"] or {}
    found = [
        ("Verdict", figures["verdict"].replace("_", " ")),
        ("What is left", _left(figures)),
    ]
    found += _closed(figures, "Gap closed, held out", "nominal")
    found += (
        _closed(figures, "By the effects beside new parameters", "reestimated") if figures["effects"] else []
    )
    if rated.get("after") is not None and rated.get("before") is not None:
        found.append(("ISO/TS 18571, held out", f"{rated['before']:.2f} → {rated['after']:.2f}"))
    runs = {b["run"] for part in figures.get("data", {}).values() for b in part}
    found += [("Recordings", str(len(runs)))] if runs else []
    found.append(("Time", f"{number(figures.get('elapsed_s'), 3)} s"))
    return found


def _closed(figures: Mapping[str, Any], title: str, since: str) -> list[tuple[str, str]]:
    """What is closed of a stage's gaps, from the least of a signal to the most."""
    closed = [c for g in figures["gap"].values() if (c := sections.closed(g, since)) is not None]
    if not closed:
        return []
    least, most = percent(min(closed)), percent(max(closed))
    return [(title, least if least == most else f"{least} to {most}, by signal")]


def _left(figures: Mapping[str, Any]) -> str:
    if figures["residual_status"] == "at_floor":
        return "noise alone"
    terms = [t for free in (figures.get("free_form") or ())[:1] for t in free["terms"]]
    return "something unexplained" + (f", like {', '.join(terms)}" if terms else "")


def _sure(figures: Mapping[str, Any]) -> list[Figure]:
    rows, known = [], set()
    for row in figures.get("sets", ()):
        if tuple(row["effects"]) not in known:
            known.add(tuple(row["effects"]))
            rows.append(row)
    return [plots.probabilities(rows, figures.get("kinds", {}))] if rows else []


def _forces(drawn: list[Figure]) -> str:
    if not drawn:
        return ""
    return (
        f"<h2>The missing force</h2><p>{PUSH} Where a named effect pushes, that is the model "
        "with the answer's parameters but without its effects: red is what they do, “after” what is left. "
        f"Dry friction is a step where the speed is zero, a spring a slope over the place.</p>{_grid(drawn)}"
    )


def _curves(drawn: list[Figure]) -> str:
    if not drawn:
        return ""
    return (
        "<h2>What no effect has the form of</h2><p>No set of the catalogue's effects comes near it. So it is "
        f"fitted as a curve through points, which is part of the extended model.</p>{_grid(drawn)}"
    )


def _overlays(drawn: list[Figure]) -> str:
    if not drawn:
        return ""
    return f"<h2>Before and after</h2>{_grid(drawn)}"


def _grid(drawn: list[Figure]) -> str:
    return f"<div class='figures'>{''.join(map(shell.place, drawn))}</div>" if drawn else ""


def _style() -> str:
    return resources.files("reconcile.page").joinpath("style.css").read_text("utf-8")
