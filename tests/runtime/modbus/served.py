"""A Modbus server process for the tests, with the control process's side of it."""

import json
import shutil
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from runtime.image import INPUT, OUTPUT
from runtime.modbus.cells import create
from runtime.modbus.port import ModbusPort
from tests.conftest import ROOT


class Served:
    """The process, its ports, and the control process's port; a context."""

    def __init__(self, folder: Path, tls: dict[str, str] | None = None) -> None:
        self.folder, self.port = folder, ModbusPort(*create(folder))
        self.inputs, self.outputs = INPUT.new(), OUTPUT.new()
        ports = folder / "ports"
        told: dict[str, Any] = {"folder": str(folder), "host": "127.0.0.1", "port": 0, "ports": str(ports)}
        if tls:
            told["tls"] = {"port": 0, **tls}
        command = [sys.executable, "-m", "runtime.modbus.process", json.dumps(told)]
        self.process = subprocess.Popen(command, cwd=ROOT)
        deadline = time.monotonic() + 240
        while not ports.is_file() or not ports.read_text():
            assert self.process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
        found = json.loads(ports.read_text())
        self.plain, self.tls = found["plain"], found.get("tls", 0)

    def cycle(self, tick: int = 0) -> None:
        """What the control process does in a tick."""
        self.port.receive(self.inputs, tick)
        self.port.send(self.outputs, tick)

    def target(self, name: str) -> tuple[float, int, int]:
        """Value, age and status of an input."""
        i = INPUT.at(name)
        return tuple(self.inputs[key][i].item() for key in ("value", "age", "status"))  # type: ignore[return-value]

    def until(self, true: Any, seconds: float = 120.0) -> None:
        """Run cycles until something is true."""
        deadline = time.monotonic() + seconds
        while True:
            self.cycle()
            if true():
                return
            assert time.monotonic() < deadline
            time.sleep(0.01)

    def __enter__(self) -> "Served":
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        assert self.process.wait(20) == 0
        shutil.rmtree(self.folder, ignore_errors=True)


class Raw:
    """A client of our own: exactly these bytes."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=10)
        self.transaction = 0

    def ask(self, function: int, body: bytes, unit: int = 1) -> bytes:
        """Send a request, return the answer's function and body."""
        self.send(function, body, unit)
        return self.answer()

    def send(self, function: int, body: bytes, unit: int = 1) -> None:
        """Send a request."""
        self.transaction = (self.transaction + 1) & 0xFFFF
        self.socket.sendall(struct.pack(">HHHBB", self.transaction, 0, len(body) + 2, unit, function) + body)

    def answer(self) -> bytes:
        """The next answer."""
        head = self._exactly(6)
        return self._exactly(int.from_bytes(head[4:6], "big"))[1:]

    def _exactly(self, count: int) -> bytes:
        found = b""
        while len(found) < count:
            more = self.socket.recv(count - len(found))
            if not more:
                raise ConnectionError("the server hung up")
            found += more
        return found

    def read(self, function: int, address: int, count: int) -> list[int]:
        """Registers."""
        found = self.ask(function, struct.pack(">HH", address, count))
        assert found[0] == function, found.hex()
        return list(struct.unpack(f">{count}H", found[2:]))

    def write(self, address: int, *values: int) -> int:
        """Write registers; 0 or the exception code."""
        head = struct.pack(">HHB", address, len(values), 2 * len(values))
        found = self.ask(16, head + struct.pack(f">{len(values)}H", *values))
        return found[1] if found[0] & 0x80 else 0

    def close(self) -> None:
        """Hang up."""
        self.socket.close()
