"""The process behind the local bus: `python -m runtime.can.busd SOCKET [--bit-rate 250000]`.

It lets frames take their time on the wire (runtime/can/wire.py) and hands them to the other nodes; who does
not take them in time loses them, and is told by an error frame.  A packet of a node holds a frame or several.
Tests and the fault runs also talk to it: a packet {"do": …} on a connection of its own spoils frames, cuts
cables, switches nodes off, tells the state.
"""

import argparse
import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from runtime.can.wire import PACKET, QUEUE_BYTES, Frame, Node, Spoiling, Wire, overflow
from runtime.child import end_with_parent
from specs.errors import InputError
from specs.signals import definition

BACKLOG = 64  # frames that a node may have waiting; then its socket is not read, and its sends fail
AT_ONCE = 16  # frames read from a node before the others have their turn
PATH_LIMIT = 107  # bytes of a Unix socket's name


class BusProcess:
    """Sockets around a wire."""

    def __init__(self, path: Path, wire: Wire) -> None:
        self.wire, self.path = wire, path
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._listener.bind(str(path))
        self._listener.listen(32)
        self._nodes: dict[socket.socket, Node | None] = {}  # None: has not said who it is
        self._lost: dict[Node, int] = {}
        self.running = True
        # a signal that comes just before the wait would be seen after it only, which may be never
        self._signalled, self._on_signal = socket.socketpair()
        self._on_signal.setblocking(False)
        signal.set_wakeup_fd(self._on_signal.fileno())

    def run(self) -> None:
        """Serve until told to stop."""
        while self.running:
            self.turn()

    def turn(self) -> None:
        """Wait for something to do, and do it."""
        event = self.wire.next_event()
        wait = None if event is None else max(0, event - time.monotonic_ns()) / 1e9
        full = {s for s, n in self._nodes.items() if n and len(n.queue) >= BACKLOG}
        waited = [self._listener, self._signalled, *(self._nodes.keys() - full)]
        ready, _, _ = select.select(waited, [], [], wait)
        for found in ready:
            if found is self._listener:
                self._accept()
            elif found is self._signalled:
                self.running = False
            else:
                self._read(found)
        self._deliver(self.wire.advance(time.monotonic_ns()))

    def _accept(self) -> None:
        connection, _ = self._listener.accept()
        connection.setblocking(False)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, QUEUE_BYTES)
        self._nodes[connection] = None

    def _read(self, connection: socket.socket) -> None:
        for _ in range(AT_ONCE):
            if connection not in self._nodes:  # it has just been left
                return
            try:
                packet = connection.recv(4096)
            except BlockingIOError:
                return
            except OSError:
                packet = b""
            if not packet:
                self._leave(connection)
                return
            self._packet(connection, packet)

    def _packet(self, connection: socket.socket, packet: bytes) -> None:
        node = self._nodes[connection]
        if packet[:1] == b"{" and len(packet) != PACKET.size and node is None:
            try:
                self._command(connection, packet)
            except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OSError):
                self._leave(connection)  # nothing that a node or a test says
        elif node is not None and len(packet) % PACKET.size == 0:
            for identifier, length, data, _ in PACKET.iter_unpack(packet):
                self.wire.offer(node, (identifier, data[: min(length, 8)]))

    def _command(self, connection: socket.socket, packet: bytes) -> None:
        order: dict[str, Any] = json.loads(packet)
        if "node" in order and "do" not in order:
            node = Node(str(order["node"]) or f"node {len(self.wire.nodes) + 1}")
            self._nodes[connection] = node
            self.wire.nodes.append(node)
            connection.send(b"ok")
        else:
            connection.send(json.dumps(self._obey(**order)).encode())

    def _obey(self, do: str, node: str | None = None, **more: Any) -> dict[str, Any]:
        """What tests ask for; unknown orders raise TypeError or KeyError."""
        meant = [n for n in self.wire.nodes if node in (None, n.name)]
        if do == "spoil":
            self.wire.spoilings.append(Spoiling(int(more["count"]), node, more.get("identifier")))
        elif do == "cut":
            for one in meant:
                one.silent = more["cut"]
        elif do == "off":
            for one in meant:
                self._deliver(self.wire.switch_off(one, time.monotonic_ns()))
        elif do == "stop":
            self.running = False
        elif do != "state":
            raise KeyError(do)
        nodes = {
            n.name: {"sent": n.sent, "tec": n.transmit_errors, "rec": n.receive_errors,
                     "off": n.off_until is not None, "lost": self._lost.get(n, 0)}
            for n in self.wire.nodes
        }  # fmt: skip
        return {"nodes": nodes, "busy_ns": self.wire.busy_ns}

    def _deliver(self, arrivals: Iterable[tuple[Node, Frame, int]]) -> None:
        ends = {node: connection for connection, node in self._nodes.items() if node}
        for node, frame, stamp in arrivals:
            self._give(ends.get(node), node, frame, stamp)

    def _give(self, connection: socket.socket | None, node: Node, frame: Frame, stamp: int) -> None:
        if connection is None:
            return
        try:
            if node in self._lost and self._lost[node] < 0:
                connection.send(_packed(overflow(node), stamp))
                self._lost[node] = -self._lost[node]
            connection.send(_packed(frame, stamp))
        except BlockingIOError:
            self._lost[node] = -(abs(self._lost.get(node, 0)) + 1)  # negative: it has yet to be told
        except OSError:
            pass  # it is leaving: its end is read next

    def _leave(self, connection: socket.socket) -> None:
        node = self._nodes.pop(connection)
        if node in self.wire.nodes:
            self.wire.nodes.remove(node)
        connection.close()

    def close(self) -> None:
        """End all connections."""
        signal.set_wakeup_fd(-1)
        for connection in (self._listener, self._signalled, self._on_signal, *self._nodes):
            connection.close()
        self.path.unlink(missing_ok=True)


def _packed(frame: Frame, stamp: int) -> bytes:
    return PACKET.pack(frame[0], len(frame[1]), frame[1], stamp)


def start_bus(path: Path, bit_rate: int | None = None) -> subprocess.Popen[bytes]:
    """Start the bus process and wait until it listens; `bit_rate` 0 takes no time, None is the specs'."""
    if len(str(path).encode()) > PATH_LIMIT:
        raise InputError(f"{path}: the name of a Unix socket has at most {PATH_LIMIT} bytes")
    if bit_rate is None:
        bit_rate = definition().bus.bit_rate
    command = [sys.executable, "-m", "runtime.can.busd", str(path), "--bit-rate", str(bit_rate)]
    command += ["--with-parent", str(os.getpid())]
    process = subprocess.Popen(command, stdout=subprocess.PIPE)
    assert process.stdout  # noqa: S101  (it was asked for)
    if process.stdout.readline() != b"ready\n":
        process.wait()
        raise InputError(f"no bus could be made at {path}: is one there already?")
    return process


def ask(path: Path, do: str, **more: Any) -> dict[str, Any]:
    """Give the bus process an order; the state of its nodes."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as connection:
        connection.settimeout(10)
        connection.connect(str(path))
        connection.send(json.dumps({"do": do, **more}).encode())
        return json.loads(connection.recv(65536))


def main() -> None:
    """Serve until told to stop or interrupted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("socket", type=Path)
    parser.add_argument("--bit-rate", type=int, default=250_000, help="0: frames take no time")
    parser.add_argument("--with-parent", type=int, help="end when this process, which started it, ends")
    wanted = parser.parse_args()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if wanted.with_parent:
        end_with_parent(wanted.with_parent)
        signal.signal(
            signal.SIGINT, signal.SIG_IGN
        )  # the parent is interrupted, too, and still needs the bus
    try:
        bus = BusProcess(wanted.socket, Wire(wanted.bit_rate))
    except OSError as error:
        sys.exit(f"{wanted.socket}: {error.strerror}")
    try:
        print("ready", flush=True)
        bus.run()
    except KeyboardInterrupt:
        pass
    finally:
        bus.close()


if __name__ == "__main__":
    main()
