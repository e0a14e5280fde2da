"""tshark's J1939 dissector on our frames (skipped, visibly, where it is missing)."""

import shutil
import struct
import subprocess
from pathlib import Path

import pytest

from runtime.can.transmit import Transmitter
from runtime.can.wire import EXTENDED
from runtime.image import OUTPUT
from specs.signals import definition

SOCKETCAN = 227  # link type of captures of CAN


@pytest.mark.skipif(shutil.which("tshark") is None, reason="no tshark: install tshark")
def test_the_dissector_reads_priority_group_and_source(tmp_path: Path) -> None:
    sender, frames = Transmitter("Controller", OUTPUT.index), []
    for tick in range(5):
        frames += sender.due(OUTPUT.new()["value"].tolist(), tick)
    path = tmp_path / "can.pcap"
    with path.open("wb") as file:
        file.write(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, SOCKETCAN))
        for i, (frame_id, data) in enumerate(frames):
            packet = struct.pack(">IB3x", frame_id | EXTENDED, len(data)) + data
            file.write(struct.pack("<IIII", 0, i, len(packet), len(packet)) + packet)
    fields = ("j1939.priority", "j1939.pgn", "j1939.src_addr")
    command = ["tshark", "-r", str(path), "-d", "can.subdissector,j1939", "-T", "fields"]
    command += [part for name in fields for part in ("-e", name)]
    found = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert found.returncode == 0, found.stderr
    rows = [[int(n, 0) for n in line.split("\t")] for line in found.stdout.splitlines()]
    messages = {m.frame_id: m for m in definition().bus.messages.values()}
    assert rows == [[messages[i].priority, messages[i].pgn, messages[i].source] for i, _ in frames]
