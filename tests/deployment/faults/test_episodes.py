"""An episode in which the rig itself was late proves nothing: it is repeated, and void if it stays late."""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from typing import Any

import pytest

from deployment.faults import processes
from deployment.faults.attacks import attacker
from deployment.faults.episodes import REPEATS, Result, episodes
from deployment.faults.lines import Lines
from deployment.faults.plant import Plant
from deployment.faults.run import faults, run
from deployment.faults.table import Fault, Outcome
from deployment.hil.punctual import PERIOD_NS, Punctual
from runtime.image import timeout_ticks
from specs.errors import RunError
from specs.signals import signal
from tests.runtime.bundles import built

GOOD: Result = (10.0, "")


class Rig:
    """In place of a plant: late as it is told, one word for each time that it is asked."""

    tick = 7

    def __init__(self, *late: bool) -> None:
        self._late, self.driven = iter(late), 0

    def late(self) -> bool:
        return next(self._late)

    def drive(self, ticks: int, condition: Callable[[], bool]) -> bool:
        self.driven += ticks
        return False


def quiet(what: str, done: float | None = None, total: float | None = None) -> None:
    pass


def outcome_of(rig: Rig, inject: Callable[[], Result], count: int = 1) -> Outcome:
    outcome = Outcome(Fault("x", "", "", 40.0))
    episodes(rig, outcome, count, quiet, inject)  # type: ignore[arg-type]
    return outcome


def counts(o: Outcome) -> tuple[int, int, int, int, int]:
    return o.injected, o.caught, len(o.missed), o.repeated_late, o.void


def test_a_late_episode_is_repeated_and_counts_once_it_is_in_time():
    late = Rig(
        False, True, True, True, False, False
    )  # each episode asks twice; what was before does not count
    assert counts(outcome_of(late, lambda: GOOD)) == (1, 1, 0, 2, 0)


@pytest.mark.parametrize("result", [GOOD, (None, ""), (90.0, ""), (10.0, "fault code none")])
def test_one_that_stays_late_is_void_and_neither_caught_nor_missed(result: Result):
    outcome = outcome_of(Rig(*[False, True] * (1 + REPEATS)), lambda: result)
    assert counts(outcome) == (1, 0, 0, REPEATS, 1)
    assert not outcome.passed
    assert (outcome.figures()["void"], outcome.figures()["repeated_late"]) == (1, REPEATS)


def test_a_miss_of_a_rig_in_time_is_a_miss_and_is_not_repeated():
    rig = Rig(False, False)
    assert counts(outcome_of(rig, lambda: (90.0, ""))) == (1, 0, 1, 0, 0)
    assert rig.driven  # somebody who was late could have said so


def test_an_error_is_a_late_rigs_or_ends_the_run():
    found: Iterator[bool] = iter([True, False])

    def inject() -> Result:
        if next(found):
            raise RunError("automatic operation did not come")
        return GOOD

    assert counts(outcome_of(Rig(False, True, False, False), inject)) == (1, 1, 0, 1, 0)
    found = iter([True])
    with pytest.raises(RunError, match="did not come"):
        outcome_of(Rig(False, False), inject)


def test_a_fault_that_ends_early_keeps_its_figures_and_the_others_are_injected(monkeypatch):
    monkeypatch.setattr(processes, "Plant", lambda *a, **k: nullcontext(Rig()))

    def ends(plant, outcome: Outcome, count: int, random, report) -> None:
        outcome.add(0, 10.0)
        raise RunError("automatic operation did not come")

    def caught(plant, outcome: Outcome, count: int, random, report) -> None:
        outcome.add(0, 10.0)

    wanted = [Fault(name, "", "", 40.0) for name in ("first", "second")]
    bundle: Any = None
    found = processes.run_all(bundle, wanted, 3, 1, quiet, {"first": ends, "second": caught})
    assert [(o.injected, o.caught, o.passed) for o in found] == [(1, 1, False), (1, 1, True)]
    assert found[0].missed == ["ended after 1 of 3 injections: automatic operation did not come"]


def test_a_sender_is_late_a_period_before_its_receiver_takes_it_for_lost():
    now = [0]
    punctual = Punctual(signal("operator_heartbeat"), lambda: now[0])
    limit = timeout_ticks(signal("operator_heartbeat")) - 1
    for periods, late in ((1, False), (limit, True), (1, False)):
        now[0] += periods * PERIOD_NS
        assert punctual.was_late() == late
    now[0] += limit * PERIOD_NS - 1
    assert not punctual.was_late()


def test_lines_of_a_process_are_whole_and_nobody_waits_for_them():
    said = (
        "import sys; print('a'); sys.stdout.write('b'); sys.stdout.flush(); sys.stdin.readline(); print('c')"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", said], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    lines, found = Lines(process), list[str]()
    while not found:
        found += lines.new()
    assert (found, lines.new(), lines.ended) == (["a"], [], False)
    process.communicate("\n")


def test_an_attack_that_died_is_no_success():
    with attacker(1, "no_such_attack") as attack:
        attack.begin()
        while not attack.over:
            time.sleep(0.01)
        assert attack.said == "the attacking process ended"
        attack.begin()
        assert attack.over


@pytest.mark.long
def test_a_rig_made_late_on_purpose_is_void(monkeypatch: pytest.MonkeyPatch):
    """With the real processes: it stands still as long as the machine takes for a lost controller."""
    reaction = Plant.reaction

    def held_up(plant: Plant, act: Callable[[], object], *more: object) -> float | None:
        return reaction(plant, lambda: (act(), time.sleep(0.3)), *more)  # type: ignore[arg-type]

    monkeypatch.setattr(Plant, "reaction", held_up)
    (outcome,) = run(built("pd").folder, faults(["control_killed"]), 1, 3, quiet)
    assert counts(outcome) == (1, 0, 0, REPEATS, 1)
