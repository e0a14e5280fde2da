"""`slewright run --shadow` as on a machine: its processes on a bus, another node counts what it says."""

import shutil
import time
from pathlib import Path

import pytest

from runtime.can.busd import start_bus
from runtime.can.localbus import LocalBus
from runtime.recorder.reader import Recording, Seen, Tick
from runtime.shared import private_folder
from tests.conftest import Command
from tests.runtime.bundles import built

SECONDS = "1"
CONFIGURATION = """bundle = "{bundle}"
[can]
interface = "slewright"
channel = "{channel}"
[recorder]
folder = "{name}"
"""


@pytest.mark.long
def test_the_process_says_nothing_on_the_bus(slewright: Command, tmp_path: Path):
    """Without --shadow the same configuration does speak, so that the count can fail."""
    sockets = private_folder("slewright-bus-")
    bus = start_bus(sockets / "bus", 0)
    listener = LocalBus(str(sockets / "bus"), node="listener")
    said = {}
    try:
        for name in ("shadow", "control"):
            file = tmp_path / f"{name}.toml"
            text = CONFIGURATION.format(bundle=built("pd").folder, channel=sockets / "bus", name=name)
            file.write_text(text)
            options = ["--shadow"] if name == "shadow" else []
            done = slewright("run", "--config", file, "--seconds", SECONDS, *options)
            assert done.returncode == 0, done.stderr
            said[name] = count(listener)
    finally:
        listener.shutdown()
        bus.terminate()
        bus.wait()
        shutil.rmtree(sockets)
    assert said["shadow"] == 0
    assert said["control"] > 50
    recording = Recording(tmp_path / "shadow")
    kinds = [type(item) for item in recording.everything()]
    assert recording.metadata()["mode"] == "shadow"
    assert kinds.count(Tick) == kinds.count(Seen) > 10
    assert Recording(tmp_path / "control").metadata()["mode"] == "control"


def count(listener: LocalBus) -> int:
    """Frames that came."""
    time.sleep(0.1)
    found = 0
    while listener.recv_raw() is not None:
        found += 1
    return found
