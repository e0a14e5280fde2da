"""Form of a record: columns with unit and description, and the file metadata, as Arrow schema metadata."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pyarrow as pa

from specs.errors import InputError

META_KEY = b"slewright"
FORMAT = 1  # raised when a reader of the old form could misread a new file


@dataclass(frozen=True)
class Column:
    """One recorded variable; `unit` as in specs/units.py."""

    name: str
    unit: str
    description: str


TIME = Column("time", "s", "Time since the start of the run: tick times step")


def resolve_columns(columns: Sequence[Column | str]) -> list[Column]:
    """Return the columns with unit and description; a name is looked up in specs/signals.toml.

    Raises InputError when the first column is not `time`, a name is unknown or a name comes twice.
    """
    resolved = [c if isinstance(c, Column) else _of_signal(c) for c in columns]
    names = [c.name for c in resolved]
    if not names or names[0] != TIME.name:
        raise InputError(f"a record's first column is 'time', not {names[0] if names else 'nothing'!r}")
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise InputError(f"a record has each column once; given twice: {', '.join(twice)}")
    return resolved


def _of_signal(name: str) -> Column:
    if name == TIME.name:
        return TIME
    from specs.signals import signal  # here, so that reading a record needs no signal list

    found = signal(name)
    return Column(found.name, found.unit, found.description)


def make_schema(columns: Sequence[Column], meta: Mapping[str, Any]) -> pa.Schema:
    """Return the Arrow schema (float64 columns) that carries units, descriptions and `meta`."""
    fields = [
        pa.field(
            c.name, pa.float64(), False, {b"unit": c.unit.encode(), b"description": c.description.encode()}
        )
        for c in columns
    ]
    return pa.schema(fields, metadata={META_KEY: encode_meta(meta)})


def encode_meta(meta: Mapping[str, Any]) -> bytes:
    """Return `meta` as JSON with sorted keys: the same content gives the same bytes."""
    whole = {**meta, "format": FORMAT}
    return json.dumps(
        whole, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False
    ).encode()


def decode_meta(schema: pa.Schema, path: object) -> dict[str, Any]:
    """Return the metadata of a record's schema; raise InputError naming `path` when it is none of ours."""
    try:
        meta = json.loads((schema.metadata or {})[META_KEY])
        known = meta["format"] <= FORMAT
    except (KeyError, ValueError, TypeError):
        raise InputError(f"{path} is not a run record: it carries no 'slewright' metadata") from None
    if not known:
        raise InputError(f"{path} has record format {meta['format']}; this version reads up to {FORMAT}")
    return meta


def columns_of(schema: pa.Schema) -> list[Column]:
    """Return the columns of a record's schema."""
    return [Column(f.name, _text(f, b"unit"), _text(f, b"description")) for f in schema]


def _text(field: pa.Field, key: bytes) -> str:
    return (field.metadata or {}).get(key, b"").decode()
