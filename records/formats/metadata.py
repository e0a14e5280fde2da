"""Metadata beside the samples, and when a recording began, also as absolute time stamps."""

import json
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from records.figures_file import plain
from records.measurement import Measurement

START = "start"  # in a record's metadata: ISO 8601 with its zone
SOURCE, REPAIRS = "converted_from", "repairs"
OF_THE_FILE = (START, "run_hash", "format", "absent")  # what a writer says anew


def meta_of(measurement: Measurement) -> dict[str, Any]:
    """Metadata of a file to be written: the recording's own, its start, its source, what was mended."""
    meta = {k: v for k, v in measurement.meta.items() if k not in OF_THE_FILE}
    if measurement.start is not None:
        meta[START] = measurement.start.isoformat()
    if measurement.source:
        meta[SOURCE] = Path(measurement.source).name
    if measurement.repairs:
        meta[REPAIRS] = [*meta.get(REPAIRS, ()), *measurement.repairs]
    return json.loads(as_json(meta))


def as_json(meta: Mapping[str, Any]) -> str:
    """Metadata as one line of JSON; what JSON does not know is written as text."""
    return json.dumps(plain(meta), default=str, ensure_ascii=False, sort_keys=True, allow_nan=False)


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
