"""Writes the results of a verification into the README: the table between its markers, and the picture."""

from pathlib import Path

from records import results
from records.metrics import Metrics
from records.report import markers
from records.report.picture import write_picture
from records.report.tables import readable
from verification.verify import Verification

PICTURE = Path("docs/run.svg")  # beside the README


def fill(readme: Path, verification: Verification, command: str) -> None:
    """Put the table between the markers of `readme`, and draw the picture of the first scenario.

    Raises InputError if the markers are missing.
    """
    markers.fill(readme, "results", table(verification, command))
    scenario, pair = next(iter(verification.runs.items()))
    write_picture(readme.parent / PICTURE, pair, f"{readable(scenario)}, PI controller")


def table(verification: Verification, command: str) -> str:
    """The results as a Markdown table with the command that makes it."""
    headings = [f"{heading} [{unit}]" if unit else heading for _, heading, unit, _ in results.COLUMNS]
    lines = [
        f"`{command}` makes this table. The reference machine is simulated, and with it every figure here.",
        "",
        "| scenario | system | " + " | ".join(headings) + " |",
        "|---|---|" + "--:|" * len(headings),
    ]
    for scenario, pair in results.evaluate(verification.runs).items():
        for system, found in pair.items():
            lines.append(f"| {readable(scenario)} | {results.SYSTEM_NAMES[system]} | {_cells(found)} |")
    return "\n".join(lines) + "\n"


def _cells(metrics: Metrics) -> str:
    return " | ".join(results.number(getattr(metrics, name), form) for name, _, _, form in results.COLUMNS)
