"""The run hash: what was run and what came of it, in 64 hexadecimal digits.

SHA-256 over columns (name, type, unit), metadata, number of rows, and the SHA-256 of each column's values in
order: eight bytes each, little end first (Booleans as int64). So it depends neither on compression nor on
how the rows were appended nor on the machine. Left out of it: the descriptions of columns, and of the
metadata what LEFT_OUT names.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from records.schema import Column, columns_of, values

RUN_HASH = "run_hash"
MEASURED = "measured"  # metadata of clocks: how long it took, how late it was
LEFT_OUT = (RUN_HASH, MEASURED, "format")


class Hasher:
    """Takes rows as they come, column by column."""

    def __init__(self, columns: Sequence[Column]) -> None:
        self._columns = columns
        self._digests = [hashlib.sha256() for _ in columns]
        self._rows = 0

    def update(self, cells: np.ndarray) -> None:
        """More rows as cells [columns, n]; each column contiguous."""
        self._rows += cells.shape[1]
        for digest, column in zip(self._digests, cells, strict=True):
            digest.update(_bytes(column))

    def update_column(self, number: int, column: np.ndarray) -> None:
        """More of one column; rows are counted with the first."""
        self._rows += len(column) if number == 0 else 0
        self._digests[number].update(_bytes(column))

    def finish(self, meta: Mapping[str, Any]) -> str:
        """The hash of what was taken, run as `meta` says."""
        head = {
            "columns": [[c.name, c.type, c.unit] for c in self._columns],
            "meta": {key: value for key, value in meta.items() if key not in LEFT_OUT},
            "rows": self._rows,
        }
        text = json.dumps(head, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
        whole = hashlib.sha256(text.encode())
        for digest in self._digests:
            whole.update(digest.digest())
        return whole.hexdigest()


def hash_of(table: pa.Table, meta: Mapping[str, Any]) -> str:
    """The run hash of a record's table and metadata, computed anew."""
    hasher = Hasher(columns_of(table.schema))
    for number, column in enumerate(table.columns):
        hasher.update_column(number, values(column))
    return hasher.finish(meta)


def _bytes(column: np.ndarray) -> memoryview:
    """Eight bytes a value, little end first."""
    whole = column.astype(np.int64) if column.dtype == bool else column
    return np.ascontiguousarray(whole, dtype=whole.dtype.newbyteorder("<")).data
