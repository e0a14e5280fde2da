"""The Modbus TCP server: pymodbus with the registers of `holding` and `showing`, plain and over TLS.

Functions 3, 4, 6, 16, 22, 23 and 43/14; a request has its answer before the next of its connection is looked
at, and what is no Modbus ends the connection.  The plain port takes writes from this machine only; over TLS
the client's certificate says what it may (`roles`).
"""

import asyncio
import ssl
import time
from collections import deque
from contextvars import ContextVar
from ipaddress import ip_address
from typing import Any

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
from runtime.modbus.cells import BEAT_S
from runtime.modbus.holding import Holding
from runtime.modbus.roles import may_write
from runtime.modbus.showing import Showing
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
CONNECTIONS = 64
_asking: ContextVar["Connection"] = ContextVar("asking")


class Connection(ServerRequestHandler):
    """One client: its requests one after the other."""

    def __init__(self, server: "_Serving") -> None:
        super().__init__(server, None, None, None)
        self.desk = server.desk
        self.writes = False
        self._received = b""
        self._waiting: deque[bytes] = deque()
        self._serving: asyncio.Task[None] | None = None

    def callback_connected(self) -> None:
        """See who it is."""
        super().callback_connected()
        self.writes = self._may_write()
        if len(self.desk.connections) >= CONNECTIONS:
            self._hang_up()
        else:
            self.desk.connections.add(self)

    def _may_write(self) -> bool:
        secure = self.transport.get_extra_info("ssl_object")
        if secure is not None:
            return may_write(secure.getpeercert(binary_form=True))
        peer = self.transport.get_extra_info("peername")
        return bool(peer) and ip_address(peer[0].split("%")[0]).is_loopback

    def callback_disconnected(self, exc: Exception | None) -> None:
        """Forget it."""
        super().callback_disconnected(exc)
        self.desk.connections.discard(self)
        self.desk.holding.left(self)

    def data_received(self, data: bytes) -> None:
        """Cut what came into requests."""
        self._received += data
        while len(self._received) >= HEADER:
            length = int.from_bytes(self._received[4:6], "big")
            if self._received[2:4] != b"\0\0" or not 2 <= length <= LONGEST:
                self._hang_up()
                return
            if len(self._received) < 6 + length:
                break
            self._waiting.append(self._received[: 6 + length])
            self._received = self._received[6 + length :]
        transport: Any = self.transport
        if len(self._waiting) >= PIPELINED and transport is not None:
            transport.pause_reading()
        if self._waiting and (self._serving is None or self._serving.done()):
            self._serving = asyncio.ensure_future(self._serve())

    async def _serve(self) -> None:
        _asking.set(self)
        while self._waiting and self.transport is not None:
            await self._answer(self._waiting.popleft())
        transport: Any = self.transport
        if transport is not None and not transport.is_reading():
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

    def _hang_up(self) -> None:
        transport: Any = self.transport
        if transport is not None:
            transport.abort()


UNITS = (definition().modbus.unit_id, 0, 0xFF)  # 0 and 0xFF: the server itself, as the messaging guide has it


class Desk:
    """What all connections share: both tables, and who is there."""

    def __init__(self, image: Cell, targets: Cell, grant: Cell | None = None) -> None:
        """`grant`: in which the control process says whether the HMI writes; None where there is none."""
        self._grant = grant
        self.holding = Holding(targets.write, self._taken)
        self.showing = Showing(image, self.holding)
        self.connections: set[Connection] = set()

    def _taken(self) -> bool:
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
            await asyncio.sleep(BEAT_S)


TABLES = ("holding", "input")


class _Serving:
    """Makes pymodbus's servers use our connections."""

    desk: Desk

    def callback_new_connection(self) -> Connection:
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
