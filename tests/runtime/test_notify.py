"""What the service manager is told, by a stand-in for it; and the units that it reads."""

import os
import shutil
import socket
import subprocess
from collections.abc import Iterator
from configparser import RawConfigParser
from pathlib import Path

import pytest

from runtime import realtime
from runtime.helpers import ROOT
from runtime.notify import Notifier
from runtime.shared import private_folder
from runtime.supervisor import Supervisor
from specs.errors import InputError
from specs.signals import definition
from tests.runtime.test_supervisor import machine  # noqa: F401  (a fixture)

UNITS = ROOT / "runtime" / "systemd"
SERVICE, BUS = UNITS / "slewright.service", UNITS / "slewright-can@.service"
WORST_EXPOSURE = 3.0  # of systemd-analyze security, 0 to 10; below 2 it calls a service "OK" or "SAFE"


class Manager:
    """A service manager's end of the socket."""

    def __init__(self, address: str) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind("\0" + address[1:] if address.startswith("@") else address)
        self._socket.setblocking(False)

    def heard(self) -> list[list[str]]:
        """Messages that have come since the last time, each as lines."""
        found = []
        while True:
            try:
                found.append(self._socket.recv(4096).decode().splitlines())
            except BlockingIOError:
                return found

    def close(self) -> None:
        self._socket.close()


@pytest.fixture(params=["file", "abstract"])
def address(request: pytest.FixtureRequest) -> Iterator[str]:
    folder = private_folder("slewright-test-")
    yield f"@slewright-test-{os.getpid()}" if request.param == "abstract" else str(folder / "notify")
    shutil.rmtree(folder)


def test_ready_once_then_the_watchdog_only_while_cycles_go_on(address: str) -> None:
    manager = Manager(address)
    environment = {"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "10000000", "HOME": "/"}
    told = Notifier.of(environment)
    assert environment == {"HOME": "/"}
    told.ticked(0, "starting")
    assert manager.heard() == []
    told.ticked(50, "STANDBY")
    told.ticked(50, "STANDBY")  # the control process has not gone on
    told.ticked(100, "ARMED")
    told.ending()
    expected = [["READY=1", "WATCHDOG=1", "STATUS=STANDBY"], ["WATCHDOG=1", "STATUS=ARMED"], ["STOPPING=1"]]
    assert manager.heard() == expected
    manager.close()
    told.ticked(150, "nobody listens any more, and nothing happens")
    told.close()


def test_without_a_service_manager_nothing_is_said() -> None:
    told = Notifier.of({})
    told.ticked(50, "STANDBY")
    told.close()


@pytest.mark.long
def test_the_runtime_says_when_it_works_and_when_it_ends(
    machine: Path,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder = private_folder("slewright-test-")
    manager = Manager(str(folder / "notify"))
    monkeypatch.setenv("NOTIFY_SOCKET", str(folder / "notify"))
    with Supervisor(machine, ticks=110) as supervisor:
        assert "NOTIFY_SOCKET" not in os.environ
        assert manager.heard() == []
        supervisor.run(lambda _: None)
    messages = manager.heard()
    manager.close()
    shutil.rmtree(folder)
    assert messages[0][:2] == ["READY=1", "WATCHDOG=1"]
    assert "signed by nobody" in messages[0][2]
    assert messages[-1] == ["STOPPING=1"]
    assert sum("READY=1" in lines for lines in messages) == 1


def unit(path: Path) -> RawConfigParser:
    found = RawConfigParser(strict=False)
    found.optionxform = str  # type: ignore[assignment]
    found.read_string(path.read_text())
    return found


def test_the_service_does_not_start_again_by_itself_and_has_the_rights_it_asks_for() -> None:
    service = unit(SERVICE)["Service"]
    assert (service["Restart"], service["Type"], service["KillMode"]) == ("no", "notify", "mixed")
    assert int(service["LimitRTPRIO"]) >= realtime.PRIORITY
    assert service["LimitMEMLOCK"] == "infinity"
    assert "RestrictRealtime" not in service
    assert "CPUSchedulingPolicy" not in service  # only the control process is real-time, by itself


def test_the_bus_has_the_bit_rate_of_the_specs() -> None:
    assert f"bitrate {definition().bus.bit_rate} restart-ms 100" in unit(BUS)["Service"]["ExecStartPre"]


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze: install systemd")
def test_systemd_understands_the_units_and_finds_little_exposed(tmp_path: Path) -> None:
    """Programs of the units are not here: a stand-in takes their place."""
    for path in (SERVICE, BUS):
        text = path.read_text().replace("/opt/slewright/bin/slewright", "/bin/true")
        (tmp_path / path.name.replace("@", "@can0")).write_text(text.replace("/usr/sbin/ip", "/bin/true"))
    environment = {**os.environ, "SYSTEMD_UNIT_PATH": f"{tmp_path}:"}
    line = ["systemd-analyze", "--man=no", "verify", *map(str, sorted(tmp_path.iterdir()))]
    done = subprocess.run(line, capture_output=True, text=True, check=False, env=environment)
    if "Failed to" in done.stderr and done.returncode and "unit" not in done.stderr:
        pytest.skip(f"systemd-analyze cannot work here: {done.stderr.strip().splitlines()[0]}")
    ours = [text for text in done.stderr.splitlines() if "slewright" in text]
    assert (done.returncode, ours) == (0, []), done.stderr
    limit = f"--threshold={round(10 * WORST_EXPOSURE)}"
    line = ["systemd-analyze", "--offline=yes", "--no-pager", limit, "security", str(tmp_path / SERVICE.name)]
    done = subprocess.run(line, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stdout[-300:] + done.stderr


def test_isolated_cores_may_be_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(realtime, "ISOLATED", tmp_path / "isolated")
    assert realtime.isolated() == set()
    (tmp_path / "isolated").write_text("998-999,1003\n")
    assert realtime.isolated() == {998, 999, 1003}
    realtime.check_core(999)
    with pytest.raises(InputError, match="core: 1000 is not one of this machine's"):
        realtime.check_core(1000)
