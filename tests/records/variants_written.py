"""What a variant holds, whatever form it was written in."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass
class Written:
    """A file; its channels {name: (times in s, values)} as they were meant; options stated on reading."""

    path: Path
    channels: dict[str, tuple[list[float], list[float]]]
    options: dict[str, Any] = field(default_factory=dict)
    may: tuple[str, ...] = ()  # channels that may come besides
    first: float | None = None  # the time at 0 s, if it is not the first sample's
    resolution: float = 2e-9  # s
    how: str = ""
    units: dict[str, str] = field(default_factory=dict)  # of channels, where they are known
    start: float | None = None  # s since 1970 at 0 s, where the file says it


def first_of(channels: dict[str, tuple[list[float], list[float]]]) -> float:
    """The time of the first sample of all channels."""
    return min((t[0] for t, _ in channels.values() if t), default=0.0)
