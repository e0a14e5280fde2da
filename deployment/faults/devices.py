"""Faults of CANopen devices, frame by frame, with the control process's own port (runtime/canopen/port.py).

In each tick the devices send what the input image says of their signals; the port puts it there again, as
they sent it.  What a fault changes is changed on the way.
"""

import ctypes
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from deployment.faults.drive import Drive, Frame, Moment, Wires
from deployment.faults.table import Fault, Outcome
from runtime.can.wire import BUS_OFF, ERROR
from runtime.canopen.cells import NODES
from runtime.canopen.port import CanopenPort
from runtime.canopen.start import identities
from runtime.image import INPUT, OUTPUT
from specs.canopen import EMERGENCY, HEARTBEAT, RPDO1, TPDO1, Node, definition
from specs.canopen_eds import eds
from specs.errors import InputError

Random = np.random.Generator
Change = Callable[[list[Frame], int], list[Frame]]
OPERATIONAL, BOOT_UP = b"\x05", b"\0"
BEGIN, WARM_TICKS = 1000, 40  # tick of the port at which the fault begins; before it: all devices are there
ENCODERS = tuple(n for n in definition().nodes if n.device.name == "encoder")
VALVES = tuple(n for n in definition().nodes if n.is_actuator)


class Twist:
    """A twist of the image: the devices' frames of each tick, changed, through the port."""

    def __init__(self, library: ctypes.CDLL, change: Change) -> None:
        self.wires, self._change = Wires(), change
        self.port = CanopenPort(self.wires, library)
        self.port.accept([1] * NODES)
        self._outputs = OUTPUT.new()

    def __call__(self, k: int, image: np.ndarray) -> None:
        """Tick k of the fault."""
        if k == 0:
            for tick in range(BEGIN - WARM_TICKS, BEGIN):
                self._tick(frames(image), tick, image.copy())
        self._tick(self._change(frames(image), k), BEGIN + k, image)
        image["flags"] |= self.port.flags()

    def _tick(self, waiting: list[Frame], tick: int, image: np.ndarray) -> None:
        self.wires.waiting.extend(waiting)
        self.port.receive(image, tick)
        self.port.send(self._outputs, tick)


def frames(image: np.ndarray) -> list[Frame]:
    """What all devices send in a tick: heartbeats, and PDOs with what the image says."""
    found: list[Frame] = [(HEARTBEAT + n.id, OPERATIONAL) for n in definition().nodes]
    for node in definition().nodes:
        bits = 0
        for place in node.sends:
            raw = place.entry.raw(float(image["value"][INPUT.index[place.signal.name]]))
            bits |= (raw & ((1 << place.entry.bits) - 1)) << place.start
        if node.sends:
            length = sum(p.entry.bits for p in node.sends) // 8
            found.append((TPDO1 + node.id, bits.to_bytes(length, "little")))
    return found


def _one(nodes: tuple[Node, ...], random: Random) -> Node:
    return nodes[int(random.integers(len(nodes)))]


def _without(random: Random, nodes: tuple[Node, ...], *services: int) -> Change:
    node = _one(nodes, random)
    gone = {service + node.id for service in services}
    return lambda found, k: [f for f in found if f[0] not in gone]


def _restarted(random: Random) -> Change:
    node = _one(ENCODERS, random)
    return lambda found, k: [(HEARTBEAT + node.id, BOOT_UP), *found] if k == 0 else found


def _emergency(random: Random) -> Change:
    node = _one((*ENCODERS, *VALVES), random)
    code, register = int(random.integers(0x1000, 0xFFFF)), int(random.integers(1, 256)) | 1
    data = code.to_bytes(2, "little") + bytes([register]) + random.bytes(5)
    return lambda found, k: [*found, (EMERGENCY + node.id, data)] if k == 0 else found


def _short(random: Random) -> Change:
    node, left = _one(ENCODERS, random), int(random.integers(0, 6))
    return lambda found, k: [(i, d[:left] if i == TPDO1 + node.id else d) for i, d in found]


def _second(random: Random) -> Change:
    """It says that it stands elsewhere, before the device or after it."""
    node, first, away = _one(ENCODERS, random), bool(random.integers(2)), int(random.integers(1, 2000))

    def change(found: list[Frame], k: int) -> list[Frame]:
        data = dict(found)[TPDO1 + node.id]
        moved = (int.from_bytes(data[:4], "little") + away).to_bytes(4, "little")
        other = (TPDO1 + node.id, moved + data[4:])
        return [other, *found] if first else [*found, other]

    return change


def _bus_off(random: Random) -> Change:
    return lambda found, k: [] if k else [(ERROR | BUS_OFF, bytes(8))]


def _other_master(random: Random) -> Change:
    """Now and then, as a second controller would."""
    identifiers, every = [definition().bus.sync, *(RPDO1 + v.id for v in VALVES)], int(random.integers(1, 20))
    which = int(random.choice(identifiers))
    data = b"" if which == definition().bus.sync else random.bytes(4)
    return lambda found, k: found if k % every else [*found, (which, data)]


CHANGES: dict[str, Callable[[Random], Change]] = {
    "canopen_sensor_lost": lambda random: _without(random, ENCODERS, HEARTBEAT, TPDO1),
    "canopen_valve_lost": lambda random: _without(random, VALVES, HEARTBEAT),
    "canopen_heartbeat_lost": lambda random: _without(random, ENCODERS, HEARTBEAT),
    "canopen_restarted": _restarted,
    "canopen_emergency": _emergency,
    "canopen_short_pdo": _short,
    "canopen_second_sender": _second,
    "canopen_bus_off": _bus_off,
    "canopen_other_master": _other_master,
}


def _maker(name: str) -> Callable[[ctypes.CDLL, Random], Twist]:
    return lambda library, random: Twist(library, CHANGES[name](random))


MAKERS = {name: _maker(name) for name in CHANGES}


def canopen_eds_mismatch(
    fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome
) -> None:
    """A maker's EDS without an object that is needed, or with it read-only or of another type."""
    node = _one(definition().nodes, random)
    needed = [*(e for e, _ in node.written({})), *(p.entry for p in (*node.sends, *node.takes))]
    entry = needed[int(random.integers(len(needed)))]
    section = f"[{entry.index:04X}{f'sub{entry.sub:X}' if entry.sub else ''}]"
    before, _, after = eds(node.device).partition(section)
    ways = ("[2FFF]" + after, section + after.replace("DataType=0x", "DataType=0x1", 1))
    text = before + ways[int(random.integers(len(ways)))]
    with tempfile.TemporaryDirectory(prefix="slewright-eds-") as folder:
        path = Path(folder) / "maker.eds"
        path.write_text(text)
        try:
            identities({node.name: path})
            why = f"{section} of {node.name} was taken"
        except InputError as error:
            why = "" if entry.shown in str(error) else f"{entry.shown} is not named: {error}"
    outcome.add(moment.tick, 0.0, why)
