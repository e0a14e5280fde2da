"""What a first model says of the columns: what was guessed, what is not used and why; and its map."""

from collections.abc import Mapping, Sequence

from reconcile.start.columns import WANTED, Column, currents_out
from reconcile.start.templates import MOVES, TURNS

EXAMPLES = {"position": "deg", "velocity": "rpm", TURNS.noun: "N.m", MOVES.noun: "N"}
ROLES = {
    "input": "an input", "output": "an output", "other": "an output", "setpoint": "a wanted value",
    "position": "a position", "velocity": "a speed", "acceleration": "an acceleration",
}  # fmt: skip


def notes_on(columns: Sequence[Column], used: Mapping[str, Column], template: str) -> list[str]:
    """What is uncertain, and what was left out and why."""
    taken = [c.name for c in used.values()]
    notes = [f"{ours} is column {c.name!r}: {c.reason}" for ours, c in used.items() if "guess" in c.reason]
    notes += [f"column {c.name!r}: no unit found; map.toml asks for it" for c in used.values() if not c.unit]
    driven = any(c.role == "input" for c in used.values())
    left = [c for c in (columns if template == "chain" else currents_out(columns)) if c.name not in taken]
    return notes + [f"column {c.name!r} is not used: {_why(c, driven, template)}" for c in left]


def _why(column: Column, driven: bool, template: str) -> str:
    """Why a column is not used."""
    if column.constant and not driven and column.role in ("input", "setpoint"):
        return "it keeps one value, so it tells nothing; record from before it changes, and it is the input"
    if column.constant:
        return "it keeps one value"
    if not column.role:
        return "its name and unit tell no role"
    more = "; --template free takes every output" if column.role in ("output", "other") else ""
    return f"{column.reason}, so it may be {ROLES[column.role]}, which template {template} leaves out{more}"


def names_table(used: Mapping[str, Column]) -> str:
    """The text of map.toml."""
    lines = ["# Columns of the recording and what the model calls them: 'theirs' = 'ours [unit]'.",
             "# A minus turns the sign: 'theirs' = '-ours [unit]'.", "[names]"]  # fmt: skip
    for ours, c in used.items():
        as_a_place = ours == "command" and c.reason == WANTED
        example = EXAMPLES.get("position" if as_a_place else ours.rstrip("0123456789"))
        if not c.unit and example:
            lines.append(
                f"# FILL IN the unit of {c.name!r}, as in '{ours} [{example}]'; else it is the model's"
            )
        elif not c.unit:
            lines.append(
                f"# {c.name!r} has no unit: the model takes a number; write one here and in model.py"
            )
        unit = f" [{c.unit}]" if c.unit and not c.stated else ""
        theirs = c.name.replace("\\", "\\\\").replace('"', '\\"')
        lines.append(f'"{theirs}" = "{ours}{unit}"')
    return "\n".join([*lines, ""])
