"""Recordings in the page: the runtime's and a simulation's, from the first moment to the last."""

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from records.record import RecordWriter
from runtime.hmi.playback import Playback, checked
from runtime.hmi.timeline import EVERY, open_timeline
from runtime.hmi.web import Site
from runtime.image import INPUT, OUTPUT, Status
from runtime.recorder.recorder import Recorder
from runtime.recorder.replay import identity
from runtime.recorder.segments import Folder
from runtime.ring import Ring
from specs.errors import InputError
from tests.runtime.hmi.browser import Browser
from tests.runtime.stand_in import Lockstep

TICKS = 1500


def recorded(folder: Path, ticks: int = TICKS, close: bool = True, mode: str = "control") -> Path:
    """A recording of half a minute in segments of ten seconds, its slew turning, an emergency stop within."""
    ring = Ring.create(folder / "ring", 1 << 20)
    writer = Recorder(
        ring, Folder(folder / "rec", 64 << 20), {**identity(core="c0de", specs="1"), "mode": mode}, 500
    )
    run = Lockstep(ring)
    run.port.receive = lambda inputs, tick: None  # type: ignore[method-assign]  (what is set here stays)
    for k in range(ticks // 50):
        for name, value in (
            ("q_slew", 0.03 * k),
            ("q_boom", 1.1),
            ("q_stick", -1.4),
            ("emergency_stop", float(k == 15)),
        ):
            place = INPUT.at(name)
            run.inputs["value"][place], run.inputs["status"][place], run.inputs["age"][place] = (
                value,
                Status.OK,
                0,
            )
        run.run(50)
        writer.work()
    if close:
        writer.close()
    ring.close()
    return folder / "rec"


@contextmanager
def site(path: Path) -> Iterator[str]:
    playback = Playback(checked(open_timeline(path)))
    playback.read()
    served = Site("127.0.0.1", 0, playback.routes(), None)
    threading.Thread(target=served.serve_forever, args=(0.1,), daemon=True).start()
    yield f"http://127.0.0.1:{served.port}/"
    served.shutdown()
    served.server_close()


def test_a_timeline_holds_every_fifth_tick_of_all_segments(tmp_path: Path):
    timeline = open_timeline(recorded(tmp_path))
    assert len(timeline.spans) == 3
    blocks = [timeline.block(k) for k in range(3)]
    ticks = np.concatenate([b.inputs["tick"] for b in blocks])
    assert set(np.diff(ticks)) == {EVERY}
    assert sum(len(b.late_ns) for b in blocks) == TICKS
    slew = np.concatenate([b.inputs["value"][:, INPUT.at("q_slew")] for b in blocks])
    assert (slew[0], slew[-1]) == (0.0, pytest.approx(0.03 * (TICKS // 50 - 1)))


@pytest.mark.parametrize("mode", ["control", "shadow"])
def test_a_recording_of_shadow_mode_is_shown_as_one(mode: str, tmp_path: Path):
    about = open_timeline(recorded(tmp_path, 100, mode=mode)).about
    assert about["machine"] == {"control": "rec", "shadow": "rec, in shadow: nothing is commanded"}[mode]


def test_a_segment_that_was_cut_plays_as_far_as_it_is_whole(tmp_path: Path):
    folder = recorded(tmp_path, 400, close=False)
    (path,) = folder.glob("*.mcap")
    path.write_bytes(path.read_bytes()[:-100])
    timeline = checked(open_timeline(folder))
    assert 0 < len(timeline.block(0).times) <= 400 / EVERY
    assert timeline.notes


def test_what_is_no_recording_is_refused(tmp_path: Path):
    (tmp_path / "x.mcap").write_bytes(b"nonsense")
    with pytest.raises(InputError, match="is not MCAP"):
        open_timeline(tmp_path / "x.mcap")
    with pytest.raises(InputError, match="there is no file"):
        open_timeline(tmp_path / "empty")
    (tmp_path / "other").mkdir()
    ring = Ring.create(tmp_path / "ring", 1 << 20)
    writer = Recorder(ring, Folder(tmp_path / "other", 64 << 20), {"layout": "other"}, 500)
    Lockstep(ring).run(50)
    writer.work()
    writer.close()
    ring.close()
    with pytest.raises(InputError, match="recorded with other signals: other"):
        open_timeline(tmp_path / "other")


def test_alarms_and_statistics_of_the_whole(tmp_path: Path):
    playback = Playback(open_timeline(recorded(tmp_path)))
    playback.read()
    found = playback.routes()[("GET", "/api/overview")](None)  # type: ignore[arg-type]
    assert found["done"]
    stop = next(a for a in found["alarms"] if a["text"] == "Emergency stop is open")
    assert stop["gone"] - stop["since"] == pytest.approx(1.0, abs=0.15)
    assert found["work"]["ticks"] == TICKS == sum(found["work"]["late"])
    json.dumps(found, allow_nan=False)


def simulated(folder: Path) -> Path:
    """A run record as `slewright simulate` leaves it."""
    path = folder / "run.parquet"
    writer = RecordWriter(
        path, ["time", "target_x", "target_y", "target_z", "q_slew", "q_boom", "q_stick"], {"seed": 3}
    )
    t = np.arange(1000) * 0.02
    writer.append(np.column_stack([t, 6 + 0 * t, 7 + 0 * t, 5 + 0 * t, 0.05 * t, 1.1 + 0 * t, -1.4 + 0 * t]))
    writer.close()
    return path


def test_a_run_record_plays_with_what_it_knows(tmp_path: Path):
    timeline = open_timeline(simulated(tmp_path))
    block = timeline.block(0)
    assert timeline.duration == pytest.approx(19.9)
    assert block.inputs["status"][0, INPUT.at("q_slew")] == Status.OK
    assert block.inputs["status"][0, INPUT.at("p_pump")] == Status.NEVER
    assert block.outputs["status"][0, OUTPUT.at("control_mode")] == Status.NEVER
    assert timeline.about["seed"] == 3


@pytest.mark.browser
@pytest.mark.parametrize("kind", ["recorded", "simulated"])
def test_the_page_plays_it(kind: str, browser: str, tmp_path: Path):
    path = recorded(tmp_path) if kind == "recorded" else simulated(tmp_path)
    with site(path) as address, Browser(browser, tmp_path / "browser") as page:
        page.open(address)
        assert page.run("document.querySelector('#source').textContent").startswith("PLAYBACK")
        assert page.run("document.querySelector('#sign').hidden")
        drawn = "document.querySelector('#above g[transform^=rotate]')?.getAttribute('transform')"
        page.wait(f"Boolean({drawn})")
        first = page.run(drawn)
        page.write("#slider", "12.3")
        page.wait(f"{drawn} !== {json.dumps(first)}")
        later = page.run(drawn)
        page.run(
            "(s => (s.value = '10', s.dispatchEvent(new Event('change'))))(document.querySelector('#speed'))"
        )
        page.click("#play")
        page.wait(f"{drawn} !== {json.dumps(later)} && Number(document.querySelector('#slider').value) > 13")
        for size in ((1024, 768), (768, 1024)):
            page.resize(*size)
            assert page.run("document.documentElement.scrollHeight <= innerHeight")
        if kind == "recorded":
            page.wait("document.querySelectorAll('#player .ticks i').length > 0")
            page.run("location.hash = '#alarms'")
            page.wait("document.querySelector('#alarm-list').textContent.includes('Emergency stop is open')")
        time.sleep(0.2)
        assert [r for r in page.requests if not r.startswith((address, "about:", "data:"))] == []
        assert page.complaints == []
