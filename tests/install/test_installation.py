"""The guide (docs/how-to/installation.md) from a fresh Debian to a machine, with its own commands only.

Workstation and controller are fresh roots; the controller's is then started as a virtual machine, where its
remaining commands are executed and the simulated machine joins it over the kernel's virtual CAN bus.
"""

import json
import os
import shutil
import subprocess
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from runtime.can.codec import sent_by
from runtime.image import NODE
from runtime.realtime import PRIORITY
from tests.conftest import ROOT
from tests.install import guide, roots, vm

DELIVERY = Path("srv") / "slewright" / "dist" / "delivery.tar"


def test_every_block_has_a_place_and_those_without_one_are_said() -> None:
    found = guide.blocks()
    assert {block.place for block in found} == {*guide.PLACES, ""}
    text = guide.GUIDE.read_text()
    assert text.count("*not\nexecuted") + text.count("*not executed") == sum(not b.place for b in found)
    assert not [b.line for b in found if b.place == "running" and b.online]


def test_a_wrong_place_is_noticed(tmp_path: Path) -> None:
    (tmp_path / "guide.md").write_text("```sh somewhere\ntrue\n```\n")
    with pytest.raises(ValueError, match="a block for 'somewhere'"):
        guide.blocks(tmp_path / "guide.md")


@pytest.fixture(scope="module")
def scratch() -> Iterator[Path]:
    """Gigabytes, so not kept as other tests' files are; in SLEWRIGHT_KEEP the controller's root is, to be
    started once more without making it anew."""
    roots.need("mmdebstrap", "unshare", "git")
    if kept := os.environ.get("SLEWRIGHT_KEEP"):
        Path(kept).mkdir(parents=True, exist_ok=True)
        yield Path(kept)
        return
    with tempfile.TemporaryDirectory(prefix="run-", dir=roots.folder()) as folder:
        yield Path(folder)


def execute(root: Path, place: str, at: str = "/srv") -> dict[int, str]:
    """All blocks of a place; what each said, by its line in the guide."""
    said = {}
    for block in guide.of(place):
        done = roots.inside(root, block.text, online=block.online, at=at)
        assert done.returncode == 0, f"{guide.GUIDE.name}:{block.line}\n{done.stdout}\n{done.stderr}"
        said[block.line] = done.stdout
    return said


def delivered(scratch: Path) -> Path:
    """What the workstation's commands make for the controller."""
    root = roots.copy(roots.fresh("amd64"), scratch / "workstation")
    listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(listed, cwd=ROOT, capture_output=True, check=True).stdout.decode().split("\0")
    for name in names:
        if name and (ROOT / name).is_file():
            target = root / "srv" / "slewright" / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, target)
    execute(root, "workstation", "/srv/slewright")
    target = (root / DELIVERY).rename(scratch / DELIVERY.name)
    shutil.rmtree(root)
    return target


@pytest.fixture(scope="module")
def controller(scratch: Path) -> tuple[Path, list[str]]:
    """The root in which the controller's commands were executed, and what they said."""
    root, said = scratch / "controller", scratch / "said.json"
    if not said.is_file():
        shutil.rmtree(root, ignore_errors=True)
        delivery = delivered(scratch)
        roots.copy(roots.fresh("amd64"), root)
        delivery.rename(root / "srv" / delivery.name)
        said.write_text(json.dumps(list(execute(root, "controller").values())))
    return root, json.loads(said.read_text())


@pytest.fixture(scope="module")
def ended(controller: tuple[Path, list[str]], scratch: Path) -> vm.Ended:
    shutil.rmtree(scratch / "vm", ignore_errors=True)
    (scratch / "vm").mkdir()
    return vm.start(controller[0], scratch / "vm")


@pytest.mark.soak
def test_a_fresh_debian_comes_to_a_running_scenario(controller: tuple[Path, list[str]]) -> None:
    """`slewright hil` judged its own tolerances; without its block this would pass for nothing."""
    root, said = controller
    found = json.loads((root / "srv" / "hil.json").read_text())
    assert found["within_tolerance"] is True
    assert found["statistics"]["ticks"] > 900
    assert any("real time" in text for text in said)


@pytest.mark.soak
def test_what_the_service_runs_belongs_to_root(controller: tuple[Path, list[str]]) -> None:
    root, _ = controller
    for name in ("opt/slewright/bin/slewright", "etc/slewright/machine.toml", "etc/slewright/keys"):
        status = (root / name).stat()
        assert (status.st_uid, status.st_mode & 0o022) == (0, 0), name
    assert (root / "var/lib/slewright/store").stat().st_uid != 0


@pytest.mark.soak
def test_the_guide_holds_on_the_running_controller(ended: vm.Ended) -> None:
    for block in guide.of("running"):
        code = ended.text(f"guide-{block.line}.rc").strip()
        said = ended.text(f"guide-{block.line}.out") + ended.text(f"guide-{block.line}.err")
        assert code == "0", f"{guide.GUIDE.name}:{block.line}: {code}\n{said}\n{ended.console[-3000:]}"
    assert "PREEMPT_RT" in ended.text("kernel")


def properties(ended: vm.Ended, name: str) -> dict[str, str]:
    """What systemd said of the service at one moment."""
    return dict(line.split("=", 1) for line in ended.text(name).splitlines())


@pytest.mark.soak
def test_the_control_process_has_its_rights_and_its_core_as_a_plain_user(ended: vm.Ended) -> None:
    assert f"SCHED_FIFO|SCHED_RESET_ON_FORK\n" in ended.text("priority")  # noqa: F541
    assert ended.text("priority").strip().endswith(str(PRIORITY))
    assert ended.text("core").strip().endswith(f": {vm.CORES - 1}")
    assert int(ended.text("locked").split()[1]) > 10_000  # kB
    assert ended.text("user").strip() == "slewright"


@pytest.mark.soak
def test_it_drives_the_simulated_machine_over_the_kernels_bus(ended: vm.Ended) -> None:
    """What happened is judged, not how timely: the virtual computer's clock waits for its processor."""
    assert "AUTOMATIC" in properties(ended, "driving")["StatusText"].upper()
    assert ended.text("machine.rc").strip() == "0"
    drive = json.loads(ended.text("drive.json"))
    assert drive["rows"] == 1001
    assert drive["faults"] == [0.0]
    assert drive["metrics"]["speed"] > 1.0
    identifiers = {line.split()[2].split("#")[0] for line in ended.text("candump.log").splitlines() if line}
    assert {f"{codec.message.frame_id:08X}" for codec in sent_by(NODE)} <= identifiers
    assert "18FFEE99" in identifiers


@pytest.mark.soak
def test_what_it_recorded_there_repeats_there(ended: vm.Ended) -> None:
    assert ended.text("replay.rc").strip() == "0", ended.text("replay.out")
    assert "repeated bit for bit" in ended.text("replay.out")


@pytest.mark.soak
@pytest.mark.parametrize(
    ("when", "state", "result"),
    [
        ("stopped", "inactive", "success"),
        ("hung", "failed", "watchdog"),
        ("killed", "failed", "exit-code"),
        ("pulled", "inactive", "success"),
    ],
)
def test_the_service_ends_and_is_not_started_again(
    ended: vm.Ended, when: str, state: str, result: str
) -> None:
    found = properties(ended, when)
    assert (found["ActiveState"], found["Result"], found["NRestarts"]) == (state, result, "0")


def test_results_of_a_machine_that_never_came_up_are_empty(tmp_path: Path) -> None:
    """An empty disk is an archive without files, so that what is missing is said test by test."""
    with (tmp_path / "disk").open("wb") as file:
        file.truncate(1 << 20)
    with tarfile.open(tmp_path / "disk") as archive:
        assert archive.getnames() == []
    assert vm.Ended(tmp_path, "").text("kernel") == ""
