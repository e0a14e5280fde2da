"""Reading the specs' TOML files: every mistake becomes one InputError that names file and key."""

import tomllib
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from types import NoneType
from typing import Any, TypeVar, get_args, get_type_hints

from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic_core import SchemaValidator

from specs.errors import InputError, nearest

ROOT = Path(__file__).parent
STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)

PLAIN = ("int", "float", "bool", "str")
UNKNOWN = ("unexpected_keyword_argument", "extra_forbidden")  # pydantic's types of it

T = TypeVar("T")


def read_toml(path: Path) -> dict[str, Any]:
    """Parse a TOML file; raises InputError naming the file if it is missing or malformed.

    A text with a NUL in it is malformed, too: no name, path or host has one.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{shown_path(path)}: cannot be read ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{shown_path(path)}: not valid TOML: {error}") from error
    if "\0" in _texts(data):
        raise InputError(f"{shown_path(path)}: a text with a NUL character (\\u0000) in it")
    return data


def _texts(data: Any) -> str:
    """All keys and texts of parsed data, one after the other."""
    if isinstance(data, dict):
        return "".join(f"{key}{_texts(value)}" for key, value in data.items())
    if isinstance(data, list):
        return "".join(map(_texts, data))
    return data if isinstance(data, str) else ""


def validate(kind: type[T], data: Any, where: str, texts: bool = False) -> T:
    """Build the frozen dataclass `kind` from plain data; `where` ("file: key") starts every message.

    A number in quotes, a truth value for a number or 2.0 for a whole one is none; so is a number for a text.
    With `texts`, all values are texts, as in XML, and say their number.
    A class's own checks may raise InputError in `__post_init__` without knowing where they are.
    """
    try:
        return _validator(kind, texts).validate_python(data)
    except ValidationError as error:
        raise InputError(_sentence(error, where, kind)) from error
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def shown_path(path: Path) -> str:
    """The path as a reader of the repository writes it: from its root on, else as it is."""
    top = ROOT.parent
    return path.relative_to(top).as_posix() if path.is_relative_to(top) else str(path)


@cache
def _validator(kind: Any, texts: bool) -> SchemaValidator:
    """That of `kind`, with plain values taken as they are; lists and texts still become tuples and paths."""
    schema = TypeAdapter(kind).core_schema
    return SchemaValidator(schema if texts else _strict(schema))


def _strict(schema: Any) -> Any:
    if isinstance(schema, list | tuple):
        return type(schema)(map(_strict, schema))
    if not isinstance(schema, dict):
        return schema
    # the keys of a TOML table are texts, whatever they stand for
    found = {k: v if k == "keys_schema" else _strict(v) for k, v in schema.items()}
    return {**found, "strict": True} if found.get("type") in PLAIN else found


def _sentence(error: ValidationError, where: str, kind: Any) -> str:
    """Two faults in one line, unknown keys first: what was expected, where, and what stood there."""
    faults = []
    for fault in sorted(error.errors(include_url=False), key=lambda f: f["type"] not in UNKNOWN)[:2]:
        key = ".".join(str(part) for part in fault["loc"])
        if fault["type"] == "missing":
            faults.append(f"missing {key}")
        elif fault["type"] in UNKNOWN:
            *place, wrong = fault["loc"]
            keys = _keys(kind, place)
            faults.append(f"unknown key {key}" + (f" ({nearest(str(wrong), keys)})" if keys else ""))
        else:
            faults.append(f"{key}: {fault['msg']} (is {fault['input']!r})" if key else str(fault["msg"]))
    return f"{where}: " + "; ".join(faults)


def _keys(kind: Any, place: Sequence[int | str]) -> list[str]:
    """The keys that a table at `place` in the data may have; none where that cannot be told."""
    for part in place:
        if is_dataclass(kind):
            kind = get_type_hints(kind).get(str(part))
        else:  # an element of a list, or an entry of a table of tables
            kind = next(iter(get_args(kind)[-1:] if isinstance(part, str) else get_args(kind)), None)
        kind = (
            next((one for one in get_args(kind) if is_dataclass(one)), kind)
            if NoneType in get_args(kind)
            else kind
        )
    return [f.name for f in fields(kind) if f.init] if is_dataclass(kind) else []
