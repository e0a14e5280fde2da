"""The procedure: order, records, resuming, what a failed or interrupted step leaves."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from deployment.commissioning.operator import Answering, Question
from deployment.commissioning.procedure import NAMES, STEPS, find, perform
from deployment.commissioning.rig import Rig
from deployment.commissioning.session import Session
from deployment.commissioning.simulated import SimulatedMachine, SimulatedOperator
from deployment.commissioning.wiring import named
from runtime.policy import open_core
from specs.errors import InputError
from tests.runtime.bundles import built

IDENTITY = {"machine": "simulated", "bundle": "0", "who": "a test"}


@pytest.fixture
def machine() -> Iterator[SimulatedMachine]:
    with SimulatedMachine() as found:
        yield found


def rig_of(machine: SimulatedMachine, controller: str = "pi") -> Rig:
    return Rig(open_core(built(controller)), machine, machine, simulated=True)


def session(folder: Path, resume: bool = False, **changes: str) -> Session:
    return Session.open(folder, NAMES, {**IDENTITY, **changes}, resume)


def test_a_step_refuses_to_start_before_those_before_it_have_passed(
    machine: SimulatedMachine, tmp_path: Path
) -> None:
    rig, operator, kept = rig_of(machine), SimulatedOperator(machine), session(tmp_path / "s")
    with pytest.raises(InputError, match="step safety refuses to start: step bus is not done"):
        perform(find("safety"), rig, operator, kept)
    assert perform(find("bus"), rig, operator, kept).verdict == "passed"
    assert perform(find("safety"), rig, operator, kept).verdict == "passed"


def test_a_failed_step_says_what_and_later_ones_do_not_start(tmp_path: Path) -> None:
    kept = session(tmp_path / "s")
    with SimulatedMachine((named("q_boom frozen"), named("ToolImuAcc missing"))) as machine:
        rig, operator = rig_of(machine), SimulatedOperator(machine)
        outcome = perform(find("bus"), rig, operator, kept)
        assert outcome.verdict == "failed"
        said = str(outcome.failures[0])
        assert said.startswith(
            "message ToolImuAcc: rate: measured 0 1/s, expected 44.67 … 55.33; look at: ToolImu"
        )
        with pytest.raises(InputError, match="step bus is failed"):
            perform(find("safety"), rig, operator, kept)
    record = json.loads((tmp_path / "s" / "01-bus.json").read_text())
    assert record["verdict"] == "failed"
    assert any(not c["passed"] for c in record["checks"])


class Leaves:
    """Does nothing that is asked and interrupts at the first question of a step that moves."""

    name = "nobody"

    def watching(self) -> None:
        """Never comes to that."""

    def answer(self, question: Question) -> Answering:
        """Ctrl-C."""
        yield
        raise KeyboardInterrupt


def test_an_interrupted_step_leaves_the_machine_at_rest_and_a_record(
    machine: SimulatedMachine, tmp_path: Path
) -> None:
    rig, kept = rig_of(machine), session(tmp_path / "s")
    with pytest.raises(KeyboardInterrupt):
        perform(STEPS[0], rig, Leaves(), kept)
    found = kept.record("bus")
    assert found
    assert found["verdict"] == "interrupted"
    assert all(rig.now(n) == 0.0 for n in ("u_slew", "u_boom", "u_stick"))
    again = session(tmp_path / "s", resume=True)
    assert perform(STEPS[0], rig, SimulatedOperator(machine), again).verdict == "passed"


def test_doing_a_step_again_removes_the_records_of_later_ones(
    machine: SimulatedMachine, tmp_path: Path
) -> None:
    rig, operator, kept = rig_of(machine), SimulatedOperator(machine), session(tmp_path / "s")
    for name in ("bus", "safety", "bus"):
        perform(find(name), rig, operator, kept)
    assert kept.passed("bus")
    assert kept.record("safety") is None


def test_a_folder_is_gone_on_with_only_if_told_and_only_with_the_same_bundle(tmp_path: Path) -> None:
    session(tmp_path / "s")
    with pytest.raises(InputError, match="--resume goes on"):
        session(tmp_path / "s")
    with pytest.raises(InputError, match="begun with bundle 0, this is 1"):
        session(tmp_path / "s", resume=True, bundle="1")
    with pytest.raises(InputError, match="holds no commissioning"):
        session(tmp_path / "t", resume=True)
    (tmp_path / "u").mkdir()
    (tmp_path / "u" / "letter").touch()
    with pytest.raises(InputError, match="holds something else"):
        session(tmp_path / "u")


def test_an_operator_who_takes_the_joystick_ends_the_motion(machine: SimulatedMachine) -> None:
    rig = rig_of(machine)
    rig.step(10)
    machine.enable = 1.0
    rig.step(5)
    rig.hands_off, rig.wanted = True, (0.3, 0.0, 0.0)
    rig.step(10)
    assert rig.now("u_slew") == pytest.approx(0.3)
    machine.joystick["joystick_slew"] = -0.5
    rig.step(5)
    assert rig.taken_over
    assert rig.now("u_slew") < 0.0


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize(
    "which",
    [
        "nominal",
        *(pytest.param(n, marks=pytest.mark.soak) for n in ("tuning:1", "tuning:3", "validation:2")),
        "validation:5",
    ],
)
def test_a_machine_that_is_wired_right_passes_every_step(which: str, tmp_path: Path) -> None:
    """Draws in which a limit that was made for the nominal machine failed, and one more."""
    kept = session(tmp_path / "s")
    with SimulatedMachine((), 1, which) as machine:
        rig, operator = rig_of(machine, "pd"), SimulatedOperator(machine)
        for step in STEPS:
            outcome = perform(step, rig, operator, kept)
            assert outcome.verdict == "passed", [str(c) for c in outcome.failures]
