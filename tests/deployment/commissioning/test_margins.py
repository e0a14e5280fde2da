"""The drive of a machine measured at limited authority, and controllers that are refused on it.

Machines that differ in one thing from the simulated one: later, or with twice the speed beyond the dead band.
"""

import json
import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from baselines.margins.coverage import TABLE
from baselines.margins.drive import Drive
from deployment.bundling.build import bundle
from deployment.commissioning import again, calibration
from deployment.commissioning.bench import Bench, Failed
from deployment.commissioning.procedure import NAMES
from deployment.commissioning.rig import Rig
from deployment.commissioning.session import PASSED, Session
from deployment.commissioning.simulated import SimulatedMachine, SimulatedOperator
from deployment.commissioning.steps import margins
from deployment.commissioning.wiring import Fault, Wiring
from runtime.bundle import Bundle
from runtime.policy import open_core
from specs.errors import InputError
from tests.runtime.bundles import built, folder as bundles

BAND = 0.12  # of the simulated machine, from which its valve is made stronger
MACHINES = ("as it is", "0.4 s later", "twice the gain")


class Stronger(Wiring):
    """A valve that opens twice as far beyond the dead band."""

    def commanded(self, values: Mapping[str, float]) -> dict[str, float]:  # type: ignore[override]
        u = values["u_slew"]
        size = min(abs(u), BAND) + 2.0 * max(abs(u) - BAND, 0.0)
        return {**values, "u_slew": math.copysign(min(size, 1.0), u)}


@cache
def tried() -> Bundle:
    """The PD with a table of one plant, whose drive is about that of the simulated machine."""
    table = {"passed": ["machine"], "drives": {"machine": Drive(0.125, 0.172, 0.246).as_dict()}}
    return bundle("pd", bundles() / "pd-tried", files={TABLE: json.dumps(table).encode()})


@cache
def measured(which: str) -> Bench:
    """The bench after the step on one of MACHINES, passed or not."""
    faults = (Fault("late", ("u_slew",), 0.4),) if which == "0.4 s later" else ()
    with SimulatedMachine(faults) as machine:
        if which == "twice the gain":
            machine.valve_wiring = Stronger()
        rig = Rig(open_core(tried()), machine, machine, simulated=True)
        rig.step(25)
        bench = Bench(rig, SimulatedOperator(machine))
        try:
            margins.run(bench)
        except Failed:
            bench.found["failed"] = True
        bench.neutral()
    return bench


def failures(which: str) -> list[str]:
    return [str(c) for c in measured(which).checks if not c.passed]


@pytest.mark.long
def test_the_reference_machine_is_accepted() -> None:
    found = measured("as it is").found
    assert failures("as it is") == []
    assert "failed" not in found
    assert found["gain margin"] > 1.1
    assert found["delay margin"] > 0.1
    assert found["plants"] == ["machine"]


@pytest.mark.long
def test_a_machine_that_is_later_is_measured_and_refused() -> None:
    """By what it is later: the same motion, so that only the delay differs."""
    later, usual = measured("0.4 s later").found, measured("as it is").found
    assert later["delay_s"] - usual["delay_s"] == pytest.approx(0.4, abs=0.03)
    assert later["gain"] == pytest.approx(usual["gain"], rel=0.1)
    assert later["dead_band"] == pytest.approx(usual["dead_band"], abs=0.011)
    (delay,) = [text for text in failures("0.4 s later") if text.startswith("delay of the slew drive")]
    assert "expected at most 0.296" in delay
    assert "it passed on machine; take one that was tried on such a drive" in delay
    assert any("gain margin of controller pd" in text for text in failures("0.4 s later"))


@pytest.mark.long
def test_a_machine_with_twice_the_gain_is_measured_and_refused() -> None:
    """A drive of more speed pulls at its tool more, and its speed is no line: not quite twice."""
    double, usual = measured("twice the gain").found, measured("as it is").found
    assert double["gain"] / usual["gain"] == pytest.approx(2.0, rel=0.15)
    assert double["delay_s"] == pytest.approx(usual["delay_s"], abs=0.05)
    assert any(text.startswith("gain of the slew drive") for text in failures("twice the gain"))
    assert any("delay margin of controller pd" in text for text in failures("twice the gain"))


@pytest.mark.long
@pytest.mark.parametrize("which", MACHINES)
def test_the_controller_does_not_move_the_machine_before_it_is_accepted(which: str) -> None:
    """Manual operation all the time, the joystick never beyond the authority of the step."""
    bench = measured(which)
    trace = bench.rig.since(bench.begun)
    assert not any(bench.rig.mode == mode for mode in ("automatic", "hold"))
    assert float(abs(trace["u_slew"]).max()) <= bench.f.commissioning_most + 1e-3
    assert float(abs(trace["u_boom"]).max()) == float(abs(trace["u_stick"]).max()) == 0.0


def written(folder: Path, which: str, **changes: float) -> Path:
    """A calibration.json with the motion of one of MACHINES."""
    bench = measured(which)
    session = Session.open(folder / "s", NAMES, {"machine": "a test"}, resume=False)
    session.write("margins", PASSED, bench.as_dict(), bench.rig.since(bench.begun))
    calibration.write(session)
    path = folder / "s" / calibration.FILE
    content = json.loads(path.read_text())
    content["drive"] |= changes
    path.write_text(json.dumps(content))
    return path


@pytest.mark.long
def test_another_controller_is_tried_on_the_motion_that_was_recorded(tmp_path: Path) -> None:
    """What is said of a bundle afterwards is what the step said of it on the machine."""
    assert again.failures(tried(), written(tmp_path, "as it is")) == []
    said = again.failures(built("pd"), written(tmp_path / "late", "0.4 s later"))
    assert len(said) == 2  # margins of gain and delay: this bundle has no table
    assert "gain margin of controller pd on this machine: measured 0.966, at least 1.1" in said[0]
    later = again.failures(tried(), written(tmp_path / "told", "as it is", delay_s=0.7))
    assert len(later) == 1
    assert "delay of the slew drive: measured 0.7, at most 0.296 s" in later[0]


@pytest.mark.parametrize(
    ("motion", "said"),
    [({"file": "gone.parquet", "sines": {"0.5": [0, 10]}}, "gone.parquet"), ({"file": "a"}, "'sines'")],
)
def test_a_motion_that_cannot_be_read_is_refused(tmp_path: Path, motion: dict[str, Any], said: str) -> None:
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps({"drive": Drive(0.1, 0.2, 0.3).as_dict(), "motion": motion}))
    with pytest.raises(InputError, match=said):
        again.failures(built("pd"), path)


def test_a_machine_whose_drive_was_not_measured_says_nothing(tmp_path: Path) -> None:
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps({"motion": {}}))
    assert again.failures(built("pd"), path) == []
