"""MATLAB's .mat, versions 4 to 7: vectors, matrices and structures with a time, Simulink's logs.

A vector that is called a time times those of its length beside it, and in structures below it.  Where there
is none, a number that is called a rate or a sample time does, or the row that Simulink's block To File puts
first.  Version 7.3 is HDF5, and objects (timeseries, table) open in MATLAB alone: both are said.
"""

import pickle
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from records.formats.raw import Group, Raw, RawColumn
from records.formats.tables import Heading, bare, clock_name, clock_unit, heading, one_clock, stated_clock
from records.formats.units import seconds
from specs.errors import InputError

READS = (".mat",)
WRITES = ()
TIME_COLUMN = True  # its time is a column like others
RATES = ("fs", "samplerate", "samplingrate", "samplingfrequency", "samplefrequency", "actualrate", "fsample")
PERIODS = ("ts", "dt", "sampletime", "samplingtime", "samplingperiod", "sampleperiod", "tsample")
FEWEST = 2  # samples of a signal
HDF5 = b"\x89HDF"  # where a file of version 7.3 goes on after MATLAB's own header
LOADS = """
import pickle, sys
from scipy.io import loadmat
pickle.dump(loadmat(sys.argv[1], struct_as_record=False), sys.stdout.buffer)
"""
OBJECTS = (
    "an object that MATLAB alone opens, such as a timeseries or a table; save its numbers (x.Time, x.Data)"
)


@dataclass
class Level:
    """A structure, or the file itself: vectors [n] and single numbers by name, and the structures in it."""

    name: str
    vectors: dict[str, np.ndarray] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)
    below: list["Level"] = field(default_factory=list)
    in_rows: str = ""  # a matrix with a signal a row, as To File writes it

    def all(self) -> Iterator["Level"]:
        """This one and those in it."""
        yield self
        for level in self.below:
            yield from level.all()


def read(path: Path, names: Mapping[str, str]) -> Raw:
    """Read all signals that have a time."""
    top, notes = Level(""), list[str]()
    for name, value in _loaded(path).items():
        _put(top, name, value, notes)
    groups: list[Group] = []
    reading: list[str] = []
    _timed(top, None, names, str(path), groups, notes, reading)
    if not groups:
        found = [Heading(n) for level in top.all() for n in (*level.vectors, *level.numbers)]
        if not found:
            raise InputError(f"{path} holds no numbers{': ' + notes[0] if notes else ''}")
        one_clock(found, (), str(path))
    return Raw(_told_apart(groups), notes=notes, reading=reading)


def _told_apart(groups: Sequence[Group]) -> list[Group]:
    """Signals of one name get that of their structure before it."""
    every = [c.name for g in groups for c in g.columns]
    made = []
    for g in groups:
        shared = {c.name for c in g.columns if g.name and every.count(c.name) > 1}
        columns = [replace(c, name=f"{g.name}.{c.name}") if c.name in shared else c for c in g.columns]
        made.append(replace(g, columns=columns))
    return made


def _loaded(path: Path) -> dict[str, Any]:
    """Variables by name; read in a process of its own, since damaged files make scipy's reader crash."""
    with path.open("rb") as file:
        if HDF5 in file.read(1024):
            raise InputError(
                f"{path} is of MATLAB's version 7.3, which is not read; save('FILE', '-v7', …) writes another"
            )
    done = subprocess.run([sys.executable, "-P", "-c", LOADS, str(path)], capture_output=True, check=False)
    if done.returncode:
        why = done.stderr.decode(errors="replace").strip().splitlines()[-1:] if done.returncode > 0 else []
        raise InputError(f"{path} is no readable .mat file: {why[0] if why else 'it is damaged'}")
    return {n: v for n, v in pickle.loads(done.stdout).items() if not n.startswith("__")}


def _put(level: Level, name: str, value: Any, notes: list[str]) -> None:
    """Sort a value into a level."""
    if type(value).__name__ == "MatlabOpaque" or name == "None":
        notes.append(f"left out {name if name != 'None' else 'a variable'}: {OBJECTS}")
    elif isinstance(value, np.ndarray) and value.dtype == object:
        for k, one in enumerate(value.ravel()):
            _put(level, name if value.size == 1 else f"{name}{k + 1}", one, notes)
    elif hasattr(value, "_fieldnames"):
        level.below.append(_structure(name, value, notes))
    elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.size:
        _put_numbers(level, name, value)
    elif isinstance(value, np.ndarray) and value.dtype.kind == "c":
        notes.append(f"left out {name}: its numbers are complex")


def _structure(name: str, value: Any, notes: list[str]) -> Level:
    level = Level(name)
    if {"time", "signals"} <= set(value._fieldnames):  # Simulink's structure with time
        _put(level, "time", value.time, notes)
        for k, signal in enumerate(np.ravel(value.signals)):
            label = _text(getattr(signal, "label", "")) or f"signal{k + 1}"
            _put(level, label, np.asarray(getattr(signal, "values", ())), notes)
        return level
    for one in value._fieldnames:
        _put(level, one, getattr(value, one), notes)
    return level


def _text(value: Any) -> str:
    return str(np.ravel(value)[0]).strip() if np.size(value) else ""


def _put_numbers(level: Level, name: str, value: np.ndarray) -> None:
    if value.size == 1:
        level.numbers[name] = float(value.ravel()[0])
        return
    value = np.squeeze(value)
    if value.ndim == 1:
        level.vectors[name] = value
    elif value.ndim == 2:
        lying = value.shape[0] < value.shape[1]
        level.in_rows = name if lying else level.in_rows
        level.vectors |= {f"{name}_{k + 1}": v for k, v in enumerate(value if lying else value.T)}


def _timed(
    level: Level, above: np.ndarray | None, names: Mapping[str, str], source: str,
    groups: list[Group], notes: list[str], reading: list[str],
) -> None:  # fmt: skip
    """Groups of a level and of those in it; `above`: the time of the one that it is in."""
    clock, time = _clock(level, names, source, reading)
    time = above if time is None else time
    if time is not None:
        columns = [_column(n, v) for n, v in level.vectors.items() if n != clock and len(v) == len(time)]
        other = [n for n, v in level.vectors.items() if n != clock and len(v) != len(time)]
        if columns:
            groups.append(Group(level.name, time, columns, row="sample"))
        if other:
            notes.append(f"left out {', '.join(other[:6])}: not as long as the time, {len(time)} samples")
    for below in level.below:
        _timed(below, time, names, source, groups, notes, reading)


def _clock(
    level: Level, names: Mapping[str, str], source: str, reading: list[str]
) -> tuple[str, np.ndarray | None]:
    """Which vector of a level is the time ("" for none), and the time in s; None where it has none."""
    found = [Heading(n) for n in level.vectors]
    stated = {theirs: ours for theirs, ours in names.items() if theirs in level.vectors}
    told = stated_clock(found, stated, None, source)
    if told is not None:
        name, unit = found[told[0]].name, told[1]
        return name, seconds(level.vectors[name], unit or "s", source)
    possible = [k for k, h in enumerate(found) if clock_name(h.name)]
    if possible:
        name = found[one_clock(found, possible, source)].name
        unit = clock_unit(name)
        reading.append(f"time: {name}" + (f", in {unit}" if unit else ", its unit is not stated: taken as s"))
        return name, seconds(level.vectors[name], unit or "s", source)
    return _counted(level, reading)


def _counted(level: Level, reading: list[str]) -> tuple[str, np.ndarray | None]:
    """A time from a rate or a sample time, or the first row of a matrix."""
    longest = max((len(v) for v in level.vectors.values()), default=0)
    for name, value in level.numbers.items():
        called = bare(name)
        if value > 0.0 and longest >= FEWEST and called in (*RATES, *PERIODS):
            rate = value if called in RATES else 1.0 / value
            reading.append(f"time: counted, {rate:.6g} samples a second by {name} = {value:g}")
            return "", np.arange(longest) / rate
    first = f"{level.in_rows}_1"
    if level.in_rows and np.all(np.diff(level.vectors[first]) > 0.0):
        reading.append(
            f"time: the first row of {level.in_rows}, which rises, as Simulink's To File has it; in s"
        )
        return first, level.vectors[first]
    return "", None


def _column(name: str, values: np.ndarray) -> RawColumn:
    known = heading(name)
    return RawColumn(known.name, known.unit, values)
