"""The catalogue of effects as a table, and as a page of docs/reference."""

from reconcile.catalogue import ALL
from reconcile.catalogue.effect import Parameter
from reconcile.judging import quantization
from specs import markdown

PAGE = """The physical effects that `slewright reconcile` can name, where they act and where their
equations are from. Units: u an input, y an output, v and q speed and position of an axis, F its force or
torque, J its inertia. {names} names in {forms} forms."""
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


def page() -> str:
    """The catalogue of effects, place by place."""
    entries = rows()
    about = PAGE.format(names=names(), forms=len(entries))
    text = [markdown.head("Effects", "reconcile/catalogue", about)]
    columns = ("effect", "equation", "parameters", "bounds", "limits", "source")
    for place in dict.fromkeys(row["place"] for row in entries):
        found = [_effect(row, columns) for row in entries if row["place"] == place]
        text += [f"## {place}\n", markdown.table(columns, found)]
    return "\n".join(text)


def _effect(row: dict[str, str], columns: tuple[str, ...]) -> list[str]:
    return [f"`{row[c]}`" if c == "effect" else row[c] for c in columns]


def names() -> int:
    """How many different effects there are."""
    return len({e.name for e in ALL}) + 1


def _sign(parameter: Parameter) -> str:
    return "of either sign" if parameter.low == -float("inf") else f"≥ {parameter.low:g}"


def _unit(template: str) -> str:
    return template.format_map(_Symbols(UNITS)) or "1"
