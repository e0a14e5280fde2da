"""The helper processes: they finish their files when told, and a killed one leaves them readable."""

import json
import signal
import struct
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from runtime.helpers import Helper
from runtime.recorder.reader import Recording
from runtime.recorder.replay import replay
from runtime.retain.copies import Files, Folder, Retained
from runtime.retain.process import FAILED, VALUES, Keeper
from runtime.ring import Ring
from tests.runtime.stand_in import Lockstep, StandIn

LAYOUT = "0123456789abcdef"
PATIENCE_S = 60.0  # on a machine that does other things


def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end, "it never happened"
        time.sleep(0.01)


def recorder(tmp_path: Path) -> tuple[Ring, Helper]:
    ring = Ring.create(tmp_path / "ring", 4 << 20)
    told = {
        "ring": str(ring.path),
        "folder": str(tmp_path / "recording"),
        "limit": 64 << 20,
        "segment_ticks": 200,
        "metadata": {"format": "1"},
    }
    helper = Helper("recorder", "runtime.recorder", told)
    helper.start()
    return ring, helper


def test_the_recorder_finishes_its_segment_when_told(tmp_path: Path):
    ring, helper = recorder(tmp_path)
    run = Lockstep(ring)
    until(lambda: ring.beat > 0)
    run.run(500)
    assert helper.end() == 0
    recording = Recording(tmp_path / "recording")
    assert replay(recording, StandIn()).ticks == 500
    assert recording.notes == []


def test_a_killed_recorder_leaves_a_recording_and_the_next_one_goes_on(tmp_path: Path):
    ring, helper = recorder(tmp_path)
    run = Lockstep(ring)
    run.run(300)
    until(lambda: ring.beat > 0 and not ring.waiting)
    assert helper.process is not None
    helper.process.kill()
    helper.process.wait()
    assert helper.ended() == -signal.SIGKILL
    run.run(100)
    helper.start()
    beat = ring.beat
    run.run(100)
    until(lambda: ring.beat > beat and not ring.waiting)
    assert helper.end() == 0
    result = replay(Recording(tmp_path / "recording"), StandIn())
    assert (result.first, helper.starts, ring.lost) == (None, 2, 0)
    assert result.ticks >= 400


def keeper(tmp_path: Path, files: Files, base: dict[str, float] | None = None) -> tuple[Ring, Keeper]:
    ring = Ring.create(tmp_path / "ring", 1 << 12)
    return ring, Keeper(ring, Retained(files, LAYOUT), ("ticks", "fault_code"), base or {}, every_s=5.0)


def test_the_newest_values_are_saved_at_most_so_often_and_at_the_end(tmp_path: Path):
    ring, keep = keeper(tmp_path, Folder(tmp_path), base={"ticks": 1000.0})
    for number in range(3):
        ring.put(VALUES, struct.pack("<2d", 50.0 * number, 2.0))
    keep.work(now=0.0)
    assert Retained(Folder(tmp_path), LAYOUT).load() == {"ticks": 1100.0, "fault_code": 2.0}
    ring.put(VALUES, struct.pack("<2d", 150.0, 2.0))
    keep.work(now=4.9)
    assert Retained(Folder(tmp_path), LAYOUT).load()["ticks"] == 1100.0
    keep.work(now=4.9, last=True)
    assert Retained(Folder(tmp_path), LAYOUT).load() == {"ticks": 1150.0, "fault_code": 2.0}
    assert ring.note == 0


def test_a_fault_that_comes_or_goes_is_saved_at_once_and_what_is_not_known_is_not(tmp_path: Path):
    ring, keep = keeper(tmp_path, Folder(tmp_path))
    for fault in (0.0, 4.0, 0.0):
        ring.put(VALUES, struct.pack("<2d", fault, fault))
        keep.work(now=1.0)
        assert Retained(Folder(tmp_path), LAYOUT).load()["fault_code"] == fault
    ring.put(VALUES, struct.pack("<2d", 7.0, float("nan")))
    keep.work(now=10.0)
    assert Retained(Folder(tmp_path), LAYOUT).load() == {"ticks": 7.0}


def test_a_disk_that_refuses_shows_in_the_note(tmp_path: Path):
    class Refusing(Folder):
        refuses = True

        def sync(self, name: str) -> None:
            if self.refuses:
                raise OSError(28, "No space left on device")
            super().sync(name)

    files = Refusing(tmp_path)
    ring, keep = keeper(tmp_path, files)
    for refuses, note in ((True, FAILED), (False, 0)):
        files.refuses = refuses
        ring.put(VALUES, struct.pack("<2d", 1.0, 2.0))
        keep.work(now=10.0 * note + 10.0)
        keep.work(now=1e6, last=True)
        assert ring.note == note


def test_the_retain_process_saves_when_told_to_end(tmp_path: Path):
    ring = Ring.create(tmp_path / "ring", 1 << 12)
    told = {"ring": str(ring.path), "folder": str(tmp_path), "layout": LAYOUT, "names": ["ticks"]}
    helper = Helper("retain", "runtime.retain.process", {**told, "base": {}, "every_s": 3600.0})
    helper.start()
    until(lambda: ring.beat > 0)
    for number in range(3):
        ring.put(VALUES, struct.pack("<d", number))
    assert helper.end() == 0
    assert Retained(Folder(tmp_path), LAYOUT).load() == {"ticks": 2.0}


@pytest.mark.parametrize("module", ["runtime.recorder", "runtime.retain.process"])
def test_a_queue_of_another_version_ends_the_process(
    tmp_path: Path, module: str, capfd: pytest.CaptureFixture
):
    (tmp_path / "ring").write_bytes(b"something else")
    told = {"ring": str(tmp_path / "ring"), "folder": str(tmp_path / "f"), "limit": 1, "metadata": {}}
    told |= {"segment_ticks": 1, "layout": LAYOUT, "names": [], "base": {}, "every_s": 1.0}
    helper = Helper("one", module, json.loads(json.dumps(told)))
    helper.start()
    assert helper.process is not None
    assert helper.process.wait(PATIENCE_S) != 0
    assert "no queue of this version" in capfd.readouterr().err
