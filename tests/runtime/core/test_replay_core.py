"""The control core's recordings repeat bit for bit: an hour in the long tests, a day in the soak."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from deployment.hil.panel import Panel
from runtime.control import ControlCore
from runtime.image import INPUT, OUTPUT, Status
from runtime.recorder.feed import Feed
from runtime.recorder.reader import Recording
from runtime.recorder.recorder import Recorder
from runtime.recorder.replay import Result, replay
from runtime.recorder.segments import Disk, Folder
from runtime.ring import Ring
from runtime.scan import PERIOD_NS
from specs.scenario import load
from tests.runtime.bundles import core

HOUR = 3600 * 50  # ticks
SEGMENT = 3000  # ticks, as the supervisor has it
ROUND = 3000  # ticks after which the operator starts anew
WORK = 500  # ticks between two looks of the recorder
LIMIT = 400 << 20


class Wild:
    """Inputs without a machine: switches and targets of a minute, again and again, and sensors that wander.

    Each minute has another pace; now and then a status is wrong.
    """

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        panel, image = Panel(load("four_targets_empty")), INPUT.new()
        moving = np.array([s.kind == "sensor" and s.min != 0 for s in INPUT.signals])
        wander = np.cumsum(1e-3 * random.standard_normal((ROUND, int(moving.sum()))), axis=0)
        self.images = np.zeros(ROUND, INPUT.dtype)
        for tick in range(ROUND):
            panel.write(image, tick - 4, {})
            image["value"][moving] = wander[tick]
            self.images[tick] = image
        for tick in range(0, ROUND, 997):
            self.images[tick]["status"][random.integers(len(INPUT.signals))] = Status.CHECKSUM

    def next(self, tick: int) -> np.ndarray:
        """The image of a tick."""
        image = self.images[tick % ROUND : tick % ROUND + 1].reshape(())
        image["tick"] = tick
        image["value"][INPUT.index["pace"]] = 0.1 + tick // ROUND % 19 / 10
        return image


def recorded(folder: Path, ticks: int) -> tuple[Path, set[float]]:
    """A recording of the core, and the modes it was in."""
    ring = Ring.create(folder / "ring", 16 << 20)
    feed, running, wild = Feed(ring), core("pd"), Wild(7)
    recorder = Recorder(ring, Folder(folder / "out", LIMIT), {}, SEGMENT, Disk())
    modes = set()
    for tick in range(ticks):
        image = wild.next(tick)
        feed.before(tick, running)
        outputs = running.step(image, tick)
        feed.tick(image, outputs, (tick * PERIOD_NS, 0, 0, 0, -1))
        if tick % ROUND < 6:
            modes.add(float(outputs["value"][OUTPUT.index["control_mode"]]))
        if tick % WORK == WORK - 1:
            recorder.work()
    recorder.work()
    recorder.close()
    assert ring.lost == 0
    return folder / "out", modes


def repeated(folder: Path, ticks: int) -> Result:
    path, modes = recorded(folder, ticks)
    assert len(modes) > 1
    result = replay(Recording(path), core("pd"))
    assert (result.first, result.gaps, result.left_out) == (None, 0, 0)
    return result


@pytest.mark.long
def test_an_hour_repeats_bit_for_bit(tmp_path: Path):
    assert repeated(tmp_path, HOUR).ticks == HOUR


@pytest.mark.slow
@pytest.mark.soak
def test_a_day_repeats_bit_for_bit_in_parts(tmp_path: Path):
    """The disk is bounded, so a day is repeated hour by hour, each from its own segments."""
    for hour in range(24):
        folder = tmp_path / str(hour)
        folder.mkdir()
        assert repeated(folder, HOUR).ticks == HOUR
        shutil.rmtree(folder)


def test_another_core_differs_and_is_told_where(tmp_path: Path):
    path, _ = recorded(tmp_path, 1500)

    class Other(ControlCore):
        def step(self, inputs: np.ndarray, tick: int) -> np.ndarray:
            outputs = super().step(inputs, tick)
            if tick == 777:
                outputs["value"][0] = np.nextafter(outputs["value"][0], 2.0)
            return outputs

    result = replay(Recording(path), Other(core("pd").bundle))
    assert result.first is not None
    assert (result.first.tick, result.first.name, result.ticks) == (777, "u_slew", 778)
