"""The page about parameters in docs/reference; that about signals is in `specs/tables.py`."""

from specs import markdown, parameters as parameter_files

PARAMETERS = """Every constant of the machine, the models and the controllers. Values are in SI units.
*Status* says how sure a value is: `datasheet`, `measured`, `identified` (fitted or tuned) or `assumed`.
*vr* is the FMI value reference, which is never used again for another parameter."""


def parameters() -> str:
    """Every parameter, file by file."""
    source = "specs/parameters/*.toml and baselines/*/parameters.toml"
    text = [markdown.head("Parameters", source, PARAMETERS)]
    headings = ["name", "value", "unit", "range", "meaning", "status", "source", "vr"]
    for name in parameter_files.files():
        rows = [
            (
                f"`{p.name}`",
                markdown.number(p.value),
                p.unit,
                _range(p),
                p.description,
                p.status,
                p.source,
                p.vr,
            )
            for p in parameter_files.load(name).values()
        ]
        text += [f"## {name}\n", markdown.table(headings, rows)]
    return "\n".join(text)


def _range(parameter: parameter_files.Parameter) -> str:
    low, high = markdown.number(parameter.min), markdown.number(parameter.max)
    return f"{low} … {high}" if low or high else ""
