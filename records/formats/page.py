"""The page about file formats in docs/reference."""

import ast
from pathlib import Path

from records import formats
from specs import markdown

PAGE = """What `slewright convert` reads and writes, by the ending of the file's name. What is mended
and what is refused: [recordings](recordings.md). Our own Parquet files: [run records](records.md). System
descriptions: [SSP](ssp.md). Scenarios: [scenario files](scenarios.md)."""


def page() -> str:
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
    head = markdown.head("File formats", "records/formats", PAGE)
    return "\n".join([head, markdown.table(["ending", "what it is", "read", "written"], rows)])


def _mark(suffix: str, without: tuple[str, ...]) -> str:
    return "" if suffix in without else "yes"


def _module_says(module: str) -> str:
    """The first paragraph of the module that reads the format, which is not imported: some need packages."""
    source = Path(formats.__file__).with_name(f"{module}.py").read_text(encoding="utf-8")
    return (ast.get_docstring(ast.parse(source)) or "").split("\n\n")[0]
