"""When a recording began: a time of day with its zone, in metadata and in absolute time stamps."""

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

START = "start"  # in a record's metadata: ISO 8601 with its zone


def start_of(meta: Mapping[str, Any]) -> datetime | None:
    """The start that metadata states; None where it states none, or none that can be read."""
    try:
        found = datetime.fromisoformat(str(meta[START]))
    except (KeyError, ValueError):
        return None
    return found if found.tzinfo else found.replace(tzinfo=UTC)


def from_ns(stamps: np.ndarray, absent: np.ndarray | None = None) -> tuple[np.ndarray, datetime]:
    """Nanoseconds since 1970 [n, int64] as s since the first row's, NaN where `absent`, and when that was.

    The first, not the earliest: where the clock is damaged it is not known yet which that is.
    """
    there = np.ones(len(stamps), dtype=bool) if absent is None else ~absent
    first = int(stamps[there][0]) if there.any() else 0
    return np.where(there, (stamps - first) / 1e9, np.nan), at_ns(first)


def at_ns(stamp: int) -> datetime:
    """Nanoseconds since 1970 as a time of day, to a microsecond."""
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=round(stamp / 1000))


def to_ns(start: datetime) -> int:
    """A time of day as nanoseconds since 1970; one without a zone counts as UTC."""
    aware = start if start.tzinfo else start.replace(tzinfo=UTC)
    return (aware - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(microseconds=1) * 1000
