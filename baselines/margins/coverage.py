"""Whether a measured drive is one that a controller was tried on: a bundle's table has the plants' drives.

A drive is covered where its gain and dead band are within those of the plants on which the controller passed,
and its delay not longer, each widened by what a family of plants is varied by.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from baselines.margins.drive import Drive
from specs import parameters
from specs.errors import InputError

TABLE = "plants.json"  # in a bundle


@dataclass(frozen=True)
class Range:
    """A figure that was measured, and where it may be; limits inclusive, NaN is not within."""

    name: str
    measured: float
    low: float
    high: float
    unit: str

    def __str__(self) -> str:
        ends = [f"at least {self.low:.3g}"] * math.isfinite(self.low)
        ends += [f"at most {self.high:.3g}"] * math.isfinite(self.high)
        return f"{self.name}: measured {self.measured:.3g}, {', '.join(ends)} {self.unit}".rstrip()

    @property
    def kept(self) -> bool:
        """Whether it is there."""
        return self.low <= self.measured <= self.high


def ranges(measured: Drive, drives: Sequence[Drive]) -> Iterator[Range]:
    """The drive's figures against those of the plants that a controller passed on (one or more)."""
    known = parameters.load("commissioning")
    share, later, band = (known[f"commissioning_{n}_beyond"].value for n in ("gain", "delay", "dead"))
    gains, delays, bands = ([getattr(d, n) for d in drives] for n in ("gain", "delay_s", "dead_band"))
    yield Range(
        "gain of the slew drive", measured.gain, min(gains) * (1 - share), max(gains) * (1 + share), "rad/s"
    )
    yield Range("delay of the slew drive", measured.delay_s, -math.inf, max(delays) + later, "s")
    yield Range("dead band of the slew drive", measured.dead_band, min(bands) - band, max(bands) + band, "")


def passed(content: Any, where: str) -> dict[str, Drive]:
    """plant -> its drive, of the plants in a bundle's table on which the controller passed.

    InputError for a table that has no drives, or other ones.
    """
    try:
        names, drives = content["passed"], content["drives"]
        found = {name: _drive(drives[name]) for name in names}
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{where}: no table of plants with their drives ({error}); build the bundle again"
        ) from None
    return found


def _drive(values: Mapping[str, float]) -> Drive:
    found = Drive(**{name: float(v) for name, v in values.items()})
    if not all(math.isfinite(v) for v in found.as_dict().values()):
        raise ValueError("a drive that is no number")
    return found
