"""Writes the results of a verification into the README: the table between its markers, and the picture."""

from pathlib import Path

from records import results
from records.compared import SHOWN
from records.report import markers
from records.report.picture import write_picture
from records.report.tables import readable
from verification.verify import Outcome, Verification

PICTURE = Path("docs/run.svg")  # beside the README
LOOP_S = 12.0  # in which the picture plays the run


def fill(readme: Path, outcome: Outcome, command: str) -> None:
    """Put the table between the markers of `readme`, and draw the first scenario of all controllers.

    Raises InputError if the markers are missing.
    """
    markers.fill(readme, "results", table(outcome, command))
    scenario, pair = next(iter(outcome.own.runs.items()))
    system = list(pair)[-1]
    drawn = {v.controller: v.runs[scenario][system] for v in (outcome.own, *outcome.beside)}
    title = f"{readable(scenario)}, {results.SYSTEM_NAMES[system]}"
    write_picture(readme.parent / PICTURE, drawn, title, loop_s=LOOP_S)


def table(outcome: Outcome, command: str) -> str:
    """The results as a Markdown table with the command that makes it."""
    headings = [*(f"{name} [{unit}]" for _, name, unit, _, _ in SHOWN), "targets missed", ""]
    lines = [
        f"`{command}` makes this table. The reference machine is simulated, and with it every figure here.",
        "",
        "| system | controller | " + " | ".join(headings) + " |",
        "|---|---|" + "--:|" * (len(headings) - 1) + "---|",
    ]
    for system in next(iter(outcome.own.runs.values())):
        for v in (outcome.own, *outcome.beside):
            lines.append(f"| {results.SYSTEM_NAMES[system]} | {v.controller} | {_cells(v, system)} |")
    return "\n".join([*lines, "", *outcome.comparison]) + "\n"


def _cells(v: Verification, system: str) -> str:
    found = v.on(system)
    figures = [format(getattr(found, key), form) for key, _, _, form, _ in SHOWN]
    missed = [verdict for verdict in v.verdicts if verdict.system == system and not verdict.passed]
    word = f"not accepted: {len(missed)} limits missed" if missed else "accepted"
    return " | ".join([*figures, f"{found.missed} of {found.targets}", word])
