"""Whole numbers beyond 2^53, which floats round: columns of nothing else are read once more, exactly."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from records.formats.text.columns import Column, array
from records.formats.text.marks import Marks
from records.formats.text.rows import Block

WHOLE = re.compile(r"[+-]?\d+")


def keep_whole_numbers(
    blocks: Callable[[], Iterator[Block]],
    strings: Callable[[bytes, Sequence[int]], pa.Table],
    columns: Mapping[int, Column],
    marks: Marks,
    rows: int,
) -> None:
    """Give columns that hold whole numbers alone, some of them beyond 2^53, exact values."""
    for kind in (np.int64, np.uint64):
        held = {i: np.zeros(rows, kind) for i, c in columns.items() if c.wide and c.whole is None}
        at = 0
        for block in blocks() if held else ():
            count = len(block.numbers)
            table = strings(block.data, list(held))
            for i in list(held):
                good = np.isfinite(columns[i].values[at : at + count])
                part = _exact(table.column(str(i)), good, columns[i], marks, kind)
                if part is None:
                    del held[i]
                else:
                    held[i][at : at + count] = part
            at += count
        for i, values in held.items():
            columns[i].whole = values


def _exact(
    cells: pa.ChunkedArray, good: np.ndarray, column: Column, marks: Marks, kind: type
) -> np.ndarray | None:
    """The cells as whole numbers, 0 where there is no number; None where one is not whole or too large."""
    try:
        numbers = pc.cast(cells, pa.from_numpy_dtype(kind))  # type: ignore[attr-defined]
        return np.asarray(array(numbers.fill_null(0)))
    except pa.ArrowException:
        pass
    texts = [
        column.plain(c, marks) if there else "0" for c, there in zip(cells.to_pylist(), good, strict=True)
    ]
    if not all(t and WHOLE.fullmatch(t) for t in texts):
        return None
    try:
        return np.array([int(t) for t in texts if t], dtype=kind)
    except OverflowError:
        return None
