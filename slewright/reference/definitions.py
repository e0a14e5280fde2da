"""The pages about signals, parameters, effects and file formats, from specs, reconcile and records."""

import ast
from pathlib import Path

from records import formats
from slewright import catalogue
from slewright.reference import markdown
from specs import parameters as parameter_files, tables

PARAMETERS = """Every constant of the machine, the models and the controllers. Values are in SI units.
*Status* says how sure a value is: `datasheet`, `measured`, `identified` (fitted or tuned) or `assumed`.
*vr* is the FMI value reference, which is never used again for another parameter."""
EFFECTS = """The physical effects that `slewright reconcile` can name, where they act and where their
equations are from. Units: u an input, y an output, v and q speed and position of an axis, F its force or
torque, J its inertia. {names} names in {forms} forms."""
FORMATS = """What `slewright convert` reads and writes, by the ending of the file's name. What is mended
and what is refused: [recordings](recordings.md). Our own Parquet files: [run records](records.md). System
descriptions: [SSP](ssp.md). Scenarios: [scenario files](scenarios.md)."""


def signals() -> str:
    """Every signal, kind by kind."""
    return tables.signals_markdown()


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


def effects() -> str:
    """The catalogue of effects, place by place."""
    rows = catalogue.rows()
    about = EFFECTS.format(names=catalogue.names(), forms=len(rows))
    text = [markdown.head("Effects", "reconcile/catalogue", about)]
    columns = ("effect", "equation", "parameters", "bounds", "limits", "source")
    for place in dict.fromkeys(row["place"] for row in rows):
        found = [_effect(row, columns) for row in rows if row["place"] == place]
        text += [f"## {place}\n", markdown.table(columns, found)]
    return "\n".join(text)


def _effect(row: dict[str, str], columns: tuple[str, ...]) -> list[str]:
    return [f"`{row[c]}`" if c == "effect" else row[c] for c in columns]


def file_formats() -> str:
    """Endings, what they are, and whether they are read or written."""
    rows = [
        (
            f"`{suffix}`",
            _module_says(module),
            _mark(suffix, formats.WRITE_ONLY),
            _mark(suffix, formats.READ_ONLY),
        )
        for suffix, module in formats.FORMATS.items()
    ]
    head = markdown.head("File formats", "records/formats", FORMATS)
    return "\n".join([head, markdown.table(["ending", "what it is", "read", "written"], rows)])


def _mark(suffix: str, without: tuple[str, ...]) -> str:
    return "" if suffix in without else "yes"


def _module_says(module: str) -> str:
    """The first paragraph of the module that reads the format, which is not imported: some need packages."""
    source = Path(formats.__file__).with_name(f"{module}.py").read_text(encoding="utf-8")
    return (ast.get_docstring(ast.parse(source)) or "").split("\n\n")[0]
