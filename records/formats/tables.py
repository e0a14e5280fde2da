"""Tables with one time column, as CSV and Parquet files are: headings, which column is the time, and one time
for all channels, the one they share or a grid that is asked for.
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from hashlib import blake2b

import numpy as np

from records.formats.units import of_time
from records.measurement import MOST_ROWS, ROUNDING, Channel, Measurement
from specs.errors import InputError, nearest

# What clocks are called, in small letters and without blanks and marks between the words.
CLOCKS = frozenset(
    [
        "time",
        "timestamp",
        "timestamps",
        "zeit",
        "zeitstempel",
        "tout",
        "datetime",
        "datum",
        "date",
        "uhrzeit",
        "elapsedtime",
        "elapsed",
        "timesincestart",
        "unixtime",
        "unixtimestamp",
        "epochtime",
        "abstime",
        "absolutetime",
        "absolutezeit",
        "messzeit",
        "reltime",
        "relativetime",
        "systemtime",
        "localtime",
        "utctime",
        "timestampepoch",
        "epoch",
        "xvalue",
        "zeitpunkt",
        "laufzeit",
        "runtime",
        "seconds",
        "sec",
        "secs",
        "second",
        "millis",
        "milliseconds",
        "microseconds",
        "micros",
        "nanoseconds",
        "datumuhrzeit",
        "datumzeit",
        "dateandtime",
        "timeofday",
        "testtime",
        "totaltime",
        "logtime",
        "recordtime",
        "temps",
        "horodatage",
        "tiempo",
        "tempo",
        "tijd",
        "uptime",
    ]
)
BY_NAME = {"seconds": "s", "sec": "s", "secs": "s", "second": "s", "millis": "ms", "milliseconds": "ms",
           "micros": "us", "microseconds": "us", "nanoseconds": "ns"}  # fmt: skip
DAY_NAMES = ("date", "datum")  # a day alone, unless it says more
SUFFIX = re.compile(r"^(?P<name>.*[a-z])(?:_|(?=[A-Z]))(?P<unit>s|ms|us|ns|sec|msec|usec|Ms|Us|Ns|min)$")
NUMBERED = re.compile(r"^(?P<name>.*?)[\s._-]*\d+$")
SQUARE = re.compile(r"^(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]\s*$")


@dataclass(frozen=True)
class Heading:
    """The name of a column and the unit beside it ("" where there is none)."""

    name: str
    unit: str = ""
    text: str = ""  # the whole heading


def heading(text: str) -> Heading:
    """Read `name [unit]` as this project writes it."""
    match = SQUARE.match(text.strip())
    return Heading(match["name"], match["unit"].strip(), text.strip()) if match else Heading(text.strip())


def bare(name: str) -> str:
    """A name in small letters without blanks and marks; of `Trace1.Time` the last part."""
    return re.sub(r"[\s_\-]+", "", re.split(r"[./]", name.strip())[-1]).lower()


def clock_name(name: str) -> bool:
    """Whether a column of this name may be the clock; a capital T is a temperature."""
    if name.strip() == "t" or bare(name) in CLOCKS:
        return True
    match = SUFFIX.match(name.strip())
    return bool(match and (match["name"] == "t" or bare(match["name"]) in CLOCKS))


def clock_unit(name: str) -> str:
    """The unit that the name of a clock says, as in `time_ms`; "" where it says none."""
    match = SUFFIX.match(name.strip())
    return match["unit"].lower() if match and clock_name(match["name"]) else BY_NAME.get(bare(name), "")


def is_clock(ours: str) -> bool:
    """Whether a name of ours means the time: `time` or `time [ms]`."""
    return heading(ours).name == "time"


def stated_clock(
    headings: Sequence[Heading], names: Mapping[str, str], clock: str | None, source: str
) -> tuple[int, str] | None:
    """The column that `--clock` or the map calls the time, and the unit stated with it ("" if none)."""
    found = {h.name: i for i, h in enumerate(headings)}
    found |= {h.text: i for i, h in enumerate(headings) if h.text}
    if clock is not None:
        name, unit = (clock, "") if clock in found else (heading(clock).name, heading(clock).unit)
        if name not in found:
            raise InputError(f"{source} has no column '{name}'; {nearest(name, [h.name for h in headings])}")
        return found[name], unit
    for theirs, ours in names.items():
        if is_clock(ours):
            if theirs not in found:
                raise InputError(
                    f"{source} has no column '{theirs}'; {nearest(theirs, [h.name for h in headings])}"
                )
            return found[theirs], heading(ours).unit
    return None


def one_clock(headings: Sequence[Heading], possible: Sequence[int], source: str) -> int:
    """The one column that may be the clock; raises InputError where there is none, or more than one."""
    if len(possible) == 1:
        return possible[0]
    found = [h.name for h in headings]
    if possible:
        raise _several(headings, possible, source)
    shown = ", ".join(name[:40] for name in found[:8]) + (", …" if len(found) > 8 else "")
    raise InputError(
        f"{source}: no time column (time, timestamp, t, time_ms …) among {shown}; "
        "--clock 'NAME [unit]' names it, or a --map with 'NAME' = 'time [unit]'"
    )


def _several(headings: Sequence[Heading], possible: Sequence[int], source: str) -> InputError:
    several = ", ".join(headings[i].text or headings[i].name for i in possible)
    return InputError(
        f"{source}: {len(possible)} columns may be the time: {several}; --clock NAME says which one is"
    )


def other_clocks(headings: Sequence[Heading], at: int, rises: Callable[[int], bool]) -> list[int]:
    """Columns beside the clock that rise as times do, and are called so: the time of some of the others."""
    named = clock_name(headings[at].name)
    return [i for i, h in enumerate(headings) if i != at and _may_be_another(h, named) and rises(i)]


def check_other_clocks(
    headings: Sequence[Heading], at: int, rises: Callable[[int], bool], source: str
) -> None:
    """Raise InputError where there are such columns."""
    if others := other_clocks(headings, at, rises):
        raise _several(headings, sorted([at, *others]), source)


def own_clocks(headings: Sequence[Heading], clocks: Sequence[int]) -> list[range] | None:
    """Columns that each of some clocks times: those behind it, up to the next one.

    None where that is not plain: the first column is none of them, there is nothing behind one, or they are
    not of one name but for a number (`Time`, `Time.1`).
    """
    ends = [*clocks[1:], len(headings)]
    found = [range(a + 1, b) for a, b in zip(clocks, ends, strict=True)]
    names = {
        (m["name"] if (m := NUMBERED.match(n)) else n).lower() for n in (headings[i].name for i in clocks)
    }
    return found if clocks[0] == 0 and all(found) and len(names) == 1 else None


def _may_be_another(head: Heading, named: bool) -> bool:
    """Whether a heading may be that of a further clock: `Time.1`, `t2 [s]`, `time_b [s]`; where the clock was
    known by its unit alone (not `named`), any in a unit of time.
    """
    timed, name = of_time(head.unit), head.name.strip()
    if (match := NUMBERED.match(name)) and clock_name(match["name"]):
        return timed or (not head.unit and match["name"] != "t")  # t1 and t2 may be temperatures
    return timed and (not named or clock_name(re.split(r"[\s._-]", name)[0]))


def check_twice(headings: Sequence[Heading], source: str) -> None:
    """Raise InputError for a name that two columns have, or a column without one."""
    seen: set[str] = set()
    twice = {h.name for h in headings if h.name in seen or seen.add(h.name)}
    if "" in seen:
        raise InputError(f"{source}: column {[h.name for h in headings].index('') + 1} has no name")
    if twice:
        raise InputError(f"{source}: two columns are called {', '.join(sorted(twice))}")


SAME_RATE = 0.01  # relative: periods that differ by less are one rate


def clocks(channels: Iterable[Channel]) -> list[tuple[np.ndarray, list[Channel]]]:
    """Channels by the times that they share to the last bit, in the order of the first of each."""
    found: dict[bytes, tuple[np.ndarray, list[Channel]]] = {}
    keys: dict[int, bytes] = {}
    for channel in channels:
        key = keys.get(id(channel.time)) or blake2b(np.ascontiguousarray(channel.time).data).digest()
        keys[id(channel.time)] = key
        found.setdefault(key, (channel.time, []))[1].append(channel)
    return list(found.values())


def finer(times: Iterable[np.ndarray], resolution_s: float) -> bool:
    """Whether a clock that counts in `resolution_s` changes some of these times (more than rounding does)."""
    return any(
        np.abs(np.round(time / resolution_s) * resolution_s - time).max(initial=0.0) > 1e-3 * resolution_s
        for time in times
    )


def shared_clock(measurement: Measurement, kind: str) -> np.ndarray:
    """The times of a table of all channels; a channel may lack some of them.

    Raises InputError naming the rates where they differ: such a table would be mostly holes.
    """
    channels = [c for c in measurement.channels.values() if len(c.time)]
    if not channels:
        raise InputError(f"{measurement.source or 'the recording'} holds no samples")
    if "time" in measurement:
        raise InputError(
            f"{measurement.source or 'the recording'}: {kind} needs the name 'time' for its time"
        )
    groups = clocks(channels)
    if len(groups) == 1:
        return groups[0][0]
    union = np.unique(np.concatenate([time for time, _ in groups]))
    period = float(np.median(np.diff(union))) if len(union) > 1 else 0.0
    for _, (first, *_) in groups:
        if abs(first.period_s - period) > SAME_RATE * period:  # not for a single sample
            raise InputError(
                f"{measurement.source or 'the recording'}: {kind} has one time for all channels, these have "
                f"{_rates(groups)}; choose a step (--step S)"
            )
    return union


def _rates(groups: Iterable[tuple[np.ndarray, list[Channel]]]) -> str:
    """`50 Hz (12 channels: q_slew …), 10 Hz (target_x)`; clocks of one rate are told apart."""
    shown = []
    for _, channels in groups:
        period = channels[0].period_s
        rate = f"{1 / period:.4g} Hz" if period == period else "one sample"
        names = channels[0].name if len(channels) == 1 else f"{len(channels)} channels: {channels[0].name} …"
        shown.append(f"{rate} ({names})")
    return ", ".join(shown[:4]) + (f" and {len(shown) - 4} more" if len(shown) > 4 else "")


def cells(channel: Channel, clock: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values of a channel at the times of `clock` [n], and where it has none (its value there is 0)."""
    if len(channel.time) == len(clock):
        return channel.values, np.zeros(len(clock), dtype=bool)
    values, absent = np.zeros(len(clock), dtype=channel.values.dtype), np.ones(len(clock), dtype=bool)
    at = np.searchsorted(clock, channel.time)
    values[at], absent[at] = channel.values, False
    return values, absent


def on_grid(measurement: Measurement, step_s: float) -> Measurement:
    """All channels every `step_s` from the first sample on: the last one at or before, nothing interpolated.

    A channel has no sample where it has none that is fresh (Channel.held): gaps stay gaps, and it ends a
    period after its last one.  Raises InputError for a step that cannot be.
    """
    if not step_s > 0 or not np.isfinite(step_s):
        raise InputError(f"the step must be more than 0 s, not {step_s:g}")
    channels = [c for c in measurement.channels.values() if len(c.time)]
    first, last = min(c.time[0] for c in channels), max(c.time[-1] for c in channels)
    count = int(np.floor((last - first) / step_s + ROUNDING)) + 1
    if count > MOST_ROWS:
        raise InputError(f"{measurement.source}: {count} rows at {step_s:g} s; is its time in s?")
    grid = step_s * np.arange(count)
    made = [_gridded(c, grid, float(first), step_s) for c in channels]
    start = measurement.start and measurement.start + timedelta(seconds=float(first))
    said = f"put on a grid of {step_s:g} s: the last sample at or before each time"
    repairs = (*measurement.repairs, said)
    there = {c.name: c for c in made if len(c.time)}
    return replace(measurement, channels=there, start=start, repairs=repairs)


def _gridded(channel: Channel, grid: np.ndarray, first: float, step_s: float) -> Channel:
    index, fresh = channel.held(first + grid, step_s)
    period = np.fmax(channel.period_s, step_s)  # the last sample stands for one: then the channel has ended
    fresh &= (index < len(channel.time) - 1) | (first + grid - channel.time[index] < (1 - ROUNDING) * period)
    time = grid if fresh.all() else grid[fresh]
    return replace(channel, time=time, values=channel.values[index[fresh]])
