"""CSV and other tables in text: one header line with units, one time column; an empty cell is no sample.

Read are all usual delimiters, marks, encodings, preambles, lines of units and forms of times (`text/`).
"""

from collections.abc import Mapping
from pathlib import Path

from records.formats.csv_write import write
from records.formats.raw import Raw
from records.formats.text import TextOptions, read_text

__all__ = ["read", "write"]

READS = (".csv", ".tsv", ".txt", ".lvm")
WRITES = (".csv",)
TIME_COLUMN = True  # its time is a column like others


def read(path: Path, names: Mapping[str, str], text: TextOptions | None = None) -> Raw:
    """Read a text file; raises InputError naming the line that cannot be read."""
    return read_text(path, names, text or TextOptions())
