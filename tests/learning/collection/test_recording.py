"""Single recordings on the simulated reference machine: limits, failing sensors, operator, slew control."""

from dataclasses import replace

import numpy as np
import pytest

from learning.collection.command import Command, Sample
from learning.collection.machine import RECORDED, LockStep, LockStepRun
from learning.collection.operator_model import REACTION_S, Operator
from learning.collection.plan import PERIOD_S, clearance
from learning.collection.recorder import SETTLE_S
from learning.collection.slew_control import Gains, SlewControl
from tests.learning.collection.pilots import Always, made, one

FULL = Command(1.0, 0.2, 0.2)


# ---- limits on the machine itself ----


@pytest.mark.parametrize(
    ("command", "pose"),
    [
        (Command(0.0, 0.2, 0.2), (1.2, -0.7)),
        (Command(0.0, -0.2, -0.2), (1.1, -1.3)),
        (Command(0.0, -0.2, 0.0), (1.1, -1.8)),  # towards the ground
        (Command(0.0, 0.2, -0.2), (1.2, -1.8)),  # towards the cabin
    ],
)
def test_full_arm_speed_into_a_limit_ends_before_it(machine, plan, tmp_path, command, pose):
    found = made(machine, plan, one(8.0, *pose), Always(command), tmp_path / "a.parquet")
    assert found.complete
    boom, stick = found.column("q_boom"), found.column("q_stick")
    moved = abs(boom - boom[0]).max() + abs(stick - stick[0]).max()
    assert moved > 0.1
    assert found.meta["clipped"]["arm"] > 5
    slack = 0.05  # rad; what the arm moves further than a pure delay
    assert boom.min() > plan.limits.boom_rad[0] - slack
    assert boom.max() < plan.limits.boom_rad[1] + slack
    assert stick.min() > plan.limits.stick_rad[0] - slack
    assert stick.max() < plan.limits.stick_rad[1] + slack
    assert clearance(boom, stick).min() > 0.0


def test_full_joystick_is_held_to_the_speed_limit(machine, plan, tmp_path):
    slow = replace(plan, limits=replace(plan.limits, slew_speed_rad_s=0.45))
    found = made(machine, slow, one(10.0, 1.35, -1.9), Always(Command(1.0, 0.0, 0.0)), tmp_path / "a.parquet")
    assert found.complete
    assert found.meta["clipped"]["slew speed"] > 10
    assert 0.35 < found.column("qd_slew").max() < 1.1 * 0.45


class Faulty(LockStep):
    """A machine one of whose sensors fails after 3 s."""

    def __init__(self, name: str, value: float) -> None:
        super().__init__()
        self.place, self.value = 1 + RECORDED.index(name), value

    def at(self, q_boom: float, q_stick: float, load_kg: float, seed: int) -> LockStepRun:
        run, usual = super().at(q_boom, q_stick, load_kg, seed), None
        usual = run.advance

        def advance(command: Command) -> np.ndarray:
            rows = usual(command)
            rows[rows[:, 0] >= 3.0, self.place] = self.value
            return rows

        run.advance = advance  # type: ignore[method-assign]
        return run


@pytest.mark.parametrize(("name", "value"), [("q_boom", np.nan), ("qd_slew", 0.1), ("p_slew_a", 1e8)])
def test_a_failing_sensor_ends_the_recording_in_neutral_and_marks_it(plan, tmp_path, name, value):
    found = made(Faulty(name, value), plan, one(20.0), Always(FULL), tmp_path / "a.parquet")
    assert not found.complete
    assert found.reason.startswith("aborted: ")
    assert name in found.reason
    assert 3.0 + SETTLE_S <= len(found) * 0.02 <= 3.0 + SETTLE_S + 1.0
    rest = found.time >= 3.0 + 0.7
    for command in ("u_slew", "qd_boom_ref", "qd_stick_ref"):
        assert found.column(command)[found.time < 2.9].any()
        assert not found.column(command)[rest].any()
    if name != "qd_slew":
        assert abs(found.column("qd_slew")[-20:]).mean() < 0.05  # the machine has come to rest


# ---- driving and closed loop ----


def test_the_operator_reaches_targets_late_and_with_an_unsteady_hand(machine, plan, tmp_path):
    recording = one(60.0, 1.2, -1.7)
    operator = Operator(recording.draws(1, "operator"), plan.limits, (0.0, 1.2, -1.7))
    seen = []

    class Watched:
        def __call__(self, period: int, sample: Sample) -> Command:
            command = operator(period, sample)
            seen.append((operator.intent.target, sample["q_slew"]))
            return command

    found = made(machine, plan, recording, Watched(), tmp_path / "a.parquet")
    targets = list(dict.fromkeys(target for target, _ in seen))
    ends = [[q for t, q in seen if t == target][-1] for target in targets[:-1]]
    errors = [abs(np.degrees(q - t.slew)) for q, t in zip(ends, targets, strict=False)]
    assert len(targets) >= 4
    assert np.median(errors) < 5.0
    u = found.column("u_slew")[::5]
    assert len(np.unique(u)) > 150  # never twice the same
    assert abs(np.diff(u)).max() < 1.0


def test_the_operator_sees_nothing_before_its_reaction_time(plan):
    recording = one(10.0)

    def commands(jump: int) -> list[Command]:
        operator = Operator(recording.draws(1, "operator"), plan.limits, (0.0, 1.1, -1.3))
        away = {"q_slew": 0.0, "qd_slew": 0.0, "q_boom": 1.1, "q_stick": -1.3}
        near = {**away, "q_slew": operator.intent.target.slew}
        return [operator(k, near if k >= jump else away) for k in range(40)]

    differs = [k for k, (a, b) in enumerate(zip(commands(99), commands(20), strict=True)) if a != b]
    assert REACTION_S[0] - PERIOD_S <= (differs[0] - 20) * PERIOD_S <= REACTION_S[1] + PERIOD_S


def test_the_slew_controller_settles_on_its_targets(machine, plan, tmp_path):
    recording = one(40.0, 1.2, -1.7)
    control, ends = SlewControl(Gains.of(plan.gains), recording, 1), []

    class Watched:
        def __call__(self, period: int, sample: Sample) -> Command:
            before = control.target
            command = control(period, sample)
            if control.target != before and period > 20:
                ends.append(abs(np.degrees(sample["q_slew"] - before)))
            return command

    found = made(machine, plan, recording, Watched(), tmp_path / "a.parquet")
    assert found.complete
    assert len(ends) >= 2
    assert np.median(ends) < 3.0
