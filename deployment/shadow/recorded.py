"""A recording in shadow mode as arrays, repeated with its bundle: what was wanted, why it was changed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from runtime.bundle import Bundle
from runtime.control import AXES, REASONS, ControlCore
from runtime.image import INPUT, OUTPUT, TICK_S, Status
from runtime.policy import open_core
from runtime.recorder.feed import TIMING
from runtime.recorder.reader import Recording, Seen, Snapshot, Tick
from runtime.recorder.replay import INPUT_END, check_identity, difference, identity
from runtime.recorder.seen import DTYPE, JOYSTICK, NAMES, SHADOWED, VALVES
from specs.errors import InputError
from specs.progress import Report
from specs.version import VERSION

SAID_EVERY = 5000  # ticks
LEAST_SHARE = 0.5  # of the ticks, in which valve commands must be seen to count as the operator's
SOURCES = {"joystick": JOYSTICK, "valves": VALVES[:3]}


@dataclass(frozen=True)
class Shadowed:
    """One row a tick; NaN where nothing usable came. Commands of three axes, slew, boom, stick."""

    metadata: Mapping[str, str]
    tick: np.ndarray  # [n]
    day_ns: np.ndarray  # [n], time of day
    inputs: np.ndarray  # [n, INPUT]
    outputs: np.ndarray  # [n, OUTPUT]
    wanted: np.ndarray  # [n, 3], by the controller, before the gate; NaN in ticks that could not be repeated
    why: np.ndarray  # [n, 3], bits of runtime.control.REASONS; -1 in ticks that could not be repeated
    operator: np.ndarray  # [n, 3]
    source: str  # of the operator's commands: joystick or valves
    notes: list[str] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.tick)

    @property
    def time(self) -> np.ndarray:
        """s from the first tick [n]."""
        return (self.tick - self.tick[0]) * TICK_S

    def input(self, name: str) -> np.ndarray:
        """An input [n]."""
        return self.inputs[:, INPUT.at(name)]

    def output(self, name: str) -> np.ndarray:
        """An output [n]."""
        return self.outputs[:, OUTPUT.at(name)]

    @property
    def passed(self) -> np.ndarray:
        """Commands as the gate let them through [n, 3]."""
        return np.stack([self.output(name) for name in AXES], axis=1)

    @property
    def mode(self) -> np.ndarray:
        """control_mode [n], whole numbers."""
        return self.output("control_mode").astype(int)


def read(path: Path, bundle: Bundle, source: str | None = None, report: Report = lambda *_: None) -> Shadowed:
    """Read and repeat a recording of shadow mode; `source`: joystick or valves (default: valves if seen).

    Raises InputError for a recording that is none of shadow mode or was made with another bundle.
    """
    check_source(source)
    recording = Recording(path)
    metadata = recording.metadata()
    if metadata.get("mode") != SHADOWED:
        raise InputError(
            f"{path} was not recorded in shadow mode (slewright run --shadow; docs/how-to/shadow.md)"
        )
    check_identity(metadata, identity(bundle.identity, VERSION))
    taken = _Taken(open_core(bundle), str(bundle.folder))
    for item in recording.everything():
        taken.take(item)
        if taken.ticks and not len(taken.ticks) % SAID_EVERY:
            report("repeated", len(taken.ticks))
    if not taken.ticks:
        raise InputError(f"{path} holds no tick")
    return taken.found(metadata, source, recording.notes)


def check_source(source: str | None) -> None:
    """InputError for a source of the operator's commands that there is not."""
    if source is not None and source not in SOURCES:
        raise InputError(f"operator '{source}': valid are {', '.join(SOURCES)}")


class _Taken:
    """What was read so far."""

    def __init__(self, core: ControlCore, where: str) -> None:
        self.core, self.where = core, where
        self.ticks: list[tuple[int, int]] = []
        self.inputs: list[np.ndarray] = []
        self.outputs: list[np.ndarray] = []
        self.wanted: list[list[float]] = []
        self.why: list[list[int]] = []
        self.seen: dict[int, np.ndarray] = {}
        self._pending: Snapshot | None = None
        self._count: int | None = None
        self._untold = 0

    def take(self, item: Tick | Snapshot | Seen) -> None:
        if isinstance(item, Snapshot):
            self._pending = item
        elif isinstance(item, Seen):
            entry = np.frombuffer(item.entry, DTYPE, 1)[0]
            self.seen[int(entry["tick"])] = _usable(entry)
        else:
            self._tick(item.entry)

    def _tick(self, entry: bytes) -> None:
        day, count = TIMING.unpack_from(entry)[:2]
        inputs = np.frombuffer(entry, INPUT.dtype, 1, TIMING.size).reshape(())
        outputs = np.frombuffer(entry, OUTPUT.dtype, 1, INPUT_END).reshape(())
        tick = int(inputs["tick"])
        self.ticks.append((tick, day))
        self.inputs.append(_usable(inputs))
        self.outputs.append(_usable(outputs))
        wanted, why = self._repeat(inputs, outputs, tick, count)
        self.wanted.append(wanted)
        self.why.append(why)

    def _repeat(self, inputs: np.ndarray, outputs: np.ndarray, tick: int, count: int):
        snapshot, self._pending = self._pending, None
        if self._count is None or count != self._count + 1:
            if snapshot is None or snapshot.tick != tick:
                self._count, self._untold = None, self._untold + 1
                return [np.nan] * len(AXES), [-1] * len(AXES)
            self.core.restore(snapshot.state)
        self._count = count
        before = self.core.snapshot()
        again = self.core.step(inputs, tick)
        if again.tobytes() != outputs.tobytes():
            raise InputError(
                f"{self.where} does not repeat the recording: {difference(tick, outputs, again)}"
            )
        wanted, reasons = self.core.explained(inputs, before)
        return wanted, [sum(1 << REASONS.index(r) for r in axis) for axis in reasons]

    def found(self, metadata: Mapping[str, str], source: str | None, notes: list[str]) -> Shadowed:
        ticks = np.array(self.ticks, dtype=np.int64)
        nothing = np.full(len(NAMES), np.nan)
        seen = np.array([self.seen.get(int(t), nothing) for t in ticks[:, 0]])
        chosen = source or _seen_most(seen)
        said = [*notes]
        if self._untold:
            said.append(f"{self._untold} ticks after a gap have no state to repeat them from")
        places = [NAMES.index(name) for name in SOURCES[chosen]]
        return Shadowed(
            metadata, ticks[:, 0], ticks[:, 1], np.array(self.inputs), np.array(self.outputs),
            np.array(self.wanted), np.array(self.why), seen[:, places], chosen, said,
        )  # fmt: skip


def _usable(image: np.ndarray) -> np.ndarray:
    """Values, NaN for those with another status than OK."""
    return np.where(image["status"] == Status.OK, image["value"], np.nan)


def _seen_most(seen: np.ndarray) -> str:
    """Valve commands where they were on the bus, else the joystick."""
    there = np.isfinite(seen[:, [NAMES.index(n) for n in SOURCES["valves"]]]).all(axis=1)
    return "valves" if np.mean(there) >= LEAST_SHARE else "joystick"
