"""Writes CSV: one header line `name [unit]`, a row for each time, empty cells where there is no sample."""

from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv

from records.formats.metadata import START, as_json, meta_of
from records.formats.tables import cells, shared_clock
from records.measurement import Measurement

META = "slewright"  # key of the comment line that holds our metadata


def write(measurement: Measurement, path: Path) -> list[str]:
    """Write one header `name [unit]` and a row for each time; returns what CSV does not keep.

    Raises InputError where the channels' rates differ.
    """
    clock = shared_clock(measurement, "CSV")
    columns = {"time": pa.array(clock)}
    for channel in measurement.channels.values():
        held, absent = cells(channel, clock)
        held = held.astype(np.int8) if held.dtype == bool else held
        columns[channel.name] = pa.array(held, mask=absent if absent.any() else None)
    meta = meta_of(measurement)
    start = meta.pop(START, None)
    channels = measurement.channels.values()
    with path.open("wb") as file:
        file.write(f"# {START}: {start}\n".encode() if start else b"")
        file.write(f"# {META}: {as_json(meta)}\n".encode() if meta else b"")
        heads = ["time [s]", *(f"{c.name} [{c.unit}]" for c in channels)]
        file.write((",".join(_quoted(head) for head in heads) + "\n").encode())
        csv.write_csv(pa.table(columns), file, csv.WriteOptions(include_header=False))
    words = {"b": "flags", "i": "whole numbers", "u": "whole numbers"}
    kinds = sorted({words[c.values.dtype.kind] for c in channels if c.values.dtype.kind in words})
    lost = [f"types: {' and '.join(kinds)} become floats"] if kinds else []
    return lost + (["descriptions of channels"] if any(c.description for c in channels) else [])


def _quoted(cell: str) -> str:
    return '"' + cell.replace('"', '""') + '"' if any(c in cell for c in ',;"\t') else cell
