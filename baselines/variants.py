"""Gains of a variant of a controller, over those that it shares with its family: variants.toml.

A family (the six shapers) has one model and one file of parameters, whose gains are those of one of
them.  What `slewright tune` finds for another variant is kept beside this file, a table a variant.
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path

from specs import parameters
from specs.errors import InputError

PATH = Path(__file__).with_name("variants.toml")
HEAD = "# Gains of variants of a controller, by `slewright tune NAME`; units: its parameters.toml.\n"
HOW = "how"


def read(path: Path = PATH) -> dict[str, dict[str, float]]:
    """Gains by variant; {} if none has been tuned."""
    return {name: {k: v for k, v in table.items() if k != HOW} for name, table in _tables(path).items()}


def update(name: str, family: str, values: Mapping[str, float], how: str, path: Path = PATH) -> None:
    """Set the gains of variant `name`, checked against `family`'s parameters, and how they were found.

    Raises InputError, before anything is written, for a gain that the family does not have or may not have.
    """
    known = parameters.load(family)
    for gain, value in values.items():
        if gain not in known:
            raise InputError(f"baselines/{family}/parameters.toml has no parameter '{gain}'")
        known[gain].check(value)
    tables = {**_tables(path), name: {HOW: how, **values}}
    text = HEAD
    for variant, table in sorted(tables.items()):
        text += f"\n[{variant}]\n"
        text += "".join(f'{k} = "{v}"\n' if k == HOW else f"{k} = {float(v)!r}\n" for k, v in table.items())
    part = path.with_suffix(".part")
    part.write_text(text, encoding="utf-8")
    part.replace(path)


def _tables(path: Path) -> dict[str, dict]:
    return tomllib.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
