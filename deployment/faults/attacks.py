"""Clients that attack the Modbus server, in a process: `python -m deployment.faults.attacks PORT NAME`.

For each line on standard input an attack begins, and what went wrong in it is said in a line (empty:
nothing); its connections stay until the next.  It stands for another computer: the plant, which is in real
time on this one, must not wait for it.
"""

import os
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress

from deployment.faults.lines import Lines
from deployment.hil.loads import CLIENTS, REGISTERS
from deployment.hil.planner import NUMBER
from deployment.hil.rig import HOST
from runtime.modbus.holding import CLAIM, COMMIT, HEARTBEAT
from runtime.modbus.server import CONNECTIONS
from specs.errors import RunError

READS, BURST_S = 2000, 0.2
APART_S = 0.003  # between idle connections: they need not come at once
BUSY = 6  # Modbus exception


class Attack:
    """What a process that attacks is told, and says; nobody waits for it."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._process, self._lines = process, Lines(process)
        self.said = ""  # what went wrong in the newest one that is over

    def begin(self) -> None:
        """Begin an attack; the one before is over."""
        if self._process.stdin:
            with suppress(BrokenPipeError):  # `over` says so
                self._process.stdin.write("\n")
                self._process.stdin.flush()

    @property
    def over(self) -> bool:
        """Whether it is over, since it was asked last."""
        found = self._lines.new()
        if self._lines.ended:
            self.said = "the attacking process ended"
        elif found:
            self.said = found[-1]
        return bool(found) or self._lines.ended


@contextmanager
def attacker(*words: object, module: str = __name__) -> Iterator[Attack]:
    """A process of `python -m MODULE WORDS…`, which attacks for each line, and says in one how it went."""
    command = [sys.executable, "-m", module, *map(str, words)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        if not process.stdout or process.stdout.readline() != "ready\n":
            raise RunError("the attacking clients did not start")
        yield Attack(process)
    finally:
        process.kill()
        process.wait()


def _connect(port: int, stack: ExitStack) -> socket.socket:
    return stack.enter_context(socket.create_connection((HOST, port), timeout=5.0))


def _request(function: int, *words: int) -> bytes:
    return struct.pack(f">HHHBB{len(words)}H", 1, 0, 2 + 2 * len(words), 1, function, *words)


def _read_without_end(port: int, stack: ExitStack) -> str:
    _connect(port, stack).sendall(_request(4, 0, REGISTERS) * READS)
    return ""


def _write_beside(port: int, stack: ExitStack) -> str:
    end, answers = _connect(port, stack), []
    for address, value in ((CLAIM, NUMBER), (HEARTBEAT, 7), (COMMIT, 999)):
        end.sendall(_request(6, address, value))
        answers.append(end.recv(64)[7:9])
    return "" if answers == [bytes((0x86, BUSY))] * 3 else f"answered {answers}"


def _stay_idle(port: int, stack: ExitStack) -> str:
    for _ in range(2 * CONNECTIONS):
        _connect(port, stack)
        time.sleep(APART_S)
    end = _connect(port, stack)
    end.sendall(_request(4, 0, 1))
    return "" if end.recv(64)[7:8] == b"\x04" else "another client was not answered"


def _flood(port: int, stack: ExitStack) -> str:
    """Twenty clients that ask as fast as they are answered."""
    ends, end = [_connect(port, stack) for _ in range(CLIENTS)], time.monotonic() + BURST_S
    while time.monotonic() < end:
        for one in ends:
            one.sendall(_request(4, 0, REGISTERS))
        for one in ends:
            one.recv(4096)
    return ""


ATTACKS: dict[str, Callable[[int, ExitStack], str]] = {
    "modbus_flooding": _flood,
    "modbus_reading_flood": _read_without_end,
    "modbus_second_writer": _write_beside,
    "modbus_idle_connections": _stay_idle,
}


def main(port: int, name: str) -> None:
    """Attack for each line that comes."""
    os.nice(0 if name == "modbus_flooding" else 19)  # a flood is to take what it can get
    print("ready", flush=True)
    stack = ExitStack()
    for _ in sys.stdin:
        stack.close()
        try:
            said = ATTACKS[name](port, stack)
        except OSError as error:
            said = f"the attack ended: {error}"
        print(said, flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
