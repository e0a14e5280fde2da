"""Practice throws: what the places where they landed tell of a grab's delay."""

from collections.abc import Mapping, Sequence
from statistics import NormalDist
from typing import Any

import numpy as np

from specs import keys, parameters
from verification.throws.run import Case, run

BEYOND_M = 2.0  # of a practice throw: the faster it is, the better its delay shows


def practised(machine: str, drawn: Mapping[str, float], seed: int, throws: int) -> dict[str, Any]:
    """The delay `told_s` that some practice throws of a machine show, and their rows.

    Somebody reads where each landed, with an error of `throw_read_error`.
    """
    rows = [run(Case(BEYOND_M, machine, drawn, seed, practice=k + 1)) for k in range(throws)]
    read = NormalDist(0.0, parameters.parameter("throw_read_error", "grab").value)
    errors = [read.inv_cdf(keys.uniform("throw read", machine, seed, k)) for k in range(throws)]
    return {"told_s": delay_shown(rows, errors), "rows": rows}


def delay_shown(rows: Sequence[Mapping[str, Any]], errors: Sequence[float]) -> float:
    """The delay, s, with which throws would have gone far enough in the mean; `errors` of reading, m."""
    landed = [(row, e) for row, e in zip(rows, errors, strict=True) if row["released"]]
    shown = [row["told_s"] + (row["aside"] + e) / row["speed"] for row, e in landed]
    return max(float(np.mean(shown)), 0.0) if shown else rows[0]["told_s"]
