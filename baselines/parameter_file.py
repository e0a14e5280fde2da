"""Writes found values back into parameter files, line by line: comments and order stay."""

from collections.abc import Mapping
from pathlib import Path

from specs import parameters
from specs.errors import InputError
from specs.schema import shown_path

DIGITS = 6  # significant; more would only show noise of the search


def update(
    name: str,
    values: Mapping[str, float],
    source: str,
    status: parameters.Status = "identified",
    folder: Path | None = None,
) -> Path:
    """Set value, source and status of parameters in the file `name` and return its path.

    `folder` is where the file lies, as NAME.toml (default: where specs.parameters has it).  Raises
    InputError, before anything is written, for a parameter that is not in the file or a value out of its
    bounds.
    """
    known = parameters.load(name)
    for parameter, value in values.items():
        if parameter not in known:
            raise InputError(f"{shown_path(parameters.path_of(name))} has no parameter '{parameter}'")
        known[parameter].check(value)
    path = folder / f"{name}.toml" if folder else parameters.path_of(name)
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join(_edited(lines, values, source, status)) + "\n", encoding="utf-8")
    return path


def _edited(lines: list[str], values: Mapping[str, float], source: str, status: str) -> list[str]:
    result, table = [], ""
    for line in lines:
        if line.startswith("["):
            table = line.strip("[] ")
        key = line.partition("=")[0].strip()
        if table in values and key in ("value", "source", "status"):
            value = repr(float(f"{values[table]:.{DIGITS}g}"))
            line = f"{key} = " + {"value": value, "source": f'"{source}"', "status": f'"{status}"'}[key]
        result.append(line)
    return result
