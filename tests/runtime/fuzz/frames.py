"""CAN frames into the controller's port and core: nothing raises, no output is unsafe.

A case is a list of (tick, identifier with flags, data in hex).  Safe: every output is a number within its
range, commands change no faster than the gate allows, and in fault or standby they go to neutral.
"""

import random
import struct
from functools import cache

import numpy as np

import runtime.can
from runtime.can.codec import codecs
from runtime.can.joystick import Joystick
from runtime.can.native import NativePort
from runtime.can.port import CanPort
from runtime.can.transmit import Transmitter
from runtime.can.wire import ERROR, EXTENDED, IDENTIFIER, PACKET
from runtime.image import INPUT, OUTPUT, TICK_S
from specs.parameters import parameter
from specs.signals import definition
from tests.edges import Edge, traced
from tests.runtime.bench import FAULT, FAULTS, NOISY, POSE, READY, STANDBY, TARGET
from tests.runtime.bundles import core

PACKAGE = runtime.can
TICKS = 40
STEP = max(parameter(n, "gate").value for n in ("gate_rise", "gate_fall")) * TICK_S
LOW = np.array([s.min for s in OUTPUT.signals], dtype=float)
HIGH = np.array([s.max for s in OUTPUT.signals], dtype=float)
COMMANDS = [OUTPUT.index[n] for n in ("u_slew", "u_boom", "u_stick")]
CODECS = {c.message.frame_id: c for c in codecs().values()}
BJM = 3 << 26 | 64982 << 8 | 0x85
Case = list[tuple[int, int, str]]


@cache
def seeds() -> list[Case]:
    """A drive in automatic operation, and one by hand."""
    return [_drive(by_hand=False), _drive(by_hand=True)]


def _drive(by_hand: bool) -> Case:
    names = [f.name for c in CODECS.values() for f in c.fields]
    index = {name: i for i, name in enumerate(names)}
    values = [f.signal.start for c in CODECS.values() for f in c.fields]
    senders = [Transmitter(n, index) for n in definition().bus.nodes if n != "Controller"]
    noise, found = random.Random(1), []
    for tick in range(TICKS):
        now = {**POSE, **TARGET, **READY, **{n: noise.gauss(0, 1e-3) for n in NOISY}}
        now |= {n: float(tick) for n in ("operator_heartbeat", "machine_heartbeat", "planner_heartbeat")}
        now |= {"operator_enable": float(tick > 8), "automatic_request": float(tick > 12 and not by_hand)}
        now |= {"joystick_slew": 0.5 if by_hand and tick > 12 else 0.0}
        for name, value in now.items():
            values[index[name]] = value
        for sender in senders:
            found += [(tick, i | EXTENDED, data.hex()) for i, data in sender.due(values, tick)]
    return found


class _Source:
    """Hands out the frames of one tick."""

    def __init__(self) -> None:
        self.frames: list[tuple[int, bytes, int]] = []

    def recv_raw(self) -> tuple[int, bytes, int] | None:
        return self.frames.pop(0) if self.frames else None

    def send_raw(self, identifier: int, data: bytes) -> None:
        assert len(data) == CODECS[identifier & IDENTIFIER].message.length


def as_bytes(case: Case) -> bytes:
    """A case as tests/runtime/core/wire_runner.c reads it."""
    found = struct.pack("<q", TICKS)
    for tick in range(TICKS):
        now = [(identifier, bytes.fromhex(data)) for at, identifier, data in case if at == tick]
        found += struct.pack("<qqq", tick, 0, len(now))
        found += b"".join(PACKET.pack(i, len(data) & 0xFF, data[:8], 0) for i, data in now)
    return found


def run(case: Case, edges: set[Edge], images: list[bytes] | None = None) -> None:
    """Play a case; AssertionError if an output is unsafe."""
    control, source, other = core(), _Source(), _Source()
    control.reset()
    sticks = [Joystick() if case and case[0][1] & IDENTIFIER == BJM else None for _ in range(2)]
    port, reference = NativePort(source, control.library, sticks[0]), CanPort(other, joystick=sticks[1])
    image, same, before = INPUT.new(), INPUT.new(), np.zeros(len(COMMANDS))
    ticks: dict[int, list] = {}
    for tick, identifier, data in case:
        ticks.setdefault(tick, []).append((identifier, bytes.fromhex(data), 1 << 62))
    for tick in range(TICKS):
        source.frames, other.frames = ticks.get(tick, []), list(ticks.get(tick, []))
        traced(lambda tick=tick: reference.receive(same, tick), PACKAGE, edges)
        port.receive(image, tick)
        assert (image.tobytes(), port.flags()) == (same.tobytes(), reference.flags()), "C and Python differ"
        for one in (image, same):
            one["tick"], one["flags"] = tick, port.flags()
        if images is not None:
            images.append(image.tobytes())
        out = control.step(image, tick)
        port.send(out, tick)
        before = _judge(out["value"].astype(float), before)


def _judge(values: np.ndarray, before: np.ndarray) -> np.ndarray:
    assert np.isfinite(values).all(), values
    assert ((values >= LOW) & (values <= HIGH)).all(), [s.name for s in OUTPUT.signals]
    commands = values[COMMANDS]
    stopped = values[OUTPUT.index["fault_code"]] == FAULTS["emergency_stop"] and not commands.any()  # at once
    assert stopped or (abs(commands - before) <= STEP + 1e-9).all(), (commands, before)
    if values[OUTPUT.index["control_mode"]] in (FAULT, STANDBY):
        assert (abs(commands) <= abs(before) + 1e-12).all(), (commands, before)
    return commands


def mutate(case: Case, chance: random.Random) -> Case:
    """One to four changes; half of those to a frame's bits get a right checksum again."""
    found = list(case)
    for _ in range(chance.randint(1, 4)):
        if not found:
            return list(seeds()[0])
        found = chance.choice((_bits, _bits, _field, _drop, _again, _swap, _silence, _strange))(found, chance)
    return found


def _bits(case: Case, chance: random.Random) -> Case:
    at = chance.randrange(len(case))
    tick, identifier, data = case[at]
    changed = bytearray(bytes.fromhex(data) or b"\0")
    changed[chance.randrange(len(changed))] ^= 1 << chance.randrange(8)
    codec = CODECS.get(identifier & IDENTIFIER)
    if codec and len(changed) == codec.message.length and chance.random() < 0.5:
        changed[0] = codec.checksum(changed)
    return [*case[:at], (tick, identifier, changed.hex()), *case[at + 1 :]]


def _field(case: Case, chance: random.Random) -> Case:
    """One signal gets a raw number of the odd ones, in every frame from a tick on."""
    _, identifier, _ = chance.choice(case)
    codec = CODECS.get(identifier & IDENTIFIER)
    if codec is None or not codec.fields:
        return case
    field, first = chance.choice(codec.fields), chance.randrange(TICKS)
    odd = (
        0,
        1,
        field.largest,
        field.largest + 1,
        field.error,
        field.absent,
        field.top,
        chance.getrandbits(32),
    )
    raw, mask = chance.choice(odd) & field.top, field.top << field.place.start
    last = first + chance.choice((1, 3, TICKS))

    def changed(entry: tuple[int, int, str]) -> tuple[int, int, str]:
        tick, one, data = entry
        if one != identifier or not first <= tick < last or len(data) != 16:
            return entry
        bits = int.from_bytes(bytes.fromhex(data), "little") & ~mask | raw << field.place.start
        frame = bytearray(bits.to_bytes(8, "little"))
        frame[0] = codec.checksum(frame)
        return tick, one, frame.hex()

    return [changed(entry) for entry in case]


def _drop(case: Case, chance: random.Random) -> Case:
    at = chance.randrange(len(case))
    return [*case[:at], *case[at + chance.choice((1, 20)) :]]


def _again(case: Case, chance: random.Random) -> Case:
    at = chance.randrange(len(case))
    return [*case[:at], *[case[at]] * chance.choice((1, 3, 200)), *case[at:]]


def _swap(case: Case, chance: random.Random) -> Case:
    a, b = chance.randrange(len(case)), chance.randrange(len(case))
    found = list(case)
    found[a], found[b] = (case[a][0], *case[b][1:]), (case[b][0], *case[a][1:])
    return found


def _silence(case: Case, chance: random.Random) -> Case:
    identifier, first = chance.choice(case)[1], chance.randrange(TICKS)
    return [entry for entry in case if entry[1] != identifier or entry[0] < first]


def _strange(case: Case, chance: random.Random) -> Case:
    """An error frame, a joystick's frame, a standard frame, a frame of nobody, of any length."""
    sort = chance.choice((0x04, 0x08, 0x40, 0x80, 0x100, chance.getrandbits(9)))
    identifier = chance.choice((ERROR | sort, BJM | EXTENDED, chance.getrandbits(11), chance.getrandbits(32)))
    data = chance.randbytes(chance.randint(0, 8)).hex()
    at = 0 if identifier == BJM | EXTENDED else chance.randrange(len(case))
    return [*case[:at], (case[at][0], identifier, data), *case[at:]]
