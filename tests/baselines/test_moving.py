"""Things that move are avoided in time: waits, which way arrives first, reasons."""

import math
from dataclasses import replace
from pathlib import Path as File

import numpy as np
import pytest

pytest.importorskip("coal", reason="pip install 'slewright[scenes]'")
pytest.importorskip("ompl", reason="pip install 'slewright[scenes]'")
pytest.importorskip("toppra", reason="pip install 'slewright[scenes]'")

from baselines.nmpc_path.field import Field
from baselines.planning.body import ROUNDED_M, Body
from baselines.planning.legs import Legs
from baselines.planning.moving import WAIT_STEP_S, Waits
from baselines.planning.path import TICK_S, Path
from baselines.planning.planner import Planner, pose_of
from slewright.__main__ import run as command
from specs.errors import InputError
from specs.outlines import away
from specs.scene import Box, Goal, Scene, load
from verification.scenes.course import Course
from verification.scenes.run import Case, run
from verification.scenes.score import score

START, END = (Goal(slew_deg=slew, radius_m=10.0, height_m=4.0) for slew in (0.0, 90.0))
HALFWAY, BEYOND = (7.0, 7.0, 6.0), (30.0, 30.0)  # m; and how far something is gone then
LEAVES_S, GONE_S = 12.0, 20.0


def box(*path: tuple[float, float, float, float], middle: tuple[float, float, float] = HALFWAY) -> Box:
    """Too high to be passed over."""
    return Box(name="lift truck", middle=middle, size=(2.0, 2.0, 12.0), path=path)


def leaving(middle: tuple[float, float, float] = HALFWAY) -> Box:
    return box((0, 0, 0, 0), (LEAVES_S, 0, 0, 0), (GONE_S, *BEYOND, 0), middle=middle)


def yard(*things: Box) -> Scene:
    return Scene(name="yard", description="things move", start=START, targets=(END,), things=things)


def least(scene: Scene, late_s: float = 0.5, now_s: float = 0.0, most_s: float = 30.0) -> tuple[float, Path]:
    """The wait, and the path without it."""
    path = straight()
    waited, reason = Waits(Body(scene), late_s, most_s).before(path, now_s)
    assert waited is not None, reason
    return waited.seconds - path.seconds, path


def straight() -> Path:
    leg = Planner(yard()).leg(pose_of(START), (END,))
    assert leg.path is not None
    return leg.path


def clear(scene: Scene, angles: np.ndarray, first_s: float) -> bool:
    """Whether a machine that is there from `first_s` on keeps off all, each thing put where it is by hand."""
    for tick in range(0, len(angles), 5):
        (thing,) = scene.things
        place = tuple(away(thing, np.array([first_s + tick * TICK_S]))[0].tolist())
        there = replace(scene, things=(replace(thing, path=((0.0, *place),)),))
        if Body(there).clearance(angles[tick])[0] <= -ROUNDED_M:
            return False
    return True


def test_the_wait_is_the_least_that_keeps_off_and_counts_being_late():
    scene = yard(leaving())
    wait, path = least(scene)
    lates = (-0.5, 0.0, 0.5)
    assert 4.0 < wait < GONE_S
    assert all(clear(scene, path.angles, wait + late) for late in lates)
    assert not all(clear(scene, path.angles, wait - WAIT_STEP_S + late) for late in lates)
    assert least(scene, late_s=0.0)[0] == pytest.approx(wait - 0.5, abs=WAIT_STEP_S)


def test_the_wait_is_counted_from_when_the_leg_begins():
    scene = yard(leaving())
    first = least(scene)[0]
    assert least(scene, now_s=5.0)[0] == pytest.approx(first - 5.0, abs=WAIT_STEP_S)
    assert least(scene, now_s=GONE_S)[0] == 0.0


def test_what_comes_later_is_passed_before():
    coming = box((20, *BEYOND, 0), (30, 0, 0, 0), (40, *BEYOND, 0))
    assert least(yard(coming))[0] == 0.0
    assert least(yard(coming), now_s=26.0)[0] > 0.0


def test_a_path_that_waits_stands_at_its_start_first():
    path = straight()
    waited = path.delayed(1.0)
    assert path.delayed(0.0) is path
    assert waited.there == path.there + 50
    assert np.array_equal(waited.angles[50:], path.angles)
    assert np.array_equal(waited.rates[50:], path.rates)
    assert np.ptp(waited.angles[:51], axis=0).max() == np.abs(waited.rates[:50]).max() == 0.0


def test_what_never_crosses_costs_nothing():
    far = leaving((30.0, -10.0, 6.0))
    legs, alone = (Legs(Planner(yard(*things))).foreseen()[0] for things in ((far,), ()))
    assert legs.path is not None
    assert alone.path is not None
    assert np.array_equal(legs.path.angles, alone.path.angles)
    assert legs.checks == alone.checks
    assert Legs(Planner(yard())).most_wait_s == 0.0


def test_where_something_is_at_the_target_for_a_while_it_is_waited_for():
    scene = yard(leaving(middle=(*END.xyz[:2], 6.0)))
    Legs(Planner(scene)).check()
    (leg,) = Legs(Planner(scene)).foreseen()
    assert leg.path is not None
    assert LEAVES_S - 2.0 < leg.path.seconds < GONE_S + 2.0


def test_what_comes_to_the_target_is_waited_for_before_the_machine_is_there():
    """It could be there and away again, but nothing says that it will go."""
    x, y, _ = END.xyz
    coming = box((10, *BEYOND, 0), (16, 0, 0, 0), (17, 0, 0, 0), (23, *BEYOND, 0), middle=(x, y, 6.0))
    (leg,) = Legs(Planner(yard(coming))).foreseen()
    assert leg.path is not None
    assert leg.path.seconds > 17.0


@pytest.mark.slow
@pytest.mark.parametrize(("until_s", "waits"), [(6.0, True), (25.0, False)])
def test_who_arrives_first_is_taken(until_s: float, waits: bool):
    """It can be lifted over: that takes longer than a short wait, and is quicker than a long one."""
    path = ((0.0, 0.0, 0.0, 0.0), (until_s, 0.0, 0.0, 0.0), (until_s + 5.0, *BEYOND, 0.0))
    high = Box(name="lift truck", middle=(7.0, 7.0, 3.5), size=(2.0, 2.0, 7.0), path=path)
    (leg,) = Legs(Planner(yard(high))).foreseen()
    over = Planner(yard(high)).leg(pose_of(START), (END,)).path
    assert leg.path is not None
    assert over is not None
    assert np.array_equal(leg.path.angles, over.angles) != waits
    assert leg.path.seconds < over.seconds if waits else leg.path.seconds == over.seconds


def test_a_target_that_is_taken_for_good_is_refused_by_name(
    tmp_path: File, capsys: pytest.CaptureFixture[str]
):
    x, y, _ = END.xyz
    scene = yard(box((0, *BEYOND, 0), (9, 0, 0, 0), middle=(x, y, 6.0)))
    with pytest.raises(InputError, match=r"target 1: .* too near to lift truck .*; free: slew"):
        Legs(Planner(scene)).check()
    (leg,) = Legs(Planner(scene)).foreseen()
    assert leg.path is None
    assert "too near to lift truck" in leg.reason
    place = "slew_deg = {:.1f}, radius_m = 10.0, height_m = 4.0"
    file = tmp_path / "parked.toml"
    file.write_text(
        f'description = "d"\nstart = {{ {place.format(0)} }}\ntargets = [{{ {place.format(90)} }}]\n'
        f'[[things]]\nkind = "box"\nname = "lift truck"\nmiddle = [{x}, {y}, 6.0]\nsize = [2.0, 2.0, 12.0]\n'
        "path = [[0.0, 30.0, 30.0, 0.0], [9.0, 0.0, 0.0, 0.0]]\n"
    )
    assert command(["scenes", str(file)]) == 2
    assert "target 1: slew 90.0°" in capsys.readouterr().err


def test_where_no_wait_helps_the_reason_says_what_and_when():
    x, y, _ = END.xyz
    stays = box((0, 0, 0, 0), (60, 0, 0, 0), (70, *BEYOND, 0), middle=(x, y, 6.0))
    (leg,) = Legs(Planner(yard(stays))).foreseen()
    assert leg.path is None
    assert "the machine would come too near to lift truck; no wait up to 30 s helps" in leg.reason
    course = Course(yard(stays), "", 1)
    assert (course.begin(0), course.ended, course.begins) == (None, True, [])
    assert course.taken[0].reason == leg.reason


def test_the_carriage_keeps_off_where_things_come_until_they_rest():
    """Something stands behind the machine where the counterweight turns, and leaves."""
    behind = box((0, 0, 0, 0), (5, 0, 0, 0), (10, 0, -BEYOND[1], 0), middle=(0.0, -4.2, 2.0))
    waits = Waits(Body(yard(behind)), 0.5, 30.0)
    waited, _ = waits.before(path := straight(), 0.0)
    assert waited is not None
    assert 0.0 < waited.seconds - path.seconds < 10.0
    assert waits.before(path, 11.0)[0] is path


def test_a_run_chooses_each_leg_when_it_begins():
    scene = yard(leaving(middle=(*END.xyz[:2], 6.0)))
    early, late = (Course(scene, "", 1) for _ in range(2))
    paths = [course.begin(tick) for course, tick in ((early, 0), (late, round(GONE_S / TICK_S)))]
    assert paths[0] is not None
    assert paths[1] is not None
    assert paths[0].seconds > paths[1].seconds == straight().seconds
    assert early.foreseen[0].path is not None
    assert early.foreseen[0].path.seconds == paths[0].seconds
    assert early.ended
    assert early.longest_s > paths[0].seconds + 30.0


def test_distances_to_what_moves_are_those_of_its_place_at_the_time():
    scene = yard(leaving())
    pose = np.array([[math.pi / 4, 1.1, -2.0, 0.0, 0.0]])
    there, gone = (Field(scene).planes(pose, time)[0].min() for time in (0.0, GONE_S))
    still, free = (Field(yard(*things)).planes(pose)[0].min() for things in ((box(),), ()))
    assert there == pytest.approx(still)
    assert gone == pytest.approx(free)


@pytest.mark.long
@pytest.mark.parametrize("name", ["floor", "nmpc"])
def test_the_crossing_is_driven_between_two_visits_of_the_reach_stacker(name: str):
    row = score(run(Case(load("crossing"), name)))
    assert (row["missed"], row["targets"], row["contact"]) == (0, 2, False)
    assert row["cycle"] < 35.0
