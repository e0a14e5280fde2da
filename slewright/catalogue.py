"""The catalogue of effects as a table."""

from collections.abc import Sequence

from reconcile import quantization
from reconcile.catalogue import ALL
from reconcile.catalogue.effect import Parameter

HEADINGS = ("effect", "place", "equation", "parameters", "source")
UNITS = {"f": "F", "v": "v", "q": "q", "u": "u", "y": "y", "other": "y₂", "inertia": "J"}


# Told by the lattice that recorded values lie on, not by a fit.
QUANTIZATION = {
    "effect": quantization.NAME,
    "place": "output",
    "equation": "y' = step round(y/step)",
    "parameters": "step [y]",
    "source": "Widrow and Kollar, Quantization Noise, Cambridge 2008, ch. 1",
    "bounds": "step > 0",
    "limits": "",
}


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
            "bounds": ", ".join(f"{p.name} {_sign(p)}" for p in e.parameters),
            "limits": "; ".join(f"{name} where {where}" for name, where in e.becomes.items()),
        }
        for e in ALL
    ] + [QUANTIZATION]


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
    return len({e.name for e in ALL}) + 1


def _sign(parameter: Parameter) -> str:
    return "of either sign" if parameter.low == -float("inf") else f"≥ {parameter.low:g}"


def _unit(template: str) -> str:
    return template.format_map(_Symbols(UNITS)) or "1"
