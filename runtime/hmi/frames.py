"""One moment as the page gets it: both images in plain numbers, the same live and from a recording."""

from typing import Any

import numpy as np

from runtime.hmi.cells import MESSAGES, WORK
from runtime.image import INPUT, OUTPUT, Status

DIGITS = 7  # that matter to anybody who looks
UNKNOWN = (Status.NEVER, Status.NOT_AVAILABLE, Status.ERROR)
PLACES = np.array(list(MESSAGES.values()), dtype=np.intp)
COUNT = len(INPUT.signals) + len(OUTPUT.signals)
STATUS = bytes.maketrans(bytes(range(10)), b"0123456789")


def values(inputs: np.void, outputs: np.void) -> np.ndarray:
    """All values in the catalogue's order, shape (COUNT,); not a number where nothing is known."""
    found = np.concatenate((inputs["value"], outputs["value"]))
    found[np.isin(np.concatenate((inputs["status"], outputs["status"])), UNKNOWN)] = np.nan
    return found


def frame(when: float, inputs: np.void, outputs: np.void) -> dict[str, Any]:
    """`t` [s], `v` values, `s` a digit a status, `a` age of each message in ticks, tick and flags."""
    status = np.concatenate((inputs["status"], outputs["status"])).astype(np.uint8)
    return {
        "t": round(when, 3),
        "tick": int(inputs["tick"]),
        "v": [_plain(x) for x in values(inputs, outputs).tolist()],
        "s": np.minimum(status, 9).tobytes().translate(STATUS).decode(),
        "a": inputs["age"][PLACES].tolist(),
        "flags": int(outputs["flags"]),
    }


def work(found: np.void) -> dict[str, Any]:
    """What the cycles and the bus came to (cells.WORK)."""
    plain = {name: found[name].tolist() for name in WORK.names or ()}
    return plain | {"work": found["work"].sum(axis=0).tolist()}


def _plain(x: float) -> float | None:
    """A short number; None for what JSON has no word for."""
    if not abs(x) < 1e30:
        return None
    return round(x, 4) if abs(x) < 1e3 else float(f"{x:.{DIGITS}g}")
