"""Hardware in the loop: a few seconds with real processes; all four targets in the soak."""

import json
import time
from pathlib import Path

import pytest

from deployment.hil.hil import compared
from deployment.hil.lockstep import lockstep
from deployment.hil.rig import Rig, Setting
from runtime.bundle import load
from runtime.control import ControlCore
from runtime.recorder.reader import Recording
from runtime.recorder.replay import check_identity, identity, replay
from specs.scenario import TICK_S, load as load_scenario
from specs.version import VERSION
from tests.conftest import Command
from tests.runtime.bundles import built

SCENARIO = load_scenario("four_targets_empty")


@pytest.mark.long
def test_a_few_seconds_over_can_and_modbus_and_their_replay():
    """The machine turns as in lock-step; every tick of it repeats bit for bit."""
    bundle = built("pd")
    setting = Setting(bundle.folder, SCENARIO, ticks=100)
    with Rig(setting) as rig:
        rig.begin()
        while not rig.step():
            time.sleep(0.005)
        statistics = rig.statistics()
        recording = Recording(rig.recording)
        check_identity(recording.metadata(), identity(bundle.identity, VERSION))
        result = replay(recording, ControlCore(load(bundle.folder)))
        real = rig.record()
    assert (result.first, result.gaps) == (None, 0)
    assert result.ticks == statistics["ticks"] > 100
    assert abs(real.column("u_slew")).max() > 0.1
    simulated = lockstep(ControlCore(bundle), SCENARIO, ticks=100)
    found = compared(real, simulated, statistics)
    assert found.real == {}  # no target was seen to its end
    assert found.slew_deg < 30.0


def test_runs_that_are_apart_are_told():
    core = ControlCore(built("pd"))
    one, other = (lockstep(core, SCENARIO, ticks=760, pace=pace) for pace in (1.0, 0.5))
    assert compared(one, one, {}).misses() == []
    assert any("slew angles" in text for text in compared(one, other, {}).misses())


@pytest.mark.slow
@pytest.mark.soak
def test_the_four_targets_in_real_time(slewright: Command, tmp_path: Path):
    path = tmp_path / "hil.json"
    done = slewright("hil", "--json", path, timeout=600.0)
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(path.read_text())["within_tolerance"]


def run_for(seconds: float) -> dict:
    """Statistics of the runtime after so long with the whole of it."""
    with Rig(Setting(built("pd").folder, SCENARIO, ticks=round(seconds / TICK_S))) as rig:
        rig.begin()
        while not rig.step():
            time.sleep(0.1)
        return rig.statistics()


@pytest.mark.soak
def test_half_an_hour_without_a_missed_tick_of_our_own_making():
    found = run_for(1800.0)
    assert found["ticks"] + found["skipped_ticks"] >= 1800.0 / TICK_S
    assert (found["overruns"], found["unrecorded_ticks"]) == (0, 0)
    assert not found["skipped_ticks"] or found["stolen_ticks"], "skipped, and nobody took the processor"
