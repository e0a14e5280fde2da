"""Form of a record: columns with type, unit and description, and the file metadata, as Arrow schema metadata.

Rows arrive as cells of 8 bytes, a float64 matrix: a column of whole numbers or Booleans holds the bits of an
int64 (uint64: of a uint64) in it.  Strings and binaries have no cell, so they are not recorded.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from specs.errors import InputError
from specs.signals import signal

META_KEY = b"slewright"
FORMAT = 1  # raised when a reader of the old form could misread a new file


# Column type -> how Arrow stores it, and as what its cells are read.
TYPES: dict[str, tuple[pa.DataType, type]] = {
    "float64": (pa.float64(), np.float64),
    "int64": (pa.int64(), np.int64),
    "uint64": (pa.uint64(), np.uint64),
    "bool": (pa.bool_(), np.int64),
}


@dataclass(frozen=True)
class Column:
    """One recorded variable; `unit` as in specs/units.py, `type` one of TYPES."""

    name: str
    unit: str
    description: str
    type: str = "float64"


TIME = Column("time", "s", "Time since the start of the run: tick times step")


def resolve_columns(columns: Sequence[Column | str]) -> list[Column]:
    """Return the columns with unit and description; a name is looked up in specs/signals.toml.

    Raises InputError when the first column is not `time`, a name is unknown or comes twice, or a type cannot
    be recorded.
    """
    resolved = [c if isinstance(c, Column) else _of_signal(c) for c in columns]
    names = [c.name for c in resolved]
    if not names or names[0] != TIME.name:
        raise InputError(f"a record's first column is 'time', not {names[0] if names else 'nothing'!r}")
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise InputError(f"a record has each column once; given twice: {', '.join(twice)}")
    for column in resolved:
        if column.type not in TYPES:
            raise InputError(
                f"column {column.name} of type {column.type} cannot be recorded; valid: {', '.join(TYPES)}"
            )
    return resolved


def _of_signal(name: str) -> Column:
    if name == TIME.name:
        return TIME
    found = signal(name)
    return Column(found.name, found.unit, found.description)


def make_schema(columns: Sequence[Column], meta: Mapping[str, Any]) -> pa.Schema:
    """Return the Arrow schema that carries units, descriptions and `meta`."""
    fields = [
        pa.field(
            c.name,
            TYPES[c.type][0],
            False,
            {b"unit": c.unit.encode(), b"description": c.description.encode()},
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
    """Return the columns of a record's schema; of a type that is none of TYPES, Arrow's name of it."""
    names = {arrow: name for name, (arrow, _) in TYPES.items()}
    return [
        Column(f.name, _text(f, b"unit"), _text(f, b"description"), names.get(f.type, str(f.type)))
        for f in schema
    ]


def arrays(columns: Sequence[Column], cells: np.ndarray, rows: slice = slice(None)) -> list[pa.Array]:
    """Arrow arrays of the `rows` of cells [columns, n], C-contiguous; numbers are not copied.

    Here and in `values` pyarrow's own conversions are avoided, which import pandas: a second of a process.
    """
    whole = pa.py_buffer(cells)
    first, stop, _ = rows.indices(cells.shape[1])
    width = cells.shape[1] * cells.itemsize
    n, size, offset = stop - first, (stop - first) * cells.itemsize, first * cells.itemsize
    made = []
    for i, column in enumerate(columns):
        if column.type == "bool":
            bits = np.packbits(cells[i, first:stop].view(np.int64) != 0, bitorder="little")
            made.append(pa.Array.from_buffers(pa.bool_(), n, [None, pa.py_buffer(bits)]))
        else:
            part = whole.slice(i * width + offset, size)
            made.append(pa.Array.from_buffers(TYPES[column.type][0], n, [None, part]))
    return made


def _text(field: pa.Field, key: bytes) -> str:
    return (field.metadata or {}).get(key, b"").decode()


def values(column: pa.ChunkedArray) -> np.ndarray:
    """The values of a table's column, shape (n,), read-only and not copied where they lie in one piece."""
    parts = [_part(chunk) for chunk in column.chunks]
    made = parts[0] if len(parts) == 1 else np.concatenate(parts or [_part(pa.array([], column.type))])
    made.flags.writeable = False
    return made


def _part(chunk: pa.Array) -> np.ndarray:
    if pa.types.is_boolean(chunk.type):
        return np.from_dlpack(chunk.cast(pa.uint8())).astype(bool)
    if pa.types.is_primitive(chunk.type) and not chunk.null_count:
        return np.from_dlpack(chunk)
    return chunk.to_numpy(zero_copy_only=False)  # of a file that is not ours
