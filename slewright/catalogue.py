"""The catalogue of effects as a table."""

from collections.abc import Sequence

from reconcile.catalogue import ALL

HEADINGS = ("effect", "place", "equation", "parameters", "source")
UNITS = {"f": "F", "v": "v", "q": "q", "u": "u", "y": "y", "other": "y₂", "inertia": "J"}


class _Symbols(dict):
    def __missing__(self, key: str) -> str:
        return key


def rows() -> list[dict[str, str]]:
    """Every entry, in the catalogue's order: HEADINGS -> text; units by what is at the port (`[F]`)."""
    return [
        {
            "effect": e.name + (f" ({e.form.replace('_', ' ')})" if e.form else ""),
            "place": e.place,
            "equation": e.equation,
            "parameters": ", ".join(f"{p.name} [{_unit(p.unit)}]" for p in e.parameters),
            "source": e.source,
        }
        for e in ALL
    ]


def table(entries: Sequence[dict[str, str]]) -> str:
    """The rows as a Markdown table, with the command that makes it."""
    lines = [
        f"`slewright effects --markdown FILE` makes this table: {names()} names in {len(entries)} forms.",
        "",
        "| " + " | ".join(HEADINGS) + " |",
        "|" + "---|" * len(HEADINGS),
    ]
    for entry in entries:
        cells = [entry[h].replace("|", "\\|") for h in HEADINGS]
        lines.append(f"| `{cells[0]}` | " + " | ".join(cells[1:]) + " |")
    return "\n".join(lines) + "\n"


def names() -> int:
    """How many different effects there are."""
    return len({e.name for e in ALL})


def _unit(template: str) -> str:
    return template.format_map(_Symbols(UNITS)) or "1"
