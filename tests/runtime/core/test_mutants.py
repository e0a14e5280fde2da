"""Mutation test of the gate: every small mistake in its code is found by what gate.h promises."""

import pytest

from runtime.image import INPUT, Group, group
from tests.runtime.core import core_mutants, guard_mutants
from tests.runtime.core.gate import CORE
from tests.runtime.core.mutants import EQUAL, killed, mutants, survivors


@pytest.mark.soak
def test_no_mutant_of_the_gate_survives() -> None:
    count, alive = survivors()
    assert count > 100
    assert not alive, [f"{m.line}: {m.after}" for m in alive]


def test_what_is_said_to_be_equal_is_among_the_mutants_of_the_core() -> None:
    """And why much of it is: no fault of an input of the others is one of input 0."""
    every = [m.after for name in core_mutants.TESTS for m in mutants((CORE / name).read_text())]
    assert [part for part in core_mutants.EQUAL if not any(part in after for after in every)] == []
    assert group(INPUT.signals[0]) is Group.PLANNER


def test_some_mutants_of_the_guard_are_found_at_once() -> None:
    """A sample of what foresees and measures; all of them: `python -m tests.runtime.core.guard_mutants`."""
    left_out = ("room", "allowed", "neutral")
    known = [m for m in guard_mutants.every() if not any(part in m.before for part in left_out)]
    assert len(known) > 200
    assert [m.after for m in known[7::60] if not guard_mutants.killed(m, 40)] == []


def test_some_mutants_are_found_at_once() -> None:
    """A sample of the above: one of each twenty, and those said to be equal are among the mutants."""
    every = list(mutants((CORE / "gate.c").read_text()))
    assert all(any(part in m.after for m in every) for part in EQUAL)
    different = [m for m in every if not any(part in m.after for part in EQUAL)]
    assert [m.after for m in different[::20] if not killed(m, 4000)] == []
