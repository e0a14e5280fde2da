"""The Parquet side of a recording: row groups as they fill up, the metadata at the end."""

import base64
import contextlib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from records.schema import META_KEY, Column, arrays, encode_meta, make_schema

GROUP_ROWS = 32_000  # rows of a row group, fewer where that were too much memory:
GROUP_BYTES = 32 << 20
ARROW_SCHEMA = b"ARROW:schema"  # where Arrow's readers look for the schema with all metadata


def group_rows(columns: int) -> int:
    """Rows of a row group of so many columns: a multiple of 250 that depends on nothing else."""
    return max(250, min(GROUP_ROWS, GROUP_BYTES // (8 * columns) // 250 * 250))


class ParquetFile:
    """A Parquet file at `path` that is written group by group; OSError when the disk refuses."""

    def __init__(self, path: Path, columns: Sequence[Column]) -> None:
        self.path = path
        self._columns = columns
        self._schema = make_schema(columns, {}).remove_metadata()
        self._file = pa.OSFile(str(path), "wb")
        # Byte-stream split halves smooth floating-point columns under zstd, where a dictionary does not help;
        # whole numbers mostly are modes and counts.  The schema is stored at the end, with the metadata.
        options: dict[str, Any] = {
            "use_dictionary": [c.name for c in columns if c.type in ("int64", "uint64")] or False,
            "use_byte_stream_split": [c.name for c in columns if c.type == "float64"],
            "compression": "zstd",
            "write_page_checksum": True,
            "store_schema": False,
        }
        self._writer = pq.ParquetWriter(self._file, self._schema, **options)

    def write(self, cells: np.ndarray, rows: int) -> None:
        """A row group of the first `rows` of cells [columns, n]."""
        table = pa.Table.from_arrays(arrays(self._columns, cells, slice(0, rows)), schema=self._schema)
        self._writer.write_table(table, row_group_size=rows)

    def close(self, meta: Mapping[str, Any]) -> None:
        """Store the metadata, and see to it that all is on the disk."""
        schema = base64.b64encode(make_schema(self._columns, meta).serialize())
        self._writer.add_key_value_metadata({META_KEY: encode_meta(meta), ARROW_SCHEMA: schema})
        self._writer.close()
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()

    def discard(self) -> None:
        """Close and remove it, as far as the disk lets us."""
        with contextlib.suppress(OSError, pa.ArrowException):
            self._writer.close()
        with contextlib.suppress(OSError):
            self._file.close()
        self.path.unlink(missing_ok=True)
