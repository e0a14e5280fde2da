"""The machine's CANopen devices, simulated: encoders, inclinometers and valves, of `canopen.LocalNode`.

They stand in for hardware: object dictionary and SDO server are the library's, made from the generated EDS
files; NMT, SYNC, PDOs and the valve's states are here.  A device can be switched off, fall silent, report an
emergency, or be another one than it should.
"""

import logging
import threading
import time
from collections.abc import Mapping
from typing import Any

import can

from deployment.hil.machine import COMMANDS
from runtime.interfaces.beside import library
from specs import canopen
from specs.canopen import Node, Place, definition
from specs.canopen_eds import IDENTITY, RPDO_SET, TPDO_SET
from specs.generate import FOLDER
from specs.signals import definition as signals

RESETS = (0x81, 0x82)  # NMT: reset node, reset communication
OPERATIONAL, PREOPERATIONAL = 0x05, 0x7F
ACTIVE = 0b111  # of a valve's control word: DEVICE MODE ACTIVE
HOLD, UPPER, LOWER = (0x6314, 1), (0x6320, 1), (0x6321, 1)
FULL, LOOK_S = 16384, 0.01


def replaced() -> frozenset[int]:
    """Identifiers of the CAN messages whose signals all come from a device."""
    found = frozenset[int]()
    for name, message in signals().bus.messages.items():
        carried = {s.name for s in signals().signals.values() if s.can and s.can.message == name}
        found |= {message.frame_id} if carried and carried <= canopen.sent().keys() else frozenset()
    return found


class SimulatedDevice:
    """One device; `identity`: what object 0x1018 says, by sub-index, where that is not what the EDS does."""

    def __init__(self, node: Node, network: Any, identity: Mapping[int, int] | None = None) -> None:
        self._lib = library("canopen", "canopen", "canopen")
        self.node, self._network, self.identity = node, network, dict(identity or {})
        self._file = FOLDER / "canopen" / f"{node.device.name}.eds"
        self.on = self.operational = False
        self.values: dict[str, float] = {}
        self._local: Any = None
        self._sends: list[tuple[Place, int]] = []  # with its offset in counts
        self._taken, self._taken_ns = b"", 0
        self._beat_s, self._due_s = 0.0, 0.0  # between two heartbeats (0: none), and when the next is due

    def switch_on(self) -> None:
        """Power comes: a boot-up message, then pre-operational."""
        self._local = self._lib.LocalNode(self.node.id, str(self._file))
        for sub, value in self.identity.items():
            self._local.sdo[IDENTITY][sub].raw = value
        self._local.nmt.start_heartbeat = self._beat_every  # all devices' come from one thread
        self._network.add_node(self._local)
        self._network.subscribe(0, self._told)
        self.on = True
        self._boot()

    def switch_off(self) -> None:
        """Power goes."""
        self.silence()
        self.on = self.operational = False
        if self.node.id in self._network.nodes:
            del self._network[self.node.id]
        self._network.unsubscribe(0, self._told)

    def silence(self) -> None:
        """Its heartbeat stops, and nothing else."""
        self._beat_s = 0.0

    def beat(self, now_s: float) -> None:
        """Send the heartbeat, if it is due."""
        if self._beat_s and now_s >= self._due_s:
            self._due_s = now_s + self._beat_s
            self._network.send_message(canopen.HEARTBEAT + self.node.id, bytes([self._local.nmt._state]))

    def _beat_every(self, milliseconds: int) -> None:
        self._beat_s, self._due_s = milliseconds / 1000, 0.0

    def emergency(self, code: int, register: int) -> None:
        """It says that something is wrong; code 0: no longer."""
        self._local.emcy.send(code, register)

    def restart(self) -> None:
        """It starts anew by itself, and has forgotten what it was set to."""
        self.switch_off()
        self.switch_on()

    def sync(self) -> None:
        """A SYNC came: say what is measured."""
        if not self.operational or not self._sends:
            return
        bits = 0
        for place, offset in self._sends:
            raw = place.entry.raw(self.values.get(place.signal.name, place.signal.start)) + offset
            low, high = place.entry.raw_limits
            bits |= (min(max(raw, low), high) & ((1 << place.entry.bits) - 1)) << place.start
        length = sum(p.entry.bits for p, _ in self._sends) // 8
        self._network.send_message(canopen.TPDO1 + self.node.id, bits.to_bytes(length, "little"))

    def command(self) -> tuple[str, float]:
        """Which axis a valve moves, and how far it is open: where it is told to, or in its hold position."""
        place = self.node.takes[-1]
        stale = time.monotonic_ns() - self._taken_ns > self._number(RPDO_SET, 5) * 1_000_000
        if stale or not self.operational or self._taken[0] & ACTIVE != ACTIVE:
            return place.signal.name, self._number(*HOLD) / FULL
        wanted = int.from_bytes(self._taken[2:4], "little", signed=True)
        return place.signal.name, min(max(wanted, self._number(*LOWER)), self._number(*UPPER)) / FULL

    def _boot(self) -> None:
        self.operational = False
        self._network.send_message(canopen.HEARTBEAT + self.node.id, b"\0")
        self._local.nmt._state = PREOPERATIONAL

    def _told(self, _: int, data: bytes, at: float) -> None:
        """An NMT command came; the library's node has taken it, too."""
        if not self.on or len(data) != 2 or data[1] not in (0, self.node.id):
            return
        if data[0] in RESETS:
            self.silence()
            self._local.data_store.clear()
            for sub, value in self.identity.items():
                self._local.sdo[IDENTITY][sub].raw = value
            self._boot()
            return
        if self._local.nmt._state == OPERATIONAL and not self.operational:
            self._start()
        self.operational = self._local.nmt._state == OPERATIONAL

    def _start(self) -> None:
        """Its PDOs as it was set up; one that is not as the specs ask for is not sent."""
        if self.node.sends and self._mapped(TPDO_SET, self.node.sends):
            self._sends = [(p, self._offset(p)) for p in self.node.sends]
        if self.node.takes and self._mapped(RPDO_SET, self.node.takes):
            self._network.subscribe(canopen.RPDO1 + self.node.id, self._take)

    def _mapped(self, parameters: int, places: tuple[Place, ...]) -> bool:
        mapping = parameters + 0x200
        wanted = [p.entry.index << 16 | p.entry.sub << 8 | p.entry.bits for p in places]
        found = [self._number(mapping, i) for i in range(1, self._number(mapping, 0) + 1)]
        return found == wanted and not self._number(parameters, 1) >> 31

    def _offset(self, place: Place) -> int:
        """What it adds to what it measures, in counts."""
        wanted = f"{canopen.ZERO_OF}{place.signal.name}"
        key = next((k for k, text in self.node.write.items() if text == wanted), None)
        entry = self.node.device.object[key] if key else None
        return self._number(entry.index, entry.sub) if entry else 0

    def _take(self, _: int, data: bytes, at: float) -> None:
        if self.on and len(data) >= 4:
            self._taken, self._taken_ns = bytes(data), time.monotonic_ns()

    def _number(self, index: int, sub: int) -> int:
        found = self._local.object_dictionary[index]
        variable = found if hasattr(found, "data_type") else found[sub]
        return variable.decode_raw(self._local.get_data(index, sub))


class Devices:
    """All devices on one bus; a context, which leaves it."""

    def __init__(self, bus: can.BusABC, identities: Mapping[str, Mapping[int, int]] | None = None) -> None:
        lib = library("canopen", "canopen", "canopen")
        logging.getLogger("canopen").setLevel(logging.CRITICAL)
        self._network = lib.Network(bus)
        self._network.NOTIFIER_CYCLE = 0.1
        self._network.connect()
        told = identities or {}
        self.by_name = {
            n.name: SimulatedDevice(n, self._network, told.get(n.name)) for n in definition().nodes
        }
        self._network.subscribe(definition().bus.sync, self._sync)
        self._ended = threading.Event()
        self._beats = threading.Thread(target=self._beat, daemon=True)

    def __enter__(self) -> "Devices":
        for device in self.by_name.values():
            device.switch_on()
        self._beats.start()
        return self

    def __exit__(self, *about: object) -> None:
        self._ended.set()
        self._beats.join()
        for device in self.by_name.values():
            if device.on:
                device.switch_off()
        self._network.disconnect()

    def show(self, values: Mapping[str, float]) -> None:
        """What there is to be measured from now on."""
        for device in self.by_name.values():
            device.values = {
                p.signal.name: values[p.signal.name] for p in device.node.sends if p.signal.name in values
            }

    def commands(self) -> dict[str, float]:
        """How far the valves are open, by axis; one that is switched off is closed."""
        valves = [d for d in self.by_name.values() if d.node.takes and d.on]
        return {**dict.fromkeys(COMMANDS, 0.0), **dict(v.command() for v in valves)}

    def _beat(self) -> None:
        while not self._ended.wait(LOOK_S):
            for device in self.by_name.values():
                if device.on:
                    device.beat(time.monotonic())

    def _sync(self, _: int, data: bytes, at: float) -> None:
        for device in self.by_name.values():
            if device.on:
                device.sync()
