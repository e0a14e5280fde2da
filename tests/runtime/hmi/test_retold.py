"""The ladder in playback is what a live page showed, and where it cannot be known it is said why."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from runtime.bundle import load
from runtime.hmi.cells import LADDER
from runtime.hmi.playback import Playback
from runtime.hmi.retold import retold
from runtime.hmi.timeline import EVERY, open_timeline
from runtime.hmi.web import Request
from runtime.policy import open_core
from runtime.recorder.recorder import Recorder
from runtime.recorder.replay import identity
from runtime.recorder.segments import Folder
from runtime.ring import Ring
from slewright.__main__ import run as command
from specs.errors import InputError
from specs.version import VERSION
from tests.runtime.bench import READY, Bench
from tests.runtime.bundles import built
from tests.runtime.hmi.test_playback import simulated
from tests.runtime.stand_in import Lockstep

TICKS = 1200
CHANGES = {  # tick: what is new then
    0: dict.fromkeys(READY, 0.0),
    100: READY,
    200: {"operator_enable": 1.0},
    300: {"automatic_request": 1.0},
    500: {"emergency_stop": 1.0},
    700: {"emergency_stop": 0.0, "operator_enable": 0.0},
    900: {"joystick_slew": 0.6},
}


def recorded(folder: Path) -> tuple[Path, np.ndarray]:
    """A recording of the real core, and what it told after each tick."""
    bundle, ring = built("pd"), Ring.create(folder / "ring", 1 << 22)
    where = {"bundle": bundle.digest, "bundle_folder": str(bundle.folder)}
    writer = Recorder(
        ring, Folder(folder / "rec", 64 << 20), {**identity(bundle.identity, VERSION), **where}, 500
    )
    core = open_core(load(bundle.folder))
    bench, run, told = Bench(core), Lockstep(ring, core=core), np.zeros(TICKS, LADDER)  # type: ignore[arg-type]

    def receive(inputs: np.ndarray, tick: int) -> None:
        bench.set(**CHANGES.get(tick, {})).now = tick
        bench.fill()
        for name in ("value", "status", "age"):
            inputs[name] = bench.image[name]

    run.port.receive = receive  # type: ignore[method-assign]
    for tick in range(TICKS):
        run.run(1)
        core.ladder(run.inputs, told[tick : tick + 1])
        if tick % 50 == 0:
            writer.work()
    writer.close()
    ring.close()
    return folder / "rec", told


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, np.ndarray]:
    return recorded(tmp_path_factory.mktemp("made"))


def asked(playback: Playback, route: str, **query: str) -> dict:
    return playback.routes()[("GET", route)](Request(query, {}, "", "", near=True))


def test_each_moment_has_what_the_core_told_then(made: tuple[Path, np.ndarray]):
    path, told = made
    teller, why = retold(path, None)
    assert why == ""
    timeline = open_timeline(path, teller)
    ladders = [timeline.block(k).ladders for k in range(len(timeline.spans))]
    found = np.concatenate([x for x in ladders if x is not None])
    starts = np.cumsum([0, *(len(timeline.block(k).late_ns) for k in range(len(timeline.spans)))])
    ticks = np.concatenate([np.arange(a, b, EVERY) for a, b in pairwise(starts)])
    assert len(timeline.spans) == 3
    assert len(np.unique(told)) > 4  # it told different things
    assert found.tolist() == told[ticks].tolist()


def test_the_page_gets_the_rungs_with_each_frame(made: tuple[Path, np.ndarray]):
    path, _ = made
    timeline = open_timeline(path, retold(path, None)[0])
    frames = asked(Playback(timeline), "/api/frames", **{"from": "0", "to": "20"})["frames"]
    assert [r["to"] for r in frames[-1]["ladder"]] == ["STANDBY", "ARMED", "AUTOMATIC"]
    missing = {m for f in frames for r in f["ladder"] for m in r["missing"]}
    assert "press the enabling switch" in missing
    assert "turn the automatic switch on" in missing


def test_without_the_bundle_that_ran_the_page_says_why(made: tuple[Path, np.ndarray], tmp_path: Path):
    ring = Ring.create(tmp_path / "ring", 1 << 20)
    writer = Recorder(ring, Folder(tmp_path / "rec", 64 << 20), identity("c0de", VERSION), 500)
    Lockstep(ring).run(50)
    writer.work()
    writer.close()
    ring.close()
    teller, why = retold(tmp_path / "rec", None)
    assert teller is None
    assert "does not say where its bundle was: name it with --bundle" in why
    playback = Playback(open_timeline(tmp_path / "rec", teller), why)
    assert asked(playback, "/api/catalogue")["no_ladder"] == why
    assert "ladder" not in asked(playback, "/api/frames", **{"from": "0", "to": "1"})["frames"][0]
    with pytest.raises(InputError, match="made with another control core"):
        retold(tmp_path / "rec", built("pd").folder)
    assert "simulation" in retold(simulated(tmp_path), None)[1]
    with pytest.raises(InputError, match="--bundle is for recordings of the runtime"):
        retold(simulated(tmp_path), built("pd").folder)


def test_a_recording_whose_first_state_is_lost_tells_nothing_until_the_next(made: tuple[Path, np.ndarray]):
    path, told = made
    teller, _ = retold(path, None)
    assert teller
    segment = sorted(path.glob("*.mcap"))[0]
    once, again = teller.of(segment, 1), teller.of(segment, 1)  # from whatever state the core was left in
    assert once.tolist() == again.tolist() == told[: len(once)].tolist()


def test_the_command_refuses_what_is_no_recording(tmp_path: Path, capsys):
    (tmp_path / "x.mcap").write_bytes(b"nonsense")
    assert command(["hmi", str(tmp_path / "x.mcap")]) == 2
    assert "is not MCAP" in capsys.readouterr().err
