"""Algebraic loops are found and named; that they are solved is among the cases of the test pack."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.testpack.case import Case
from benchmarks.testpack.cases import CASES
from benchmarks.testpack.pack import write_case
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.order import algebraic_loops
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


@pytest.mark.parametrize("fmi_version", [2, 3])
def test_iteration_solves_a_steep_loop_in_every_step(tmp_path: Path, fmi_version: int) -> None:
    """y1 = 1 + y2 / 2, y2 = -3 y1: the loop's gain is -1.5, so that plain repetition would run away."""
    path = write_case(tmp_path, case(f"loop-steep-fmi{fmi_version}"))
    system = load_system(path)
    settings = replace(system.settings, algorithm="iterate", tolerance=1e-9)
    statistics: dict[str, Any] = {}
    record = simulate(system, 20, settings=settings, statistics=statistics)
    np.testing.assert_allclose(record.column("a_y"), 0.4, rtol=0, atol=1e-8)
    assert statistics["sweeps"] < 20 * 6
