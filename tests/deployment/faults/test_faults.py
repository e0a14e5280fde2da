"""Faults: a few of each in lock-step; the figures can fail; all of them with real processes in the soak."""

import json
from copy import copy
from pathlib import Path

import numpy as np
import pytest

from deployment.faults import devices, foreign_fmus, injected, run as runs
from deployment.faults.canopen_table import CANOPEN
from deployment.faults.drive import Drive
from deployment.faults.fmu_table import FMU
from deployment.faults.injected import Disturbance
from deployment.faults.outside_table import NAMES
from deployment.faults.people_table import FILES
from deployment.faults.process_faults import Recorded
from deployment.faults.run import faults, run
from deployment.faults.table import BUS, IMAGE, INSIDE, Fault, Outcome
from runtime.control import ControlCore
from runtime.recorder.segments import Disk
from specs.errors import InputError
from specs.scenario import load
from tests.conftest import Command
from tests.runtime.bundles import built

TICKS = 700
LOCKSTEP = [f.name for f in (*BUS, *IMAGE, *INSIDE, *FILES, *CANOPEN) if f.level != "process"]


def quiet(what: str, done: float | None = None, total: float | None = None) -> None:
    pass


def test_every_fault_is_caught_within_its_limit():
    for outcome in run(built("pd").folder, faults(LOCKSTEP), 2, 3, quiet, TICKS):
        assert outcome.missed == [], outcome.fault.name
        assert (outcome.injected, outcome.caught) == (2, 2)


@pytest.mark.long
def test_every_fault_of_an_fmu_is_caught_and_an_fmu_that_is_well_is_none(monkeypatch: pytest.MonkeyPatch):
    for outcome in run(built("pd").folder, list(FMU), 2, 3, quiet):
        assert outcome.injected == 2
        late = [said for said in outcome.missed if said.endswith(" ms")]  # a busy computer's
        assert outcome.missed == late, outcome.fault.name
    monkeypatch.setitem(foreign_fmus.DAMAGES, "fmu_library_cut", lambda files, random: None)
    (outcome,) = run(built("pd").folder, faults(["fmu_library_cut"]), 1, 3, quiet)
    assert outcome.caught == 0
    assert outcome.missed[0].endswith("it is accepted")


def test_a_reaction_that_is_late_or_wrong_is_missed(monkeypatch: pytest.MonkeyPatch):
    late = Fault("sensor_timeout", "", "", 40.0, "bus", ("sensor_timeout",))
    wrong = Fault("sensor_stuck", "", "", 600.0, "bus", ("sensor_range",))
    monkeypatch.setitem(injected.MAKERS, "bus_off", lambda random: Disturbance())
    nothing = Fault("bus_off", "", "", 80.0, "bus", ("bus_off",))
    drive = Drive(ControlCore(built("pd")), load(runs.SCENARIO), 300, 3)
    moment = drive.moments({200})[200]
    said = {}
    for fault in (late, wrong, nothing):
        outcome = Outcome(fault)
        injected.inject(fault, drive, moment, np.random.default_rng(1), outcome)
        assert (outcome.injected, outcome.caught) == (1, 0)
        said[fault.name] = outcome.missed[0]
    assert said["sensor_timeout"].endswith(" ms")
    assert said["sensor_stuck"] == "tick 200: fault code sensor_stuck"
    assert said["bus_off"] == "tick 200: no reaction"


def test_the_same_seed_gives_the_same_moments_and_figures():
    first, again = (run(built("pd").folder, faults(["sensor_range"]), 3, 5, quiet, 400) for _ in range(2))
    assert first[0].figures() == again[0].figures()


@pytest.mark.parametrize("name", ["remote_frames", "second_sender", "forged_status", "other_controller"])
def test_an_attacked_drive_is_recorded_and_repeats_bit_for_bit(name: str, tmp_path: Path):
    drive = Drive(ControlCore(built("pd")), load(runs.SCENARIO), 300, 3)
    moment = drive.moments({200})[200]
    attacked, change = copy(drive), injected.MAKERS[name](np.random.default_rng(2)).frames
    assert change is not None
    attacked.frames = [*drive.frames[:200], *(change(f, k) for k, f in enumerate(drive.frames[200:]))]
    recorded = Recorded(attacked, moment, tmp_path, Disk())
    recorded.steps(60)
    assert recorded.repeats()
    recorded.ring.close()


def test_an_unknown_fault_is_refused():
    with pytest.raises(InputError, match="no fault 'sensor_timout'; did you mean sensor_timeout"):
        faults(["sensor_timout"])


def test_a_fault_that_is_named_twice_is_injected_once():
    assert [f.name for f in faults(["sensor_range"] * 2)] == ["sensor_range"]


@pytest.mark.parametrize("name", ["canopen_sensor_lost", "canopen_emergency"])
def test_a_device_that_is_well_is_no_fault(name: str, monkeypatch: pytest.MonkeyPatch):
    """The figures can fail: without the change, nothing stops."""
    monkeypatch.setitem(devices.CHANGES, name, lambda random: lambda found, k: found)
    (fault,) = faults([name])
    (outcome,) = run(built("pd").folder, [fault], 1, 3, quiet, 400)
    assert (outcome.injected, outcome.caught, outcome.missed[0].endswith("no reaction")) == (1, 0, True)


@pytest.mark.slow
@pytest.mark.soak
@pytest.mark.parametrize("name", [f.name for f in CANOPEN if f.level == "process"])
def test_faults_of_real_devices(name: str):
    pytest.importorskip("canopen")
    (outcome,) = run(built("pd").folder, faults([name]), 1, 3, quiet)
    assert outcome.injected == 1
    late = outcome.worst_ms > outcome.fault.limit_ms  # a busy computer's; no test asserts a time
    assert outcome.missed == [] or late


@pytest.mark.slow
@pytest.mark.soak
@pytest.mark.parametrize("name", NAMES)
def test_faults_of_a_policy_outside(name: str):
    pytest.importorskip("cyclonedds")
    (outcome,) = run(built("pd").folder, faults([name]), 1, 3, quiet)
    assert outcome.injected == 1
    late = outcome.worst_ms > outcome.fault.limit_ms  # a busy computer's; no test asserts a time
    assert outcome.missed == [] or late


@pytest.mark.slow
@pytest.mark.soak
def test_all_faults_a_hundred_times(slewright: Command, tmp_path: Path):
    path = tmp_path / "faults.json"
    done = slewright("faults", "--json", path, timeout=7200.0)
    assert done.returncode == 0, done.stderr
    figures = json.loads(path.read_text())
    for name in [f.name for f in faults()]:
        assert figures[name]["caught"] == figures[name]["injected"] == 100
        assert figures[name]["worst_reaction_ms"] <= figures[name]["limit_ms"]
