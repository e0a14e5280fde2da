"""Whole numbers that floats do not hold exactly, under linear rules."""

import numpy as np

EXACT = 2**53  # from here on a float skips whole numbers
ROUNDED = "numbers beyond 2^53 are rounded to floats"


def scaled(number: np.ndarray, scale: float, offset: float) -> np.ndarray | None:
    """Whole numbers [n] · scale + offset exactly; None where some are not whole or too large."""
    if scale % 1 or offset % 1 or not len(number):
        return None
    by, plus = int(scale), int(offset)
    ends = [int(n) * by + plus for n in (number.min(), number.max())]
    kinds = (np.iinfo(np.int64), np.iinfo(np.uint64))
    kind = next((k.dtype for k in kinds if k.min <= min(ends) and max(ends) <= k.max), None)
    exact = number.astype(np.uint64) * np.uint64(by % 2**64) + np.uint64(plus % 2**64)
    return None if kind is None else exact.view(kind)
