"""The server process over real sockets: what is shown, limits, ownership, loss of client and server."""

import os
import signal
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from pymodbus.client import ModbusTcpClient

from runtime.image import INPUT, OUTPUT, Flag, Status
from runtime.modbus.cells import placed
from runtime.modbus.holding import CLAIM, COMMIT, HEARTBEAT
from runtime.shared import private_folder
from specs.signals import definition
from specs.tables import header_values
from tests.runtime.modbus.served import Raw, Served
from tests.runtime.modbus.test_holding import FIRST, body

TABLES = definition().modbus.tables
SERVICES = definition().modbus.services
PLACE = {s.name: p for t in ("input", "holding") for s, p in placed(t)}
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE, BUSY, NO_TARGET = 1, 2, 3, 6, 11


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    with Served(private_folder()) as found:
        yield found


@pytest.fixture
def client(served: Served) -> Iterator[Raw]:
    found = Raw(served.plain)
    yield found
    found.close()
    time.sleep(0.02)


def number(registers: list[int], name: str) -> float:
    """A signal's value in a table's registers."""
    place = PLACE[name]
    words = registers[place.address : place.registers.stop]
    return struct.unpack(">f", struct.pack(">2H", *words))[0] if len(words) == 2 else words[0]


def test_the_whole_input_table_in_one_request(served: Served, client: Raw) -> None:
    served.inputs["value"][INPUT.at("q_slew")] = 1.5
    served.inputs["status"][INPUT.at("q_slew")] = Status.OK
    served.outputs["value"][OUTPUT.at("control_mode")] = 3
    served.outputs["value"][OUTPUT.at("load_estimate")] = 812.5
    served.cycle()
    registers = client.read(4, 0, TABLES["input"].body.stop)
    assert registers[:5] == header_values(TABLES["input"])
    assert number(registers, "q_slew") == 1.5
    assert number(registers, "control_mode") == 3
    assert number(registers, "load_estimate") == 812.5
    assert number(registers, "q_boom") != number(registers, "q_boom"), "never came: not a number"
    assert number(registers, "machine_ready") == 0xFFFF
    assert registers[SERVICES["image_age_ms"].address] < 10_000
    assert registers[SERVICES["connections"].address] >= 1


def test_what_the_control_process_no_longer_publishes_is_not_shown(served: Served, client: Raw) -> None:
    served.cycle()
    time.sleep(0.6)
    registers = client.read(4, 0, TABLES["input"].body.stop)
    assert registers[:5] == header_values(TABLES["input"])
    assert number(registers, "control_mode") == 0xFFFF
    assert registers[SERVICES["image_age_ms"].address] >= 500


def test_limits_of_requests(served: Served, client: Raw) -> None:
    for function in (3, 4):
        assert client.ask(function, struct.pack(">HH", 0, 0)) == bytes((function | 0x80, ILLEGAL_VALUE))
        assert client.ask(function, struct.pack(">HH", 0, 126)) == bytes((function | 0x80, ILLEGAL_VALUE))
        assert client.ask(function, struct.pack(">HH", 200, 1)) == bytes((function | 0x80, ILLEGAL_ADDRESS))
    assert client.ask(4, struct.pack(">HH", 0, 125)) == bytes((0x84, ILLEGAL_ADDRESS)), "the table is shorter"
    assert client.ask(4, struct.pack(">HH", 0xFFFF, 2)) == bytes((0x84, ILLEGAL_ADDRESS))
    too_many = struct.pack(">HHB", 5, 124, 248) + bytes(248)
    with pytest.raises(ConnectionError):  # longer than a request can be
        client.ask(16, too_many)


def test_the_longest_write_is_looked_at(client: Raw) -> None:
    assert client.ask(16, struct.pack(">HHB", 5, 123, 246) + bytes(246))[1] == ILLEGAL_ADDRESS
    assert client.ask(16, struct.pack(">HHB", 5, 2, 6) + bytes(6))[1] == ILLEGAL_VALUE


def test_functions_and_units(client: Raw) -> None:
    for function in (1, 2, 5, 15, 7, 8, 11, 17, 20, 24, 99):
        assert client.ask(function, bytes(4)) == bytes((function | 0x80, ILLEGAL_FUNCTION))
    assert client.ask(4, struct.pack(">HH", 0, 1), unit=2) == bytes((0x84, NO_TARGET))
    assert client.ask(4, struct.pack(">HH", 0, 1), unit=255)[0] == 4


def test_requests_that_come_together_are_answered_in_order(client: Raw) -> None:
    for address in range(10):
        client.send(4, struct.pack(">HH", address, 1))
    answers = [int.from_bytes(client.answer()[2:], "big") for _ in range(10)]
    assert answers[:5] == header_values(TABLES["input"])


def test_targets_reach_the_control_process_and_lapse(served: Served, client: Raw) -> None:
    assert client.write(FIRST, *body(target_x=7.25, target_valid=1, planner_heartbeat=1), 1, 42) == 0
    served.until(lambda: served.target("target_x")[2] == Status.OK)
    assert served.target("target_x")[0] == 7.25
    registers = client.read(4, 0, TABLES["input"].body.stop)
    assert [registers[SERVICES[k].address] for k in ("committed", "heartbeat_seen")] == [1, 1]
    assert registers[SERVICES["owner"].address] not in (0, 42, 0xFFFF)
    assert 42 not in client.read(3, 0, TABLES["holding"].body.stop)
    other = Raw(served.plain)
    assert other.write(HEARTBEAT, 2) == BUSY
    for beat in range(2, 8):
        assert client.write(HEARTBEAT, beat) == 0
        time.sleep(0.05)
        served.cycle()
        assert served.target("target_x")[2] == Status.OK
    assert other.write(CLAIM, 42) == BUSY  # it is there
    client.close()  # it named itself: it alone may come back, and goes on
    served.until(lambda: other.write(CLAIM, 42) == 0)
    assert other.write(HEARTBEAT, 9) == 0
    served.cycle()
    other.close()
    served.until(lambda: served.target("target_x")[2] in (Status.TIMEOUT, Status.NEVER))
    served.until(lambda: served.target("target_x")[2] == Status.NEVER)
    assert served.target("target_valid")[0] == 0


def test_an_unnamed_writer_is_gone_with_its_connection(served: Served, client: Raw) -> None:
    served.until(lambda: client.write(HEARTBEAT, 1) == 0)
    assert client.write(FIRST, *body(target_x=3.0, planner_heartbeat=2), 1) == 0
    served.until(lambda: served.target("target_x")[2] == Status.OK)
    client.close()
    served.until(lambda: served.target("target_x")[2] == Status.NEVER)


def test_refused_writes_are_counted(served: Served, client: Raw) -> None:
    at = SERVICES["refused_writes"].address
    before = client.read(4, at, 1)[0]
    assert client.write(0, 1) == ILLEGAL_ADDRESS
    assert client.write(HEARTBEAT, 251) == ILLEGAL_VALUE
    assert client.read(4, at, 1)[0] == before + 2


def test_what_is_no_modbus_ends_the_connection_and_nobody_elses(served: Served, client: Raw) -> None:
    for garbage in (b"GET / HTTP/1.1\r\n\r\n", struct.pack(">HHH", 1, 0, 60000) + bytes(20), b"\0" * 12):
        stranger = Raw(served.plain)
        stranger.socket.sendall(garbage)
        with pytest.raises((ConnectionError, OSError)):
            stranger.answer()
        stranger.close()
    assert client.read(4, 0, 2) == header_values(TABLES["input"])[:2]


def test_pymodbus_own_client(served: Served) -> None:
    with ModbusTcpClient("127.0.0.1", port=served.plain) as client:
        found = client.read_input_registers(0, count=5, device_id=1)
        assert found.registers == header_values(TABLES["input"])
        who = client.read_device_information(device_id=1)
        assert vars(who)["information"][0] == b"Slewright"


def test_a_server_that_dies_is_seen(tmp_path: Path) -> None:
    folder = private_folder()
    served = Served(folder)
    served.until(lambda: not served.port.flags())
    os.kill(served.process.pid, signal.SIGKILL)
    served.process.wait(10)
    served.until(lambda: served.port.flags() == Flag.MODBUS_LOST)
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()


def test_a_port_in_use_is_refused(served: Served, tmp_path: Path) -> None:
    import json
    import subprocess
    import sys

    from runtime.modbus.cells import create

    create(tmp_path)
    told = {"folder": str(tmp_path), "host": "127.0.0.1", "port": served.plain}
    command = [sys.executable, "-m", "runtime.modbus.process", json.dumps(told)]
    found = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert found.returncode == 2
    assert f"port {served.plain} of 127.0.0.1 cannot be had" in found.stderr
    assert "Traceback" not in found.stderr
    assert COMMIT + 1 == CLAIM
