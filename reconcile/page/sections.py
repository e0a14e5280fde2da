"""The page's sections of text and tables, from the figures of report.json."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from reconcile.page.equation import equation, spelt
from reconcile.words import listed, number, number_with_error, percent, with_unit, written
from records.report import shell

Figures = Mapping[str, Any]
STAGES = {"nominal": "as it came", "reestimated": "re-estimated", "after": "after"}
SHOWN_PAIRS = 12
STEPS = {
    "named": "an effect: coarser than it should be",
    "specified": "as its sensor is specified",
    "below_noise": "finer than its noise",
    "fine": "a small part of what it moves by",
}


def _stages(figures: Figures) -> dict[str, str]:
    """Stages with their heads; without a parameter that was fitted nothing is re-estimated."""
    return {k: head for k, head in STAGES.items() if k != "reestimated" or _fitted(figures)}


def _fitted(figures: Figures) -> bool:
    """Whether parameters were fitted: those of a model folder are, of a closed FMU those that show."""
    return figures.get("fitted") != []


def named(figures: Figures) -> str:
    """The effects that were found: equation, parameters, place, gains."""
    if not figures["effects"]:
        return ""
    return f"<h2 class='stay'>What the model lacks</h2>{''.join(_effect(e) for e in figures['effects'])}"


def _closing(share: float) -> str:
    if share < 0.0:
        return f"the gap that is open without it grows by {percent(-share)}"
    return f"{percent(share)} of the gap that is open without it closes"


def _effect(e: Figures) -> str:
    doubt = " doubtful" if e["verdict"] == "ambiguous" else ""
    gain = (
        f"Fit: twice the log-likelihood gains {number(e['gain_fit'], 3)}. "
        f"Confirm: {_closing(e['gain_confirm'])}."
        if e["gain_fit"] is not None
        else f"Seen in the recorded values, not fitted: {escape(e.get('sentence', ''))}."
    )
    source = f"<p class='soft'>Source: {escape(e['source'])}.</p>" if e.get("source") else ""
    rows = [
        f"<tr><th scope='row'>{spelt(n)}</th>"
        f"<td>{escape(with_unit(number_with_error(p['value'], p['ci95']), p['unit']))}</td>"
        f"<td>{escape(_interval(p['ci95'], p['unit']))}</td></tr>"
        for n, p in e["parameters"].items()
    ]
    head = "<thead><tr><th>Parameter</th><th>Value</th><th>95 % interval</th></tr></thead>"
    return (
        f"<div class='effect{doubt}'><h3>{escape(e['name'])}</h3>"
        f"<p class='soft'>{escape(_where(e))}</p>"
        f"<p>{equation(e['equation'], e['parameters'])}</p>"
        f"<table>{head}<tbody>{''.join(rows)}</tbody></table><p>{gain}</p>{source}</div>"
    )


def meaning(figures: Figures) -> str:
    """What the names in the first sentence stand for: a line with the equation of each effect."""
    found = {e["name"]: equation(e["equation"], e["parameters"]) for e in figures["effects"]}
    lines = [f"<li>{escape(name)}: {text}</li>" for name, text in found.items()]
    return f"<ul class='plain'>{''.join(lines)}</ul>" if lines else ""


def _where(e: Figures) -> str:
    port = "" if e["port"] == e["subsystem"] else f" at {e['port']}"
    certain = "named" if e["verdict"] == "named" else "not told from its alternatives"
    return f"{e['place']}{port}, subsystem {e['subsystem']}; {certain}"


def _interval(limits: Sequence[float], unit: str) -> str:
    low, high = (number_with_error(v, list(limits)) for v in limits)
    return with_unit(f"{low} … {high}", unit)


def doubt(figures: Figures) -> str:
    """Sets that cannot be told from the answer, and how little their predictions differ from its own."""
    if len(figures["alternatives"]) < 2:
        return ""
    apart = {tuple(a["effects"]): a for a in figures.get("told_apart", [])}
    signals = list(figures["gap"])
    rows = []
    for i, names in enumerate(figures["alternatives"]):
        known = apart.get(tuple(names))
        differs = known["differs"] if known else None
        cells = [number(differs[s], 2) if differs else ("0" if i == 0 else "–") for s in signals]
        left = known["gap"] if known else {s: figures["gap"][s]["after"] for s in signals} if i == 0 else None
        cells += [_left(left[s], figures["gap"][s]["unit"]) if left else "–" for s in signals]
        rows.append([listed(list(names)) + (" (answer)" if i == 0 else ""), *cells])
    head = ["Set", *(f"{s}: differs by / floor" for s in signals), *(f"{s}: gap after" for s in signals)]
    return (
        "<h2 class='stay'>What cannot be told from it</h2><p>Each of these sets explains the recordings as "
        "well. On the held-out part their predictions differ from the answer's by this much, in units of the "
        f"floor; below about 1 nobody can see it.</p>{shell.table(head, rows)}"
    )


def closed(gap: Figures, since: str = "nominal") -> float | None:
    """Share of a stage's gap that is closed; None without one."""
    before, after = gap[since], gap["after"]
    return None if not before or after is None else 1.0 - after / before


def gap(figures: Figures) -> str:
    """Gap by signal against the floor, with RMSE, FIT and rating."""
    some, stages = next(iter(figures["gap"].values())), _stages(figures)
    rows = []
    for n, g in figures["gap"].items():
        cells = [number(g["floor"], 3), *(_left(g[k]) for k in stages)]
        rows.append([n, written(g["unit"]) or "–", *cells, percent(closed(g)), *_scores(figures, n)])
    head = ["Signal", "Unit", "Floor", *stages.values(), "Closed", "RMSE", "FIT", "ISO/TS 18571"]
    by_source: dict[str, list[str]] = {}
    for n, g in figures["gap"].items():
        by_source.setdefault(g["floor_source"], []).append(n)
    sources = [f"{source} ({listed(names)})" for source, names in by_source.items()]
    return (
        f"<p>Error above the floor, √(rmse² − floor²), on recordings that nothing was fitted to, "
        f"{number(some['horizon_s'], 3)} s ahead on average. RMSE, FIT and rating: as it came → after. "
        f"Floors: {escape('; '.join(sources))}.</p>{shell.table(head, rows)}"
    )


def _left(value: float | None, unit: str = "") -> str:
    """A gap; what is not above the floor is said so."""
    return "at the floor" if value == 0.0 else with_unit(number(value, 3), unit)


def _scores(figures: Figures, name: str) -> list[str]:
    s = figures.get("scores", {}).get(name)
    if not s:
        return ["–", "–", "–"]
    pairs = [(s[k]["nominal"], s[k]["after"]) for k in ("rmse", "fit_percent", "iso18571")]
    forms = (lambda v: number(v, 3), lambda v: f"{v:.1f} %".replace("-", "−"), lambda v: f"{v:.2f}")
    return [
        " → ".join("–" if v is None else form(v) for v in pair)
        for pair, form in zip(pairs, forms, strict=True)
    ]


def by_regime(figures: Figures) -> str:
    """The gaps again, regime by regime."""
    stages = _stages(figures)
    rows = [
        [row["regime"], n, percent(g["time"]), *(_left(g[k], g["unit"]) for k in stages)]
        for row in figures.get("gap_by_regime", [])
        for n, g in row["gap"].items()
    ]
    if not rows:
        return ""
    head = ["Regime", "Signal", "Part of the time", *stages.values()]
    return f"<h3>By regime</h3>{shell.table(head, rows)}"


def where(figures: Figures) -> str:
    """Where the model without effects and the recordings disagree."""
    whose = "re-estimated model" if _fitted(figures) else "model"
    if not figures["where"]:
        return f"<p>Nothing of the {whose}'s disagreement stands above the noise.</p>"
    rows = [
        [
            w["signal"], w["subsystem"], w["regime"], percent(w["share"]), percent(w.get("time")),
            w.get("quantity", ""), w.get("goes_with") or "nothing in particular",
        ]
        for w in figures["where"]
    ]  # fmt: skip
    head = ["Signal", "Subsystem", "Regime", "Share of the gap", "Part of the time", "Seen in", "Goes with"]
    return (
        f"<p>Of the {whose}, nothing added to it. A regime is named where the "
        f"disagreement gathers beyond what chance would make of it.</p>{shell.table(head, rows)}"
    )


def parameters(figures: Figures) -> str:
    """Parameters that were re-estimated, and what was found about each recording."""
    moved = figures["reestimated"]
    rows = [
        [
            n, with_unit(number(p["old"]), p["unit"]),
            with_unit(number_with_error(p["new"], p["ci95"]), p["unit"]), _interval(p["ci95"], p["unit"]),
            f"{100 * (p['new'] / p['old'] - 1):+.1f} %".replace("-", "−") if p["old"] else "–",
        ]
        for n, p in moved.items()
    ]  # fmt: skip
    text = f"<p>{_unmoved(figures)}</p>"
    if rows:
        text = shell.table(["Parameter", "Old", "New", "95 % interval", "Change"], rows)
    return f"<h2>Re-estimated parameters</h2>{text}{_nuisances(figures['nuisances'])}"


def _unmoved(figures: Figures) -> str:
    """Why no parameter has a new value."""
    if not _fitted(figures):
        return "None was fitted: no parameter of the model shows in the recorded outputs."
    fitted = f" Fitted: {listed(figures['fitted'])}." if figures.get("fitted") else ""
    return escape(f"None of the model's own parameters had to change.{fitted}")


def _nuisances(nuisances: Figures) -> str:
    rows = [
        [run, _spaced(str(k)), listed([str(x) for x in v]) if isinstance(v, list) else str(v)]
        for run, n in nuisances.items()
        for k, v in n.items()
    ]
    return f"<h3>About the recordings</h3>{shell.table(['Run', 'What', 'Value'], rows)}" if rows else ""


def considered(figures: Figures) -> str:
    """What was fitted or looked at, and why it was turned down."""
    rows = []
    for c in figures.get("considered", []):
        names = listed(list(c.get("effects", [c.get("effect", "")])), "and") or "nothing added"
        more, sure = c.get("nats_below_answer"), c.get("probability")
        rows.append(
            [
                names,
                "–" if more is None else f"{more:.1f}".replace("-", "−"),
                percent(sure),
                c.get("because", ""),
            ]
        )
    if not rows:
        return ""
    head = ["Effects", "Evidence below the answer, nats", "Probability", "What became of it"]
    return f"<h2>What was considered</h2>{shell.table(head, rows)}"


def unidentifiable(figures: Figures) -> str:
    """Effects that could not be told, whatever they are, for lack of channels."""
    by_reason: dict[str, list[str]] = {}
    for line in figures.get("untold") or ():
        by_reason.setdefault(line["because"], []).append(line["effect"])
    if not by_reason:
        return ""
    rows = [[why, ", ".join(names)] for why, names in sorted(by_reason.items(), key=lambda r: -len(r[1]))]
    return f"<h3>What these recordings cannot tell</h3>{shell.table(['Because', 'Effects'], rows)}"


def steps(figures: Figures) -> str:
    """Outputs that are recorded in steps, and whether that is an effect."""
    rows = [
        [q["output"], *(_sized(q[k], q["unit"]) for k in ("step", "noise", "specified")), STEPS[q["verdict"]]]
        for q in figures.get("quantization") or ()
    ]
    if not rows:
        return ""
    head = ["Output", "Step", "Other noise", "Specified", "What it is"]
    return f"<h3>Outputs recorded in steps</h3>{shell.table(head, rows)}"


def _sized(value: float | None, unit: str) -> str:
    return "–" if value is None else with_unit(number(value, 3), unit)


def next_experiment(figures: Figures) -> str:
    """The experiment that would settle what is open."""
    wanted = figures["next_experiment"]
    if not wanted:
        return ""
    rows = [
        [_name(p.get("one")), _name(p.get("other")), number(p.get("predicted_margin"), 3)]
        for p in wanted.get("pairs", [])[:SHOWN_PAIRS]
    ]
    table = shell.table(["Candidate", "against", "Predicted margin"], rows) if rows else ""
    facts = [
        (label, wanted[k] if isinstance(wanted[k], str) else number(wanted[k]))
        for k, label in (
            ("input", "Input"),
            ("duration_s", "Duration [s]"),
            ("plan", "Plan"),
            ("table", "Table"),
        )
        if wanted.get("plan") and wanted.get(k)
    ]
    need = (
        f"<p class='soft'>A margin of {number(wanted['needed_margin'], 3)} is needed.</p>"
        if wanted.get("needed_margin")
        else ""
    )
    text = escape(str(wanted.get("sentence", "")))
    return (
        f"<h2>Next experiment</h2><p>{text}</p>{table}{need if rows else ''}"
        f"{shell.facts(facts) if facts else ''}"
    )


def driven(figures: Figures) -> str:
    """The experiment that was driven: predicted against achieved margins."""
    done = figures.get("experiment")
    if not done:
        return ""
    rows = [
        [
            _name(p["one"]), _name(p["other"]), number(p.get("predicted_margin"), 3),
            number(p.get("achieved_margin"), 3),
        ]
        for p in done["pairs"]
    ]  # fmt: skip
    head = ["Candidate", "against", "Predicted margin", "Achieved margin"]
    table = shell.table(head, rows) if rows else ""
    seen = [
        [p["name"], number(p["predicted_margin"], 3), number(p["achieved_margin"], 3)]
        for p in done.get("parameters", ())
    ]
    table += shell.table(["Parameter", *head[2:]], seen) if seen else ""
    turned = f"{_spaced(done['before'])} before, {_spaced(figures['verdict'])} after"
    return (
        f"<h2>The experiment that was driven</h2><p>{escape(turned)}. "
        f"{escape(str(done['proposal'].get('sentence', '')))}</p>{table}"
    )


def _spaced(verdict: str) -> str:
    return verdict.replace("_", " ")


def _name(value: Any) -> str:
    return listed([str(v) for v in value]) if isinstance(value, list) else str(value)


def measured(figures: Figures) -> str:
    """Parts of the data, seed, versions, time."""
    rows = [
        [part, ", ".join(sorted({b["run"] for b in blocks})), str(len(blocks)), f"{_seconds(blocks):.1f}"]
        for part, blocks in figures.get("data", {}).items()
    ]
    table = shell.table(["Part", "Runs", "Blocks", "Seconds"], rows) if rows else ""
    versions = ", ".join(f"{k} {v}" for k, v in figures.get("versions", {}).items())
    facts = [
        ("Seed", str(figures.get("seed"))),
        ("Versions", versions),
        ("Time", f"{number(figures.get('elapsed_s'), 3)} s"),
    ]
    return (
        "<h2>How it was measured</h2><p>Parameters are fitted to the part fit; confirm accepts or turns down "
        "an effect; holdout makes the figures of this page and nothing else. "
        "A prediction starts from the filtered state and runs by itself, without the missing force.</p>"
        f"{table}{shell.facts(facts)}"
    )


def _seconds(blocks: Sequence[Figures]) -> float:
    return sum(b["end_s"] - b["start_s"] for b in blocks)
