"""Faults inside the computer, each with the real parts it concerns and a clock or disk that misbehaves."""

import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from deployment.faults.clock import Clock
from deployment.faults.disks import ForgettingDisk, FullDisk, PowerCutError
from deployment.faults.drive import Drive, Moment, Run
from deployment.faults.table import TICK_MS, Fault, Outcome
from runtime.bundle import load
from runtime.image import TICK_S, Flag
from runtime.modbus.cells import HOLDING, TARGETS
from runtime.modbus.holding import CLAIM, COMMIT, HEARTBEAT, PLACES, UNNAMED, Holding, encode
from runtime.modbus.server import CONNECTIONS, KEPT
from runtime.places import leaves
from runtime.recorder.feed import SNAPSHOT_TICKS, TICK, TIMING, Feed
from runtime.recorder.reader import Recording
from runtime.recorder.recorder import POLL_S, Recorder
from runtime.recorder.replay import replay
from runtime.recorder.segments import Disk, Folder
from runtime.retain.copies import Retained
from runtime.ring import Ring
from runtime.scan import PERIOD_NS, Scan
from specs import policy
from specs.errors import InputError
from specs.wire import MODBUS_HEADER

Random = np.random.Generator
POLL_TICKS = round(POLL_S / TICK_S)
RING_BYTES = 4 << 20  # as the supervisor makes it
LIMIT = 64 << 20
YEAR_NS = 365 * 86_400 * 10**9
FIRST = len(MODBUS_HEADER)
LAYOUT = "faultsfaultsfaul"
CYCLES = 50


class Recorded:
    """The drive from a moment on, with recorder and disk."""

    def __init__(self, drive: Drive, moment: Moment, folder: Path, disk: Disk) -> None:
        self.drive, self.run, self.tick = drive, Run(drive, moment), moment.tick
        self.ring = Ring.create(folder / "ring", RING_BYTES)
        self.feed = Feed(self.ring, SNAPSHOT_TICKS)
        self.recorder = Recorder(self.ring, Folder(folder / "out", LIMIT), {}, 3000, disk)
        self.folder, self.first = folder, moment.tick

    def steps(self, ticks: int, works: bool = True, until: int = 0) -> int | None:
        """So many ticks, the recorder working beside them or not; after how many the flag came up."""
        for k in range(ticks):
            frames = self.drive.frames[min(self.tick, len(self.drive.frames) - 1)]
            self.feed.before(self.tick, self.drive.core)
            outputs = self.run.step(frames, self.tick)
            self.feed.tick(self.run.inputs, outputs, (self.tick * PERIOD_NS, 0, 0, 0, -1))
            self.tick += 1
            if works and not k % POLL_TICKS:
                self.recorder.work()
            if self.feed.flags(self.tick) & until:
                return k + 1
        return None

    def repeats(self) -> bool:
        """Close; True if every tick since the start was recorded and repeats bit for bit."""
        self.recorder.work()
        self.recorder.close()
        result = replay(Recording(self.folder / "out"), self.drive.core)
        return result.first is None and result.ticks == self.tick - self.first


def disk_full(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """Writes are refused from some moment on."""
    with tempfile.TemporaryDirectory() as name:
        disk = FullDisk()
        found = Recorded(drive, moment, Path(name), disk)
        found.steps(int(random.integers(20, 60)))
        disk.full = True
        seen = found.steps(round(fault.limit_ms / TICK_MS) + 20, until=Flag.DISK_FULL)
        touched = found.ring.lost != 0
        outcome.add(moment.tick, seen * TICK_MS if seen else None, "ticks were lost" if touched else "")
        found.ring.close()


def slow_fsync(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """The recorder hangs in the disk and comes back."""
    with tempfile.TemporaryDirectory() as name:
        found = Recorded(drive, moment, Path(name), Disk())
        found.steps(int(random.integers(5, 30)))
        ticks = int(random.integers(100, 400))
        seen = found.steps(ticks, works=False, until=Flag.RECORDER_LOST)
        found.steps(ticks, works=False)
        found.steps(20)
        why = "" if found.repeats() else "the recording does not repeat"
        outcome.add(moment.tick, seen * TICK_MS if seen else None, why)
        found.ring.close()


def clock_step(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """The cycle on a clock whose time of day jumps: same ticks, same commands, recorded times that go on."""
    jumps = {int(k): int(random.integers(-YEAR_NS, YEAR_NS)) for k in random.choice(40, 3, replace=False)}
    plain, times = _cycle(drive, moment, {}), list[int]()
    same = _cycle(drive, moment, jumps, times) == plain
    steady = all(b - a == PERIOD_NS for a, b in pairwise(times))
    why = (
        ""
        if same and steady and len(times) == CYCLES and plain
        else "ticks, commands or recorded times changed"
    )
    outcome.add(moment.tick, 0.0, why)


def _cycle(drive: Drive, moment: Moment, jumps: dict[int, int], times: list[int] | None = None) -> list:
    """The frames sent in CYCLES ticks; recorded times of day go to `times`."""
    clock, run = Clock(), Run(drive, moment)
    port = _Port(run, drive, lambda tick: clock.jump(jumps.get(tick - moment.tick, 0)))
    with tempfile.TemporaryDirectory() as folder:
        ring = Ring.create(Path(folder) / "ring", RING_BYTES)
        feed = Feed(ring, time_of_day=clock.time_of_day)
        Scan(drive.core, [port], clock=clock, feed=feed).run(ticks=CYCLES, first=moment.tick)
        while times is not None and (entry := ring.get()):
            if entry[0] == TICK:
                times.append(TIMING.unpack_from(entry[1])[0])
        ring.close()
    return run.wires.sent


class _Port:
    """The bus of the drive as a port of the cycle."""

    def __init__(self, run: Run, drive: Drive, each: Callable[[int], None] = lambda tick: None) -> None:
        self.run, self.drive, self.each = run, drive, each

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        self.each(tick)
        frames = self.drive.frames[min(tick, len(self.drive.frames) - 1)]
        self.run.arrive(frames)
        self.run.port.receive(inputs, tick)

    def send(self, outputs: np.ndarray, tick: int) -> None:
        self.run.port.send(outputs, tick)

    def flags(self) -> int:
        return self.run.port.flags()

    def received_ns(self) -> int:
        return 0


def policy_overrun(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """One policy tick takes longer than its period."""
    clock, run = Clock(), Run(drive, moment)
    late = moment.tick + 5 - moment.tick % 5
    seen: list[tuple[int, int]] = []

    class Slow:
        def step(self, inputs: np.ndarray, tick: int) -> np.ndarray:
            clock.work(25_000_000 if tick == late else 100_000)
            seen.append((tick, int(inputs["overruns"])))
            return drive.core.step(inputs, tick)

        snapshot, restore = drive.core.snapshot, drive.core.restore

    Scan(Slow(), [_Port(run, drive)], clock=clock).run(ticks=12, first=moment.tick)
    ticks = [tick for tick, _ in seen]
    after = next((tick for tick, overruns in seen if overruns), None)
    whole = ticks == list(range(moment.tick, moment.tick + 12))
    ms = None if after is None else (after - late + 1) * TICK_MS
    outcome.add(moment.tick, ms, "" if whole else f"ticks {ticks}")


def power_cut(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """Power goes in one of the operations of a few saves; what is read then was saved last or before."""
    disk, done = ForgettingDisk(int(random.integers(0, 40)), float(random.random())), 0
    kept = Retained(disk, LAYOUT)
    try:
        for number in range(1, 12):
            kept.save({"value": number})
            done = number
    except PowerCutError:
        pass
    found = Retained(disk.after_cut(bool(random.integers(0, 2))), LAYOUT).load()
    valid = [{"value": done}, {"value": done + 1}, *([{}] if done == 0 else [])]
    outcome.add(moment.tick, 0.0, "" if found in valid else f"{found} after save {done}")


def policy_wrong_shape(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """A policy whose input or output has another length, rank or name."""
    told = policy.contract("full")
    right = ({policy.INPUT: [1, len(told.layout)]}, {policy.OUTPUT: [1, len(policy.ACTIONS)]})
    ends = [dict(end) for end in right]
    spoilt = ends[int(random.integers(2))]
    name, shape = next(iter(spoilt.items()))
    other = int(random.integers(1, 200))
    spoilt.update({name: [[1, shape[1] + other], shape[:1], [other + 1, shape[1]]][int(random.integers(3))]})
    try:
        policy.check_shapes(ends[0], ends[1], told, "policy.onnx")
    except InputError:
        outcome.add(moment.tick, 0.0)
    else:
        outcome.add(moment.tick, None, f"{name} {spoilt[name]} was taken")


class _WritingClient:
    """A client that may write."""

    writes = True


def modbus_nonsense(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """Any registers to any addresses, by the writer, with commits: what is published stays within ranges."""
    wrong: list[str] = []

    def publish(state: np.ndarray) -> None:
        for s, value in zip(HOLDING, state["value"], strict=True):
            if not (s.min or 0.0) <= value <= (s.max or 0.0):
                wrong.append(f"{s.name} = {value}")

    table, client = Holding(publish), _WritingClient()
    for k in range(30):
        values = random.integers(0, 65536, int(random.integers(1, 20))).tolist()
        table.write(client, int(random.integers(0, 30)), values, k)
        table.write(client, COMMIT, [int(random.integers(65536))], k)
    outcome.add(moment.tick, 0.0, "; ".join(wrong[:2]))


class _Table:
    """A table of registers with a writer that is well; `write` is the writer's."""

    def __init__(self, random: Random) -> None:
        self.random, self.now, self.commits = random, 1, 0
        self.state = np.zeros((), TARGETS)
        self.table, self.client = Holding(self._publish), _WritingClient()
        self.number = int(random.integers(1, UNNAMED))
        self.write(CLAIM, [self.number])

    def _publish(self, state: np.ndarray) -> None:
        self.state = state.copy()

    def write(self, address: int, values: list[int]) -> bool:
        """Whether it was done."""
        return self.table.write(self.client, address, values, self.now) is None

    def target(self) -> list[float]:
        """Any values, in the order of HOLDING, in steps of their resolution."""
        found = []
        for s in HOLDING:
            low, high, step = s.min or 0.0, s.max or 0.0, s.can.scale if s.can else 1.0
            found.append(low + int(self.random.integers(0, int((high - low) / step) + 1)) * step)
        return found


def _registers(values: list[float], swap: str = "") -> list[int]:
    found: list[int] = []
    for s, place, value in zip(HOLDING, PLACES, values, strict=True):
        words = encode(place, value)
        found += words[::-1] if s.name == swap else words
    return found


def modbus_word_order(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """One float of a target comes low word first: refused, or a value that is one (nobody can tell)."""
    table = _Table(random)
    floats = [(i, s) for i, s in enumerate(HOLDING) if PLACES[i].type == "float32"]
    at, s = floats[int(random.integers(len(floats)))]
    values = table.target()
    done = table.write(FIRST, [*_registers(values, s.name), 1])
    step, meant = s.can.scale if s.can else 0.0, abs(values[at])
    got = abs(float(table.state["value"][at]))
    tiny = done and got < step <= meant
    outcome.add(moment.tick, 0.0, f"{s.name} = {values[at]:g} was taken as {got:g}" if tiny else "")


def modbus_commit(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """What would be answered as done though nothing takes effect."""
    table, number = _Table(random), int(random.integers(1, 65536))
    first = _registers(table.target())
    done = table.write(FIRST, [*first, number]) and table.write(FIRST, [*first, number])
    before = table.state["value"].tolist()
    other = first.copy()
    other[HEARTBEAT - FIRST - 1] ^= 0x4000  # of the pace, or what lies before the heartbeat
    taken = (
        table.write(FIRST, [*other, 0]) or table.write(FIRST, [*other, number]) or table.write(COMMIT, [0])
    )
    right = done and not taken and table.state["value"].tolist() == before
    outcome.add(moment.tick, 0.0, "" if right else "answered as done")


def modbus_guessing(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """Others know or guess the number while the writer is there, and guess it when its connection ended."""
    table, others = _Table(random), [_WritingClient() for _ in range(4)]
    table.write(FIRST, [*_registers(table.target()), 1])
    before = table.state["value"].tolist()
    shown = table.table.registers[FIRST:]
    tries = [table.number, *random.integers(1, UNNAMED, 10).tolist()]
    taken = [n for n in tries for who in others if not table.table.write(who, CLAIM, [n], table.now)]
    table.table.left(table.client)
    wrong = [n for n in tries[1:] if n != table.number]
    taken += [n for n in wrong for who in others if not table.table.write(who, CLAIM, [n], table.now)]
    taken += [] if table.table.write(others[0], CLAIM, [table.number], table.now) else [table.number]
    why = f"numbers {taken[:3]} were taken" if taken else ""
    why = why or ("a register shows the number" if table.number in shown[CLAIM - FIRST :] else "")
    same = table.state["value"].tolist() == before
    outcome.add(moment.tick, 0.0, why or ("" if same else "values changed"))


@dataclass(eq=False)
class _Guest:
    near: bool
    heard: int
    busy: bool = False


def idle_places(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """Any order of comers who then do nothing: a new one always has a place, and who is busy keeps his."""
    writer = _Guest(True, 0, busy=True)
    guests, wrong = {writer}, ""
    for moment_heard in range(1, 300):
        comer = _Guest(bool(random.integers(2)), moment_heard)
        leaving = leaves(guests, comer, CONNECTIONS, KEPT)
        if leaving is comer or leaving is writer:
            wrong = "a comer had no place" if leaving is comer else "the writer lost its place"
        guests = (guests | {comer}) - {leaving}
        if len(guests) > CONNECTIONS or sum(not g.near for g in guests) > CONNECTIONS - KEPT:
            wrong = "more than there are places"
    outcome.add(moment.tick, 0.0, wrong)


def bundle_changed(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """A bit of one of the bundle's files changes."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "bundle"
        shutil.copytree(drive.core.bundle.folder, copy)
        paths = sorted(p for p in copy.rglob("*") if p.is_file())
        path = paths[int(random.integers(len(paths)))]
        data = bytearray(path.read_bytes())
        data[int(random.integers(len(data)))] ^= 1 << int(random.integers(8))
        path.write_bytes(data)
        outcome.add(moment.tick, 0.0, "" if _refused(copy) else f"{path.name} was not noticed")


def _refused(folder: Path) -> bool:
    try:
        load(folder)
    except InputError:
        return True
    return False
