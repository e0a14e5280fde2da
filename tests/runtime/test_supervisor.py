"""Who starts and watches the runtime's processes: real ones, on a local bus without other nodes."""

import json
import os
import re
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from runtime.can.busd import start_bus
from runtime.can.codec import sent_by
from runtime.can.localbus import LocalBus
from runtime.can.wire import EXTENDED
from runtime.configuration import Retaining
from runtime.image import Flag
from runtime.recorder.reader import Recording
from runtime.retain.copies import COPIES, Folder, Retained
from runtime.shared import private_folder
from runtime.supervisor import Counts, NotBegunError, Supervisor, retained_layout
from slewright.commands.machine.run import _ended
from specs.errors import InputError, RunError
from tests.runtime.bench import FAULT
from tests.runtime.bundles import built
from tests.runtime.test_helpers import until


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Path]:
    """A configuration with a recorder and retained values, for a bus that is there; no rights asked for."""
    sockets = private_folder("slewright-test-")
    bus = start_bus(sockets / "bus")
    path = tmp_path / "machine.toml"
    path.write_text(
        f'bundle = "{built("pd").folder}"\n[can]\ninterface = "slewright"\nchannel = "{sockets / "bus"}"\n'
        '[realtime]\nfifo = false\nlock = false\n[recorder]\nfolder = "rec"\n[retain]\nfolder = "kept"\n'
    )
    yield path
    bus.terminate()
    bus.wait()
    (sockets / "bus").unlink(missing_ok=True)
    sockets.rmdir()


@pytest.mark.long
def test_it_runs_ends_and_leaves_whole_files_and_shows_what_it_lacks(machine: Path, monkeypatch):
    seen: list[Counts] = []
    monkeypatch.chdir(machine.parent)
    with Supervisor(Path(machine.name), ticks=60) as supervisor:
        with pytest.raises(InputError, match="rec is in use by another run"):
            Supervisor(machine)
        found = supervisor.run(seen.append)
        folder = supervisor.folder
    assert found["ticks"] + found["skipped_ticks"] >= 60
    assert found["flags_seen"] & (Flag.NO_REALTIME | Flag.NO_LOCK) == Flag.NO_REALTIME | Flag.NO_LOCK
    assert len(found["reasons"]) == 2
    assert found["restarts"] == {"recorder": 0, "retain": 0}
    recording = Recording(machine.parent / "rec")
    assert sum(1 for _ in recording.items()) > found["ticks"]
    assert recording.notes == []
    assert (machine.parent / "kept" / COPIES[0]).is_file()
    assert not folder.exists()


@pytest.mark.long
def test_a_killed_helper_comes_back_and_a_killed_control_process_does_not(machine: Path):
    with Supervisor(machine) as supervisor:
        until(lambda: supervisor.watch() is None and supervisor.now().ticks > 0)
        recorder = supervisor.helpers[0]
        before = recorder.pid
        os.kill(before, signal.SIGKILL)
        until(lambda: supervisor.watch() is None and recorder.pid != before)
        os.kill(supervisor.control.pid, signal.SIGKILL)
        with pytest.raises(RunError, match="ended with -9; the valves are neutral"):
            supervisor.run(lambda _: None)
        assert supervisor.control.starts == 1


def test_a_run_that_is_ended_before_its_first_cycle_says_so_and_interrupts_nobody_else(
    machine: Path, monkeypatch: pytest.MonkeyPatch
):
    supervisor = Supervisor(machine)
    monkeypatch.setattr(supervisor.control, "module", "tests.runtime.sleeper")  # never comes to a cycle
    with supervisor, pytest.raises(NotBegunError, match="before its first cycle"):
        supervisor.run(lambda _: None, stop=lambda: True)
    assert not supervisor.folder.exists()

    def not_begun(*_: object, **__: object) -> None:
        raise NotBegunError

    monkeypatch.setattr(supervisor, "run", not_begun)
    with pytest.raises(KeyboardInterrupt):  # for the command line: interrupted, exit code 130
        _ended(supervisor, lambda _: None)


@pytest.mark.long
def test_a_fault_that_was_kept_is_latched_from_the_first_cycle_on(machine: Path):
    names = Retaining(folder=machine.parent / "kept").signals
    (machine.parent / "kept").mkdir()
    kept = Retained(Folder(machine.parent / "kept"), retained_layout(names))
    kept.save({"ticks": 0.0, "fault_code": 7.0, "fault_signal": 101.0})
    seen: list[Counts] = []
    with Supervisor(machine, ticks=80) as supervisor:
        supervisor.run(seen.append)
    assert {(c.mode, c.fault) for c in seen if c.ticks} == {(FAULT, 7)}
    values = Retained(Folder(machine.parent / "kept"), retained_layout(names)).load()
    assert (values["fault_code"], values["fault_signal"]) == (7.0, 101.0)
    assert "load_estimate" not in values


@pytest.mark.long
def test_a_second_controller_on_the_bus_is_refused_and_the_first_goes_to_fault(machine: Path, capfd):
    """Nothing of the second reaches the bus; one that sends all the same stops the first."""
    elsewhere = machine.parent / "second"
    elsewhere.mkdir()
    second = elsewhere / "machine.toml"
    second.write_text(machine.read_text())
    with Supervisor(machine) as first:
        until(lambda: first.watch() is None and first.now().ticks > 0)
        with Supervisor(second) as other, pytest.raises(InputError, match="refused to start"):
            other.run(lambda _: None)
        said = capfd.readouterr().err.splitlines()
        assert [s for s in said if "real-time" not in s and "locked memory" not in s] == [
            "slewright: another controller sends on this bus: there can be one only"
        ]
        assert not first.now().flags_seen & Flag.OTHER_CONTROLLER
        channel = re.search(r'channel = "(.*)"', machine.read_text())
        assert channel
        intruder = LocalBus(channel[1], node="intruder")
        intruder.send_raw(sent_by("Controller")[0].message.frame_id | EXTENDED, bytes(8))
        until(lambda: bool(first.watch() is None and first.now().flags_seen & Flag.OTHER_CONTROLLER))
        intruder.shutdown()


@pytest.mark.long
def test_a_bus_that_went_away_and_came_back_is_said_and_clears_no_fault(tmp_path: Path, capfd):
    sockets = private_folder("slewright-test-")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    path = tmp_path / "machine.toml"
    path.write_text(
        f'bundle = "{built("pd").folder}"\n[can]\ninterface = "slewright"\nchannel = "{sockets / "bus"}"\n'
        f'[realtime]\nfifo = false\nlock = false\n[retain]\nfolder = "kept"\n[hmi]\nport = {port}\n'
    )
    names = Retaining(folder=tmp_path / "kept").signals
    (tmp_path / "kept").mkdir()
    kept = Retained(Folder(tmp_path / "kept"), retained_layout(names))
    kept.save({"ticks": 0.0, "fault_code": 7.0, "fault_signal": 101.0})
    buses = [start_bus(sockets / "bus")]
    others: list[LocalBus] = []
    modes: set[tuple[int, int]] = set()
    audit = tmp_path / "audit" / "audit-refused.jsonl"

    states: list[int] = []

    def look(now: Counts) -> None:
        states.append(now.bus_off)
        if now.ticks:
            modes.add((now.mode, now.fault))
            buses[0].kill()
            buses[0].wait()
        if now.bus_off and len(buses) == 1:
            (sockets / "bus").unlink()
            buses.append(start_bus(sockets / "bus"))
            others.append(LocalBus(str(sockets / "bus"), node="other"))
        if others:
            others[0].send_raw(0x18FF1080 | EXTENDED, bytes(8))

    with Supervisor(path) as supervisor:
        supervisor.run(look, lambda: states[-1:] == [0] and audit.exists() and "is back" in audit.read_text())
    said = capfd.readouterr().err
    assert "bus is gone or off; when it is there again at the same path, it is joined\n" in said
    assert "bus is back\n" in said
    assert modes == {(FAULT, 7)}
    assert [json.loads(x)["what"] for x in audit.read_text().splitlines()] == [
        "the CAN bus is gone or off",
        "the CAN bus is back",
    ]
    others[0].shutdown()
    buses[1].terminate()
    buses[1].wait()
    sockets.rmdir()
