"""The safety gate: nothing passes that gate.h forbids, whatever a controller says; every branch is taken."""

import math
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from fmus.toolchain import compiler
from specs.errors import RunError
from tests.runtime.core import gate as form
from tests.runtime.core.gate import AXES, LIMITS, WALLS, Gate, View, check, check_all, view

ANY = st.floats(allow_nan=True, allow_infinity=True)
FINITE = st.floats(-1e3, 1e3)


@pytest.fixture(scope="module")
def gate(tmp_path_factory: pytest.TempPathFactory) -> Gate:
    return Gate(form.build(tmp_path_factory.mktemp("gate")))


@st.composite
def views(draw: st.DrawFn) -> View:
    found = view(draw(st.integers(0, 1)), draw(st.integers(0, 1)))
    for axis in range(AXES):
        found.known[axis] = draw(st.integers(0, 1))
        found.speed[axis] = draw(FINITE)
    for wall in found.walls:
        wall.distance, wall.rate = draw(FINITE), draw(FINITE)
        for axis in range(AXES):
            wall.gradient[axis] = draw(FINITE)
    return found


@settings(max_examples=150, deadline=None)
@given(views(), st.lists(ANY, min_size=3, max_size=3), st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3))
def test_no_command_breaks_a_promise(gate: Gate, seen: View, wanted: list[float], held: list[float]) -> None:
    check(LIMITS, seen, wanted, held, *gate(LIMITS, seen, wanted, held))


def test_promises_hold_where_the_rules_meet(gate: Gate) -> None:
    check_all(gate, 4000)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(ANY, ANY, ANY), min_size=1, max_size=40))
def test_from_rest_no_sequence_of_commands_leaves_range_or_rate(
    gate: Gate, sequence: list[tuple[float, float, float]]
) -> None:
    held = [0.0] * AXES
    for wanted in sequence:
        before, (held, changed) = held, gate(LIMITS, view(), wanted, held)
        check(LIMITS, view(), wanted, before, held, changed)


@pytest.mark.parametrize("wanted", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_ends_in_neutral_within_three_ticks(gate: Gate, wanted: float) -> None:
    held = [1.0, -1.0, 0.5]
    for _ in range(3):
        held, changed = gate(LIMITS, view(), [wanted] * AXES, held)
        assert changed == 1
    assert held == [0.0] * AXES


def test_an_undisturbed_command_passes_unchanged(gate: Gate) -> None:
    assert gate(LIMITS, view(), [0.5, -0.4, 0.1], [0.5, -0.3, 0.0]) == ([0.5, -0.4, 0.1], 0)


def test_neutral_is_passed_only_as_far_as_it_may_be_left(gate: Gate) -> None:
    """From +0.1 towards full reverse: 0.4 towards neutral would end at -0.3; away from it 0.2 is the most."""
    assert gate(LIMITS, view(), [-1.0, 1.0, -1.0], [0.1, -0.1, 0.35])[0] == pytest.approx([-0.2, 0.2, -0.05])


@pytest.mark.parametrize("number", range(WALLS))
@pytest.mark.parametrize("by_hand", [0, 1])
def test_each_wall_stops_what_leads_to_it_and_lets_go_what_leads_away(
    gate: Gate, number: int, by_hand: int
) -> None:
    seen = view(by_hand=by_hand)
    seen.walls[number].distance, seen.walls[number].rate = 0.1, -0.2  # 0.6 s ahead: behind it
    seen.walls[number].gradient[1] = -2.0
    held, _ = gate(LIMITS, seen, [0.1, 0.1, 0.1], [0.0] * AXES)
    assert held == ([0.1, 0.1, 0.1] if by_hand and number < form.KEEP_OUT else [0.1, 0.0, 0.1])
    assert gate(LIMITS, seen, [0.1, -0.1, 0.1], [0.0] * AXES)[0] == [0.1, -0.1, 0.1]
    seen.walls[number].distance, seen.walls[number].rate = 2.6, 0.2  # it moves away already
    assert gate(LIMITS, seen, [0.1, 0.1, 0.1], [0.0] * AXES)[0] == [0.1, 0.1, 0.1]


def test_in_a_walls_zone_commands_towards_it_are_reduced_in_proportion(gate: Gate) -> None:
    seen = view()
    seen.walls[0].distance, seen.walls[0].gradient[1] = 1.25, -8.0  # half of the zone is left
    assert gate(LIMITS, seen, [1.0, 1.0, 1.0], [1.0, 0.45, 1.0])[0] == [1.0, 0.5, 1.0]
    seen.walls[0].rate = -1.0  # 0.6 m of it will be gone
    assert gate(LIMITS, seen, [1.0, 1.0, 1.0], [1.0, 0.45, 1.0])[0] == pytest.approx([1.0, 0.26, 1.0])
    assert gate(LIMITS, seen, [1.0, 0.1, 1.0], [1.0, 0.2, 1.0])[0] == [1.0, 0.1, 1.0]


def test_every_line_and_branch_of_the_gate_is_taken(tmp_path: Path) -> None:
    if shutil.which("gcov") is None or "cc" not in Path(compiler.command(compiler.host().name)[0]).name:
        pytest.skip("gcov or its compiler is not installed")
    try:
        library = form.build(tmp_path, extra=["--coverage", "-O0"])
    except RunError as missing:
        pytest.skip(f"no coverage library here: {str(missing).splitlines()[-1]}")
    script = (
        "import sys; from pathlib import Path; from tests.runtime.core.gate import Gate, check_all; "
        "check_all(Gate(Path(sys.argv[1])), 4000)"
    )
    subprocess.run([sys.executable, "-c", script, str(library)], check=True, cwd=form.CORE.parents[1])
    told = subprocess.run(
        ["gcov", "-b", "-c", "gate.c", "-o", str(tmp_path)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert re.search(r"Lines executed:100\.00% of \d\d", told), told
    assert re.search(r"Branches executed:100\.00% of \d\d", told), told
    assert re.search(r"Taken at least once:100\.00% of \d\d", told), told
