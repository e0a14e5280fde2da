"""The real CANopen process, on a real local bus, with devices of `canopen` or made of bytes."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from runtime.can.busd import start_bus
from runtime.can.localbus import LocalBus
from runtime.canopen import cells
from runtime.canopen.start import identities
from runtime.interfaces.told import Listener
from runtime.shared import private_folder
from specs.canopen import definition
from tests.conftest import ROOT

PATIENCE_S = 120.0


def until(true: Callable[[], Any]) -> Any:
    """Wait until something is true, and return it."""
    end = time.monotonic() + PATIENCE_S
    while not (found := true()):
        assert time.monotonic() < end
        time.sleep(0.01)
    return found


class Master:
    """The process and its cells; a context."""

    def __init__(self, zeros: dict[str, float] | None = None) -> None:
        self._stack = ExitStack()
        self.folder = private_folder("slewright-test-")
        self.channel = self.folder / "bus"
        self.bus = start_bus(self.channel, definition().bus.bit_rate)
        self._stack.callback(self.bus.wait)
        self._stack.callback(self.bus.terminate)
        cells.create(self.folder)
        self._accepted, self._spent = cells.join(self.folder)
        self._listener, self._zeros = Listener(self.folder, "canopen"), zeros or {}
        self._said: list[str] = []
        self.process = self.start()

    def start(self) -> "subprocess.Popen[bytes]":
        """Start the process, also again."""
        told = {
            "folder": str(self.folder), "ready": str(self.folder / "ready"), "interface": "slewright",
            "channel": str(self.channel), "zeros": self._zeros,
            "identities": {n: list(i.named().values()) for n, i in identities({}).items()},
        }  # fmt: skip
        command = [sys.executable, "-m", "runtime.canopen.process", json.dumps(told)]
        with (self.folder / "console").open("ab") as console:
            self.process = subprocess.Popen(command, cwd=ROOT, stderr=console)
        return self.process

    def console(self) -> str:
        """All that the process wrote there."""
        return (self.folder / "console").read_text()

    def accepted(self) -> dict[str, int]:
        """The setting in force of each node; 0: none."""
        return dict(zip([n.name for n in definition().nodes], cells.read(self._accepted), strict=True))

    def spend(self, numbers: list[int]) -> None:
        """As the control process says that it no longer believes in these."""
        import numpy as np

        self._spent.write(np.array(numbers, np.int64))

    def said(self) -> str:
        """All that people were told so far."""
        self._said += [event["what"] for event in self._listener.new()]
        return "\n".join(self._said)

    def node(self) -> LocalBus:
        """Another end of the bus."""
        found = LocalBus(str(self.channel), node="other")
        self._stack.callback(found.shutdown)
        return found

    def __enter__(self) -> "Master":
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        self.process.wait(30)
        self._stack.close()
        for path in Path(self.folder).iterdir():
            path.unlink()
        self.folder.rmdir()


class ByHand(threading.Thread):
    """An encoder made of bytes: node 0x20, its object dictionary a dict of what was written and what it says.

    SDO as in CiA 301 (7.2.4.3): expedited downloads (0x2F, 0x2B, 0x23 for 1, 2, 4 bytes; answer 0x60) and
    uploads (0x40; answer 0x43 with four bytes), aborts (0x80); NMT commands; boot-up; a heartbeat each 50 ms.
    """

    NODE = 0x20

    def __init__(self, bus: LocalBus, objects: dict[tuple[int, int], int]) -> None:
        super().__init__(daemon=True)
        self._bus, self.objects, self.written = bus, objects, list[tuple[int, int, bytes]]()
        self.commands: list[int] = []
        self.state, self.beats, self.ended = 0x7F, True, False
        self.refused: tuple[int, int] | None = None
        self.nonsense: Callable[[], bytes] | None = None  # in the place of answers

    def run(self) -> None:
        """Live until `ended`."""
        self.boot()
        due = time.monotonic()
        while not self.ended:
            found = self._bus.recv_raw()
            if found:
                self._take(found[0], found[1])
            else:
                time.sleep(0.001)
            if self.beats and time.monotonic() >= due:
                due = time.monotonic() + 0.05
                self._send(0x700 + self.NODE, bytes([self.state]))

    def boot(self) -> None:
        """It starts anew."""
        self.state = 0x7F
        self._send(0x700 + self.NODE, b"\x00")

    def emergency(self, data: str) -> None:
        """An emergency of these bytes."""
        self._send(0x080 + self.NODE, bytes.fromhex(data))

    def heartbeat(self, data: bytes) -> None:
        """A heartbeat of these bytes."""
        self._send(0x700 + self.NODE, data)

    def _send(self, identifier: int, data: bytes) -> None:
        self._bus.send_raw(identifier, data)

    def _take(self, identifier: int, data: bytes) -> None:
        if identifier == 0 and data[1] in (0, self.NODE):
            self.commands.append(data[0])
            self.state = {0x01: 0x05, 0x80: 0x7F, 0x02: 0x04}.get(data[0], self.state)
            if data[0] in (0x81, 0x82):
                self.boot()
        elif identifier == 0x600 + self.NODE:
            self._send(0x580 + self.NODE, self.nonsense() if self.nonsense else self._answer(data))

    def _answer(self, data: bytes) -> bytes:
        where = data[1:4]
        key = int.from_bytes(where[:2], "little"), where[2]
        size = {0x2F: 1, 0x2B: 2, 0x23: 4}.get(data[0], 0)
        if key == self.refused or (key not in self.objects and not size):
            return b"\x80" + where + bytes.fromhex("00 00 02 06")  # 0x06020000: object does not exist
        if size:
            self.written.append((*key, data[4 : 4 + size]))
            self.objects[key] = int.from_bytes(data[4 : 4 + size], "little")
            return b"\x60" + where + bytes(4)
        return b"\x43" + where + self.objects[key].to_bytes(4, "little")
