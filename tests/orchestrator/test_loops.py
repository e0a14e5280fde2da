"""Algebraic loops are found and named; that they are solved is among the cases of the test pack."""

from pathlib import Path

import pytest

from orchestrator.check import load_system
from orchestrator.order import algebraic_loops
from orchestrator.testpack.case import Case
from orchestrator.testpack.cases import CASES
from orchestrator.testpack.pack import write_case
from tests.orchestrator.systems import OSCILLATOR, load


def case(name: str) -> Case:
    return next(c for c in CASES if c.name == name)


@pytest.mark.parametrize("fmi_version", [2, 3])
def test_a_loop_is_named_with_its_members(tmp_path: Path, fmi_version: int) -> None:
    system = load_system(write_case(tmp_path, case(f"loop-fmi{fmi_version}")))
    assert [sorted(members) for members in algebraic_loops(system)] == [["a.y", "b.y"]]
    warning = next(w for w in system.warnings if w.startswith("algebraic loop"))
    assert "a.y" in warning
    assert "b.y" in warning
    assert "solved at the start, opened in steps, in which jacobi takes values of the last one" in warning


def test_a_closed_chain_without_feedthrough_is_none(tmp_path: Path) -> None:
    system = load(tmp_path, OSCILLATOR, ["position", "speed"])
    assert algebraic_loops(system) == []
    assert not [w for w in system.warnings if "loop" in w]
