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
from contextlib import ExitStack, contextmanager

from deployment.hil.loads import REGISTERS
from deployment.hil.planner import NUMBER
from deployment.hil.rig import HOST
from runtime.modbus.holding import CLAIM, COMMIT, HEARTBEAT
from runtime.modbus.server import CONNECTIONS
from specs.errors import RunError

READS = 2000
APART_S = 0.003  # between idle connections: they need not come at once
BUSY = 6  # Modbus exception


@contextmanager
def attacker(*words: object, module: str = __name__) -> Iterator[Callable[[], Callable[[], str]]]:
    """A process of `python -m MODULE WORDS…`: a call begins an attack, and gives what tells how it went."""
    command = [sys.executable, "-m", module, *map(str, words)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    stdin, stdout = process.stdin, process.stdout
    if stdin is None or stdout is None or stdout.readline() != "ready\n":
        raise RunError("the attacking clients did not start")

    def begin() -> Callable[[], str]:
        stdin.write("\n")
        stdin.flush()
        return lambda: stdout.readline().strip()

    try:
        yield begin
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


ATTACKS: dict[str, Callable[[int, ExitStack], str]] = {
    "modbus_reading_flood": _read_without_end,
    "modbus_second_writer": _write_beside,
    "modbus_idle_connections": _stay_idle,
}


def main(port: int, name: str) -> None:
    """Attack for each line that comes."""
    os.nice(19)
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
