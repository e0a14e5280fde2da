"""What was kept of the last run: a latched fault stays so, a load is known until there is a newer one."""

from pathlib import Path

import numpy as np
import pytest

from runtime.image import OUTPUT, Status
from runtime.recorder.feed import Feed
from runtime.recorder.reader import Recording
from runtime.recorder.recorder import Recorder
from runtime.recorder.replay import replay
from runtime.recorder.segments import Disk, Folder
from runtime.ring import Ring
from specs.errors import InputError
from tests.runtime.bench import ARMED, FAULT, FAULTS, STANDBY, Bench
from tests.runtime.bundles import core
from tests.runtime.script import images

LOAD = OUTPUT.at("load_estimate")


def restarted(**kept: float) -> Bench:
    bench = Bench(core())
    bench.core.restart(kept)
    return bench


def status(bench: Bench) -> int:
    return int(bench.seen[-1]["status"][LOAD])


def test_a_fault_is_latched_until_the_switch_is_pressed_anew() -> None:
    bench = restarted(fault_code=FAULTS["sensor_stuck"], fault_signal=7.0)
    bench.set(operator_enable=1.0)  # left on: nobody has acknowledged anything
    bench.status["operator_enable"] = Status.NEVER
    bench.tick(3)
    assert (bench.mode, bench.fault, bench.out("fault_signal")) == (FAULT, "sensor_stuck", 7.0)
    bench.status.clear()
    assert bench.tick(5).mode == FAULT
    assert bench.set(operator_enable=0.0).tick(2).mode == FAULT
    assert bench.set(operator_enable=1.0).tick().mode == STANDBY
    assert bench.fault == "none"
    assert bench.set(operator_enable=0.0).tick().set(operator_enable=1.0).tick().mode == ARMED


@pytest.mark.parametrize("fault", ["none", "target_out_of_reach"])
def test_what_is_not_latched_is_not_kept(fault: str) -> None:
    assert restarted(fault_code=FAULTS[fault]).tick(2).mode == STANDBY


def test_a_load_is_known_until_there_is_a_newer_one_while_its_sensors_are_there() -> None:
    still = {"p_boom_a": 2e7, "p_boom_b": 2e6, "p_stick_a": 1e7, "p_stick_b": 5e6}
    bench = restarted(load_estimate=1234.0).set(**still).tick(2)
    assert (status(bench), bench.out("load_estimate")) == (Status.OK, 1234.0)
    bench.tick(120)
    assert status(bench) == Status.OK
    assert bench.out("load_estimate") != 1234.0

    bench = restarted(load_estimate=1234.0).set(**still).tick(2)
    bench.status["p_boom_a"] = Status.TIMEOUT
    assert status(bench.tick()) == Status.NOT_AVAILABLE
    bench.status.clear()
    assert status(bench.tick(5)) == Status.OK, "kept: nothing newer is known"
    assert status(restarted().set(**still).tick(2)) == Status.NOT_AVAILABLE


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(InputError, match="retained fault_code = 251: 0 to 250; delete the retained values"):
        core().restart({"fault_code": 251.0})
    with pytest.raises(InputError, match="retained load_estimate = 1e"):
        core().restart({"load_estimate": 1e6})


def test_a_run_that_began_with_it_repeats_bit_for_bit(tmp_path: Path) -> None:
    """The state at the start is in the recording's first snapshot."""
    ring = Ring.create(tmp_path / "ring", 4 << 20)
    feed, running = Feed(ring), core()
    recorder = Recorder(ring, Folder(tmp_path / "out", 64 << 20), {}, 3000, Disk())
    running.restart({"fault_code": FAULTS["machine_fault"], "load_estimate": 800.0})
    shown = []
    for k, image in enumerate(images(600)):
        feed.before(k, running)
        outputs = running.step(np.array(image), k)
        shown.append(float(outputs["value"][LOAD]))
        feed.tick(np.array(image), outputs, (k * 20_000_000, 0, 0, 0, -1))
    recorder.work()
    recorder.close()
    ring.close()
    assert 800.0 in shown
    result = replay(Recording(tmp_path / "out"), core())
    assert (result.ticks, result.first, result.gaps) == (600, None, 0)
