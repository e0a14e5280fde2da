"""Other people's Modbus clients, and a dissector, on our server (skipped, visibly, where missing)."""

import ctypes
import ctypes.util
import os
import shutil
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from runtime.image import INPUT, OUTPUT, Status
from runtime.modbus.holding import CLAIM, COMMIT, HEARTBEAT
from runtime.shared import private_folder
from specs.signals import definition
from specs.tables import header_values
from tests.runtime.modbus.served import Raw, Served
from tests.runtime.modbus.test_holding import FIRST, body
from tests.runtime.modbus.test_server import PLACE

HEADER = header_values(definition().modbus.tables["input"])
MODBUS = ctypes.util.find_library("modbus")
needs_mbpoll = pytest.mark.skipif(shutil.which("mbpoll") is None, reason="no mbpoll: install mbpoll")
needs_libmodbus = pytest.mark.skipif(MODBUS is None, reason="no libmodbus: install libmodbus5")
needs_tshark = pytest.mark.skipif(shutil.which("tshark") is None, reason="no tshark: install tshark")
LIBMODBUS_ERRORS = 112345678  # MODBUS_ENOBASE: its errno is this and the exception code
BUSY = 6


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    with Served(private_folder()) as found:
        found.inputs["value"][INPUT.at("q_slew")] = -2.25
        found.inputs["status"][INPUT.at("q_slew")] = Status.OK
        found.outputs["value"][OUTPUT.at("control_mode")] = 3
        yield found


def released(served: Served) -> Raw:
    """A client of ours that knows that nobody writes."""
    client = Raw(served.plain)
    served.until(lambda: client.read(4, definition().modbus.services["owner"].address, 1) == [0])
    return client


def mbpoll(served: Served, *arguments: str) -> subprocess.CompletedProcess[str]:
    served.cycle()
    command = ["mbpoll", "-m", "tcp", "-p", str(served.plain), "-a", "1", "-0", "-1", "-q", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@needs_mbpoll
def test_mbpoll_reads_and_writes(served: Served) -> None:
    place = PLACE["q_slew"]
    found = mbpoll(served, "-t", "3:float", "-B", "-r", str(place.address), "127.0.0.1")
    assert f"[{place.address}]: \t-2.25" in found.stdout, found.stdout
    found = mbpoll(served, "-t", "3", "-r", "0", "-c", "5", "127.0.0.1")
    assert [f"[{i}]: \t{v}" in found.stdout for i, v in enumerate(HEADER)] == [True] * 5, found.stdout
    words = [*body(target_x=4.5, planner_heartbeat=1), 1, 77]
    found = mbpoll(served, "-t", "4", "-r", str(FIRST), "127.0.0.1", "--", *map(str, words))
    assert found.returncode == 0, found.stdout + found.stderr
    served.cycle()
    assert served.target("target_x")[0] == 4.5
    found = mbpoll(served, "-t", "4", "-r", str(HEARTBEAT), "127.0.0.1", "9")
    assert found.returncode != 0
    assert "busy" in (found.stdout + found.stderr).lower()


class LibModbus:
    """libmodbus by ctypes; a context."""

    def __init__(self, port: int) -> None:
        assert MODBUS
        self.lib = ctypes.CDLL(MODBUS, use_errno=True)
        self.lib.modbus_new_tcp.restype = ctypes.c_void_p
        self.lib.modbus_get_float_abcd.restype = ctypes.c_float
        self.handle = ctypes.c_void_p(self.lib.modbus_new_tcp(b"127.0.0.1", port))
        assert self.lib.modbus_connect(self.handle) == 0

    def read(self, function: str, address: int, count: int) -> list[int]:
        found = (ctypes.c_uint16 * count)()
        done = getattr(self.lib, f"modbus_read_{function}")(self.handle, address, count, found)
        assert done == count, os.strerror(ctypes.get_errno())
        return list(found)

    def write(self, address: int, *values: int) -> int:
        data = (ctypes.c_uint16 * len(values))(*values)
        done = self.lib.modbus_write_registers(self.handle, address, len(values), data)
        return 0 if done == len(values) else ctypes.get_errno() - LIBMODBUS_ERRORS

    def real(self, words: list[int]) -> float:
        return self.lib.modbus_get_float_abcd((ctypes.c_uint16 * 2)(*words))

    def __enter__(self) -> "LibModbus":
        return self

    def __exit__(self, *_: object) -> None:
        self.lib.modbus_close(self.handle)
        self.lib.modbus_free(self.handle)


@needs_libmodbus
def test_libmodbus_reads_and_writes(served: Served) -> None:
    released(served).close()
    served.cycle()
    with LibModbus(served.plain) as one, LibModbus(served.plain) as other:
        assert one.read("input_registers", 0, 5) == HEADER
        assert one.real(one.read("input_registers", PLACE["q_slew"].address, 2)) == -2.25
        assert one.write(FIRST, *body(target_y=-8.5, planner_heartbeat=1), 1) == 0
        assert other.write(HEARTBEAT, 3) == BUSY
        assert one.real(other.read("registers", PLACE["target_y"].address, 2)) == -8.5
        served.cycle()
        assert served.target("target_y")[0] == -8.5


@needs_tshark
def test_a_dissector_sees_what_was_meant(served: Served, tmp_path: Path) -> None:
    client = released(served)
    lines: list[str] = []

    def exchange(function: int, data: bytes) -> None:
        transaction = client.transaction + 1
        head = struct.pack(">HHHBB", transaction, 0, len(data) + 2, 1, function)
        lines.append(f"I\n000000 {(head + data).hex(' ')}\n")
        answer = client.ask(function, data)
        head = struct.pack(">HHHB", transaction, 0, len(answer) + 1, 1)
        lines.append(f"O\n000000 {(head + answer).hex(' ')}\n")

    exchange(4, struct.pack(">HH", 0, 5))
    exchange(16, struct.pack(">HHBH", COMMIT, 1, 2, 5))
    exchange(6, struct.pack(">HH", CLAIM, 0xFFFF))  # refused
    (tmp_path / "dump").write_text("".join(lines))
    ports = f"{40000},{502}"
    made = ["text2pcap", "-q", "-D", "-T", ports, str(tmp_path / "dump"), str(tmp_path / "pcap")]
    subprocess.run(made, check=True, capture_output=True, timeout=60)
    fields = (
        "mbtcp.len",
        "modbus.func_code",
        "modbus.reference_num",
        "modbus.word_cnt",
        "modbus.exception_code",
    )
    command = ["tshark", "-r", str(tmp_path / "pcap"), "-d", "tcp.port==502,mbtcp", "-T", "fields"]
    command += [part for name in (*fields, "_ws.malformed") for part in ("-e", name)]
    found = subprocess.run(command, check=True, capture_output=True, text=True, timeout=120)
    rows = [line.split("\t") for line in found.stdout.splitlines()]
    assert [row[1:5] for row in rows] == [
        ["4", "0", "5", ""],
        ["4", "", "", ""],
        ["16", str(COMMIT), "1", ""],
        ["16", str(COMMIT), "1", ""],
        ["6", str(CLAIM), "", ""],
        ["6", "", "", "3"],
    ], found.stdout + found.stderr
    assert not any("alformed" in line for line in found.stdout.splitlines())
    client.close()
