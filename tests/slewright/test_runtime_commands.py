"""`slewright run` and `slewright replay`: what they refuse, and a recording repeated or not."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from runtime.configuration import Can, Configuration, Modbus, Ros2
from runtime.recorder.feed import Feed
from runtime.recorder.recorder import Recorder
from runtime.recorder.replay import bundle_of, identity
from runtime.recorder.segments import Disk, Folder
from runtime.ring import Ring
from runtime.supervisor import Supervisor
from slewright.commands.machine.run import who_may_write
from specs.errors import InputError
from specs.version import VERSION
from tests.conftest import Command
from tests.runtime.bundles import built, core
from tests.runtime.core.test_replay_core import Wild


def recording(folder: Path, core_identity: str, spoil: bool = False, **more: str) -> Path:
    ring = Ring.create(folder / "ring", 4 << 20)
    feed, running, wild = Feed(ring), core("pd"), Wild(1)
    metadata = {**identity(core_identity, VERSION), **more}
    recorder = Recorder(ring, Folder(folder / "out", 64 << 20), metadata, 300, Disk())
    for tick in range(600):
        image = wild.next(tick)
        feed.before(tick, running)
        outputs = running.step(image, tick).copy()
        if spoil and tick == 432:
            outputs["value"][1] += 0.25
        feed.tick(image, outputs, (tick * 20_000_000, 0, 0, 0, -1))
    recorder.work()
    recorder.close()
    return folder / "out"


def test_replay_repeats_a_recording_and_says_what_it_came_to(slewright: Command, tmp_path: Path):
    bundle = built("pd")
    path, figures = recording(tmp_path, bundle.identity), tmp_path / "replay.json"
    done = slewright("replay", path, "--bundle", bundle.folder, "--json", figures)
    assert done.returncode == 0, done.stderr
    assert "600 ticks repeated bit for bit" in done.stdout
    assert json.loads(figures.read_text())["ticks"] == 600


def test_replay_names_the_first_tick_that_differs(slewright: Command, tmp_path: Path):
    bundle = built("pd")
    done = slewright("replay", recording(tmp_path, bundle.identity, spoil=True), "--bundle", bundle.folder)
    assert done.returncode == 1
    assert "differs at tick 432: u_boom was" in done.stderr


def test_replay_refuses_a_recording_of_another_version(slewright_here: Command, tmp_path: Path):
    done = slewright_here("replay", recording(tmp_path, "another core"), "--bundle", built("pd").folder)
    assert done.returncode == 2
    assert "the recording was made with another control core: another core" in done.stderr


def test_replay_finds_the_bundle_that_ran_or_asks_for_it(slewright: Command, tmp_path: Path):
    folder = Path(shutil.copytree(built("pd").folder, tmp_path / "bundle"))
    ran = {"bundle": built("pd").digest, "bundle_folder": str(folder)}
    path = recording(tmp_path, built("pd").identity, False, **ran)
    assert slewright("replay", path).returncode == 0
    with pytest.raises(InputError, match="bundle holds another bundle than the one that ran"):
        bundle_of({**ran, "bundle": "0" * 64})
    with pytest.raises(InputError, match="does not say where its bundle was: name it with --bundle"):
        bundle_of({})
    folder.rename(tmp_path / "elsewhere")
    done = slewright("replay", path)
    assert done.returncode == 2
    assert f"the bundle that ran is not at {folder} any more: name it with --bundle" in done.stderr


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[can]\ninterface = "slewright"\nchannel = "bus"\n', "missing bundle"),
        ('bundle = "none"\n[can]\ninterface = "slewright"\nchannel = "bus"\n', "is no bundle"),
        ('bundle = "BUNDLE"\n[can]\ninterface = "slewright"\nchannel = "none"\n', "is no local bus"),
        (
            'bundle = "BUNDLE"\nunsigned = true\n[can]\ninterface = "socketcan"\nchannel = "can7"\n',
            "no CAN interface can7",
        ),
    ],
)
def test_run_refuses_at_the_start(tmp_path: Path, text: str, said: str):
    path = tmp_path / "machine.toml"
    path.write_text(text.replace("BUNDLE", str(built("pd").folder)))
    with pytest.raises(InputError, match=said):
        Supervisor(path)
    assert [p.name for p in tmp_path.iterdir()] == ["machine.toml"]


def test_run_says_it_in_a_line_and_exits_with_2(slewright_here: Command, tmp_path: Path):
    (tmp_path / "machine.toml").write_text('[can]\ninterface = "slewright"\nchannel = "bus"\n')
    done = slewright_here("run", "--config", tmp_path / "machine.toml")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "missing bundle" in done.stderr


@pytest.mark.parametrize(
    ("host", "said"),
    [
        ("127.0.0.1", "127.0.0.1: this computer only"),
        ("0.0.0.0", "0.0.0.0: every network of this computer"),
        ("10.0.0.3", "10.0.0.3: the network that has this address"),
    ],
)
def test_run_says_which_networks_and_who_may_write(host: str, said: str):
    wanted = Configuration(
        can=Can(interface="slewright", channel="bus"), bundle=Path("b"), modbus=Modbus(port=1502, host=host)
    )
    lines = who_may_write(cast(Supervisor, SimpleNamespace(wanted=wanted)))
    assert lines == [
        f"Modbus: port 1502 of {said}; whoever is on this computer may write, "
        "everybody else who reaches it may read"
    ]
    wanted = replace(wanted, modbus=None)
    assert (
        "from whoever sends them on CAN bus bus"
        in who_may_write(cast(Supervisor, SimpleNamespace(wanted=wanted)))[0]
    )


@pytest.mark.parametrize(
    ("ros2", "said"),
    [
        (Ros2(), "may look, nobody may command"),
        (Ros2(commands=True), "may command"),
        (Ros2(policy="/a/b"), "may look, a node that is named /a/b may command arm and slew"),
        (
            Ros2(commands=True, policy="/b"),
            "may send targets, a node that is named /b may command arm and slew",
        ),
    ],
)
def test_run_says_who_may_command_over_ros2(ros2: Ros2, said: str):
    wanted = Configuration(can=Can(interface="slewright", channel="bus"), bundle=Path("b"), ros2=ros2)
    line = who_may_write(cast(Supervisor, SimpleNamespace(wanted=wanted)))[0]
    assert line == f"ROS 2: domain 0 of this computer only; whoever is on it {said}"
