"""The Modbus TCP server: pymodbus with the registers of `holding` and `showing`, plain and over TLS.

Functions 3, 4, 6, 16, 22, 23 and 43/14; a request has its answer before the next of its connection is looked
at, and what is no Modbus ends the connection.  Connections have their turns, one request each, the writer's
before every other; how much one sends delays nobody else.  The plain port takes writes
from this machine only; over TLS the client's certificate says what it may (`roles`).
"""

import asyncio
import ssl
import time
from contextvars import ContextVar
from functools import partial
from itertools import islice
from typing import Any, cast

from pymodbus.constants import ExcCodes
from pymodbus.exceptions import ModbusIOException
from pymodbus.framer import FramerType
from pymodbus.pdu import ExceptionResponse
from pymodbus.pdu.device import ModbusDeviceIdentification
from pymodbus.server import ModbusTcpServer, ModbusTlsServer
from pymodbus.server.requesthandler import ServerRequestHandler
from pymodbus.simulator import DataType, SimData, SimDevice
from pymodbus.transaction import TransactionManager

from runtime.hmi.cells import GRANT, Writer, state_of
from runtime.interfaces.seats import granted
from runtime.modbus.cells import BEAT_S
from runtime.modbus.holding import Event, Holding
from runtime.modbus.roles import common_name, may_write
from runtime.modbus.showing import Showing
from runtime.modbus.told import Teller
from runtime.places import is_near, keep_alive, leaves
from runtime.shared import Cell
from specs.errors import InputError
from specs.signals import definition
from specs.version import VERSION

READS, WRITES, IDENTIFY = (3, 4, 23), (6, 16, 22, 23), 43
FUNCTIONS = {*READS, *WRITES, IDENTIFY}
HEADER = 7  # bytes of the MBAP header, unit included
LONGEST = 254  # of its length field: unit, function and 252 bytes
PIPELINED = (
    16  # requests that may wait on one connection (the messaging guide's NumberMaxOfServerTransaction)
)
BUFFERED = PIPELINED * (6 + LONGEST)  # bytes after which a connection is not read until it had its turns
ROUND = 8  # requests that are answered before the writer is asked again
CONNECTIONS, KEPT = 64, 16  # places; those for this computer and for whoever may write
IDLE_NS, CHECK_NS = 60_000_000_000, 1_000_000_000  # without a request; between two looks at who is idle
HANDSHAKE_S = 5.0  # for TLS
_asking: ContextVar["Connection"] = ContextVar("asking")


class Connection(ServerRequestHandler):
    """One client: its requests one after the other, each when it is its turn."""

    def __init__(self, server: "_Serving") -> None:
        super().__init__(server, None, None, None)
        self.desk = server.desk
        self.writes = self.near = False
        self.name = self.peer = ""
        self.heard = time.monotonic_ns()
        self._received = bytearray()
        self._full = self._stuck = False  # not read from; its client does not take its answers

    def callback_connected(self) -> None:
        """See who it is, and whether there is room."""
        super().callback_connected()
        peer = self.transport.get_extra_info("peername") or ("", 0)
        local = bool(peer[0]) and is_near(peer[0])
        self.writes, self.name = local, f"{peer[0]}:{peer[1]}"
        secure = self.transport.get_extra_info("ssl_object")
        if secure is not None:
            certificate = secure.getpeercert(binary_form=True)
            self.writes = may_write(certificate)
            self.name = f"{common_name(certificate)} {self.name}".strip()
        self.peer = self.name.rpartition(":")[0]
        self.near = local or self.writes
        self._keep_alive()
        self.desk.enter(self)

    def _keep_alive(self) -> None:
        """Notice a peer that is gone without a word, and read no more at once than may wait."""
        transport: Any = self.transport
        end = transport.get_extra_info("socket")
        if end is not None:
            keep_alive(end)
        if hasattr(transport, "max_size"):
            transport.max_size = BUFFERED

    @property
    def busy(self) -> bool:
        """Whether it is the writer's, and keeps its place."""
        return self.desk.holding.owner is not None and self.desk.holding.owner.client is self

    def callback_disconnected(self, exc: Exception | None) -> None:
        """Forget it."""
        super().callback_disconnected(exc)
        self.desk.leave(self)

    def data_received(self, data: bytes) -> None:
        """Keep what came until its turn."""
        self._received += data
        transport: Any = self.transport
        if len(self._received) >= BUFFERED and transport is not None and not self._full:
            self._full = True
            transport.pause_reading()
        if self.waits():
            self.desk.turns.wait(self)

    def pause_writing(self) -> None:
        """Its client does not take what it asked for: nothing more is answered meanwhile."""
        self._stuck = True

    def resume_writing(self) -> None:
        """It does again."""
        self._stuck = False
        if self.waits():
            self.desk.turns.wait(self)

    def waits(self) -> bool:
        """Whether a whole request is there to be answered, or something that is none."""
        return self.transport is not None and not self._stuck and self._length() <= len(self._received)

    def _length(self) -> int:
        """Bytes of the next request; 0: what is there is none."""
        if len(self._received) < HEADER:
            return HEADER
        length = int.from_bytes(self._received[4:6], "big")
        right = self._received[2:4] == b"\0\0" and 2 <= length <= LONGEST
        return 6 + length if right else 0

    async def turn(self) -> None:
        """Answer one request."""
        length = self._length()
        if not length:
            self._received.clear()
            self.hang_up()
            return
        request = bytes(self._received[:length])
        del self._received[:length]  # from the front: the rest is not copied
        self.heard = time.monotonic_ns()
        _asking.set(self)
        await self._answer(request)
        transport: Any = self.transport
        if self._full and transport is not None and len(self._received) < BUFFERED // 2:
            self._full = False
            transport.resume_reading()

    async def _answer(self, request: bytes) -> None:
        transaction, unit, function = int.from_bytes(request[:2], "big"), request[6], request[7]
        try:
            if unit not in UNITS:
                self._except(transaction, unit, function, ExcCodes.GATEWAY_NO_RESPONSE)
            elif function not in FUNCTIONS:
                self._except(transaction, unit, function & 0x7F, ExcCodes.ILLEGAL_FUNCTION)
            else:
                TransactionManager.callback_data(self, request)
                await self.handle_request()
        except (ModbusIOException, IndexError, ValueError):  # the body is shorter than its function needs
            self._except(transaction, unit, function, ExcCodes.ILLEGAL_VALUE)

    def _except(self, transaction: int, unit: int, function: int, code: ExcCodes) -> None:
        answer = ExceptionResponse(function, code, device_id=unit, transaction=transaction)
        self.server_send(answer, None)

    def hang_up(self) -> None:
        """End it at once."""
        transport: Any = self.transport
        if transport is not None:
            transport.abort()


UNITS = (definition().modbus.unit_id, 0, 0xFF)  # 0 and 0xFF: the server itself, as the messaging guide has it


class Turns:
    """Whose requests are answered next: the writer's, then one of each of those that waited longest."""

    def __init__(self) -> None:
        self._waiting: dict[Connection, None] = {}  # in the order in which they came
        self._task: asyncio.Task[None] | None = None

    def wait(self, connection: Connection) -> None:
        """A request waits on a connection."""
        self._waiting[connection] = None
        if self._task is None or self._task.done():
            self._task = asyncio.ensure_future(self._run())

    async def _run(self) -> None:
        while self._waiting:
            for connection in self._round():
                del self._waiting[connection]
                if connection.waits():
                    await connection.turn()
                if connection.waits():
                    self._waiting[connection] = None
            await asyncio.sleep(0)  # what came meanwhile is read before the next round

    def _round(self) -> list[Connection]:
        """Those whose turn it is, each once."""
        writers = [c for c in self._waiting if c.busy]
        return writers + [c for c in islice(self._waiting, ROUND) if not c.busy]


class Desk:
    """What all connections share: both tables, their turns, and who is there."""

    def __init__(
        self,
        image: Cell,
        targets: Cell,
        grant: Cell | None = None,
        teller: Teller | None = None,
        seats: Cell | None = None,
    ) -> None:
        """`grant`, `seats`: in which the control process says whether HMI or an interface has the right to
        command; None where there is none.
        """
        self._grant, self._seats, self.teller = grant, seats, teller or Teller(None)
        self.holding = Holding(targets.write, self._taken, self._told)
        self.showing = Showing(image, self.holding)
        self.connections: set[Connection] = set()
        self.turns = Turns()
        self._displaced = self._checked = 0

    def enter(self, connection: Connection) -> None:
        """A new connection; if there is no place, somebody must leave."""
        leaving = leaves(self.connections, connection, CONNECTIONS, KEPT)
        if leaving is not connection:
            self.connections.add(connection)
        if leaving is not None:
            self._displaced += 1
            self.connections.discard(leaving)
            leaving.hang_up()

    def leave(self, connection: Connection) -> None:
        """A connection ended."""
        self.connections.discard(connection)
        self.holding.left(connection)

    def _told(self, event: Event, client: Any, why: str) -> None:
        self.teller.event(event, client.name if client else "somebody", why)

    def _taken(self) -> bool:
        if self._seats and granted(self._seats)[0]:
            return True
        found = state_of(self._grant, GRANT) if self._grant else None
        return found is not None and found["writer"] == Writer.HMI

    async def access(
        self,
        function: int,
        start: int,
        address: int,
        count: int,
        registers: list[int],
        values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        """pymodbus's action: fill in what is read, take what is written."""
        now = time.monotonic_ns()
        if values is not None:
            refusal = self.holding.write(_asking.get(), address, [int(v) for v in values], now)
            return ExcCodes(refusal.value) if refusal else None
        if function == 4:
            registers[: len(registers) - 1] = self.showing.registers(now, len(self.connections))
        else:
            registers[: len(registers) - 1] = self.holding.registers
        return None

    def device(self) -> SimDevice:
        """Both tables, and no coils."""
        tables = definition().modbus.tables
        blocks = [SimData(0, values=[0] * tables[t].body.stop, datatype=DataType.REGISTERS) for t in TABLES]
        none = SimData(0, values=[False] * 16, datatype=DataType.BITS)
        return SimDevice(0, simdata=([none], [none], [blocks[0]], [blocks[1]]), action=self.access)

    async def beat(self) -> None:
        """Give a sign of life, for ever."""
        while True:
            now = time.monotonic_ns()
            self.holding.lapse(now)
            self.holding.beat(now)
            self._look_around()
            await asyncio.sleep(BEAT_S)

    def _look_around(self) -> None:
        """Say who is there; now and then, end connections that ask for nothing."""
        writer = next((c.name for c in self.connections if c.busy), "")
        names = sorted(c.name for c in self.connections)
        held = self.holding
        self.teller.state(writer, names, CONNECTIONS, refused=held.refused, displaced=self._displaced)
        now = time.monotonic_ns()
        if now - self._checked < CHECK_NS:
            return
        self._checked = now
        for connection in [c for c in self.connections if not c.busy and now - c.heard > IDLE_NS]:
            connection.hang_up()


TABLES = ("holding", "input")


class _Serving:
    """Makes pymodbus's servers use our connections."""

    desk: Desk

    def callback_new_connection(self) -> Connection:
        """Called for each connection."""
        return Connection(self)


class _Plain(_Serving, ModbusTcpServer):
    pass


class _Secure(_Serving, ModbusTlsServer):
    pass


class Server:
    """Listens on a plain port and, with `context`, on one for TLS."""

    def __init__(
        self, desk: Desk, host: str, port: int, tls_port: int = 0, context: ssl.SSLContext | None = None
    ):
        self.desk = desk
        self.servers: list[Any] = [_Plain(desk.device(), address=(host, port), identity=_identity())]
        if context is not None:
            secure = _Secure(
                desk.device(), framer=FramerType.SOCKET, address=(host, tls_port), sslctx=context,
                identity=_identity(),
            )  # fmt: skip
            secure.call_create = partial(cast(Any, secure.call_create), ssl_handshake_timeout=HANDSHAKE_S)
            self.servers.append(secure)
        for server in self.servers:
            server.desk = desk

    async def listen(self) -> list[int]:
        """Start; the ports. InputError if one is in use."""
        for server in self.servers:
            host, port = server.comm_params.source_address
            if not await server.listen():
                raise InputError(f"modbus: port {port} of {host} cannot be had: is it in use?")
        return [server.transport.sockets[0].getsockname()[1] for server in self.servers]

    async def serve(self, stop: asyncio.Event) -> None:
        """Serve until `stop`."""
        beating = asyncio.ensure_future(self.desk.beat())
        waiting = asyncio.ensure_future(stop.wait())
        try:
            await asyncio.wait([beating, waiting], return_when=asyncio.FIRST_COMPLETED)
            if beating.done():
                beating.result()  # it ends only by failing
        finally:
            beating.cancel()
            for connection in list(self.desk.connections):
                connection.close()
            for server in self.servers:
                await server.shutdown()


def _identity() -> ModbusDeviceIdentification:
    names = {"VendorName": "Slewright", "ProductCode": "slewright", "MajorMinorRevision": VERSION}
    return ModbusDeviceIdentification(info_name=names)
