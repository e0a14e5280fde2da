"""The report page: one HTML file that needs neither network nor server."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from records.metrics import Verdict
from records.report import curves, response, shell, tables, views
from records.report.figures import Figure, Pair
from records.results import Results, Runs, accepted, evaluate
from specs.faults import read_faults

METRICS = (
    "A new target every 15 s. Speed: slew angle between targets over the time to enter and stay within 3° "
    "of the target; a target never reached counts with its 15 s. Overshoot: largest slew angle past the "
    "target, mean over the targets. Error: distance of the tool to the target over the last second. Tool: "
    "mean angular speed of the tool. All are computed from true states of the simulation. The reference "
    "machine is simulated too: no measurement of a real machine is in this report."
)
PAPER = (
    "Measured on the real machine by Spinelli et al. (Reinforcement Learning Control for Autonomous "
    "Hydraulic Material Handling Machines with Underactuated Tools), with other targets: orders of "
    "magnitude, not a like-for-like comparison."
)
RESPONSE = (
    "How the nominal model, in which controllers are made, compares with the simulated reference machine: "
    "the arm behind its velocity controller, and the tool left to swing."
)


@dataclass(frozen=True)
class Context:
    """What the report says about the runs as a whole."""

    title: str = "Verification"
    controller: str = ""
    plant: str = ""  # that stands where the nominal system's slew drive is
    command: str = ""  # that makes the report again
    seed: int | None = None
    realtime_factor: Mapping[str, float] = field(default_factory=dict)  # system → simulated s / elapsed s
    versions: Mapping[str, str] = field(default_factory=dict)
    notes: Sequence[str] = ()  # sentences under the results
    beside: Mapping[str, tuple[Results, Sequence[Verdict]]] = field(default_factory=dict)  # by controller
    comparison: Sequence[str] = ()  # a sentence for each controller beside it
    response: Pair | None = None  # a run for the arm and tool response; else the first scenario's is shown


def write_report(
    path: Path | str, runs: Runs, verdicts: Sequence[Verdict], context: Context | None = None
) -> Path:
    """Write the report of `runs` (scenario → system → record) as one HTML file of about 6 MB.

    Returns its path. The same runs, verdicts and context give the same bytes. Raises InputError when a record
    lacks what the metrics need, OSError when the file cannot be written.
    """
    return shell.write_whole(path, render(runs, verdicts, context or Context()))


def render(runs: Runs, verdicts: Sequence[Verdict], context: Context) -> str:
    """Return the page as HTML."""
    results = evaluate(runs)
    drawn: list[Figure] = []
    body = [
        _head(verdicts, context),
        _results(results, verdicts, context),
        *(_beside(name, *found) for name, found in context.beside.items()),
        _paper(),
        _response(runs, context, drawn),
        *(_scenario(name, pair, results, drawn) for name, pair in runs.items()),
        _limits(verdicts),
        _foot(context),
    ]
    return shell.document(context.title, body, drawn)


def _head(verdicts: Sequence[Verdict], context: Context) -> str:
    good = accepted(verdicts)
    missed = [v for v in verdicts if not v.passed]
    if not verdicts:
        word, tone = "No limits were checked", "none"
    elif good:
        word, tone = f"Accepted: all {len(verdicts)} limits met", "good"
    else:
        word, tone = f"Not accepted: {len(missed)} of {len(verdicts)} limits missed", "bad"
    items = "".join(f"<li title='{escape(v.reason)}'>{escape(tables.in_words(v))}</li>" for v in missed)
    return (
        f"<header><h1>Slewright · {escape(context.title)}</h1><p class='verdict {tone}'>{word}</p>"
        f"{f'<ul class=misses>{items}</ul>' if items else ''}{shell.facts(_facts(context))}</header>"
    )


def _facts(context: Context) -> list[tuple[str, str]]:
    facts = [("Controller", context.controller)] if context.controller else []
    facts += [("Plant", context.plant)] if context.plant else []
    for system, factor in context.realtime_factor.items():
        facts.append((f"{system.capitalize()} simulation", f"{factor:.0f} × real time"))
    if context.seed is not None:
        facts.append(("Seed", str(context.seed)))
    return facts + ([("Command", context.command)] if context.command else [])


def _results(results: Results, verdicts: Sequence[Verdict], context: Context) -> str:
    links = "".join(f"<a href='#{escape(n)}'>{escape(tables.readable(n))}</a>" for n in results)
    notes = "".join(f"<p class='soft'>{escape(note)}</p>" for note in context.notes)
    said = "".join(f"<p>{escape(sentence)}</p>" for sentence in context.comparison)
    return (
        f"<nav>{links}<a href='#limits'>Limits</a></nav><h2 class='stay' id='results'>Results</h2>"
        f"{said}<p class='soft'>{METRICS}</p>"
        f"<div class='scroll'>{tables.results(results, verdicts)}</div>{notes}"
    )


def _beside(name: str, results: Results, verdicts: Sequence[Verdict]) -> str:
    """The results of a controller for comparison, held to the same limits."""
    missed = sum(not v.passed for v in verdicts)
    word = f"not accepted: {missed} of {len(verdicts)} limits missed" if missed else "all limits met"
    return (
        f"<h3 style='margin-top:28px'>For comparison: {escape(name)} ({word})</h3>"
        f"<div class='scroll'>{tables.results(results, verdicts)}</div>"
    )


def _paper() -> str:
    return (
        "<h3 style='margin-top:28px'>The paper's results, for context</h3>"
        f"<p class='soft'>{PAPER}</p><div class='scroll'>{tables.paper()}</div>"
    )


def _response(runs: Runs, context: Context, drawn: list[Figure]) -> str:
    name = next(iter(runs), "")
    pair = _drawable(context.response or runs.get(name, {}))
    made = response.figures(pair, "a test of the arm" if context.response else tables.readable(name))
    if not made:
        return ""
    drawn += made
    return (
        f"<h2 id='response'>Arm and tool response</h2><p class='soft'>{RESPONSE}</p>"
        f"<div class='figures'>{''.join(map(shell.place, made))}</div>"
    )


def _scenario(name: str, pair: Pair, results: Results, drawn: list[Figure]) -> str:
    shown = _drawable(pair)
    made = [*views.figures(name, shown), *curves.figures(name, shown)]
    drawn += made
    broken = "".join(
        f"<p class='incomplete'>Incomplete run on the {escape(system)} system: {escape(record.reason)}</p>"
        for system, record in pair.items()
        if not record.complete
    )
    load = next((r.meta["load_kg"] for r in pair.values() if r.meta.get("load_kg") is not None), None)
    said = f"<p class='soft'>Load in the grab: {load:.0f} kg.</p>" if load is not None else ""
    said += "".join(f"<p class='incomplete'>{escape(line)}</p>" for line in _provoked(pair))
    return (
        f"<h2 id='{escape(name)}'>{escape(tables.readable(name))}</h2>{said}{broken}"
        f"<div class='scroll'>{tables.per_target(results[name])}</div>"
        f"<div class='figures'>{''.join(map(shell.place, made))}</div>"
    )


def _provoked(pair: Pair) -> list[str]:
    """What the scenario did to its runs beside driving them, each in words: faults, changed parameters."""
    meta = next((record.meta for record in pair.values()), {})
    found = [f"Fault: {fault}" for fault in read_faults(meta.get("faults", []), "record: faults")]
    for tick, values in sorted(meta.get("changes", {}).items(), key=lambda item: int(item[0])):
        since = f"from {int(tick) * meta['step_s']:g} s on"
        found += [f"Parameter: {name} = {value} {since}" for name, value in values.items()]
    return found


def _drawable(pair: Pair) -> Pair:
    """Leave out runs that broke off before there was anything to draw."""
    return {system: record for system, record in pair.items() if len(record) > 1}


def _limits(verdicts: Sequence[Verdict]) -> str:
    if not verdicts:
        return ""
    return f"<h2 id='limits'>Limits and their reasons</h2><div class='scroll'>{tables.limits(verdicts)}</div>"


def _foot(context: Context) -> str:
    versions = ", ".join(f"{name} {version}" for name, version in sorted(context.versions.items()))
    return (
        "<footer>Plots show about ten rows a second; metrics use every row."
        f"{f' Made with {escape(versions)}.' if versions else ''}"
        "<noscript> The plots need JavaScript; the tables do not.</noscript></footer>"
    )
