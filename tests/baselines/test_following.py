"""The time on a way: it waits for a machine that is far beside it, and not for ever."""

import numpy as np
import pytest

from baselines.following.arrival import BESIDE_M, MOST_WAIT_S, SENSED, Arrival, End, of_path
from baselines.planning.path import TICK_S, of_angles
from baselines.planning.planner import hanging

ANGLES = np.linspace((0.0, 1.0, -1.2), (1.0, 1.1, -1.0), 200)


def sensors(row: np.ndarray) -> dict[str, float]:
    """A machine in this pose, the tool hanging."""
    return dict(zip(SENSED, (*row, 0.0, 0.0), strict=True))


def started(moves: bool = False) -> Arrival:
    """An arrival at the beginning of a path."""
    path = of_angles(ANGLES, np.zeros((1, 3)), 0.5)
    target = hanging(path) if moves else hanging(path)[-1:]
    found = Arrival()
    found.begin(of_path(of_angles(ANGLES, target, 0.5)))
    return found


def test_the_time_on_a_way_goes_on_with_a_machine_that_follows() -> None:
    arrival = started()
    for tick in range(150):
        assert arrival.tick == tick
        arrival.watch(sensors(ANGLES[max(tick - 20, 0)]))  # 0.4 s late: about a metre


def test_it_waits_for_a_machine_that_is_held_and_goes_on_where_it_was() -> None:
    arrival = started()
    for _ in range(300):
        arrival.watch(sensors(ANGLES[0]))
    way = hanging(of_angles(ANGLES, np.zeros((1, 3)), 0.5))
    held = arrival.tick
    assert 0 < held < 100
    assert np.linalg.norm(way[held] - way[0]) == pytest.approx(BESIDE_M, abs=0.1)
    arrival.watch(sensors(ANGLES[held]))
    assert arrival.tick == held + 1


def test_it_does_not_wait_for_ever() -> None:
    arrival = started()
    for _ in range(round((MOST_WAIT_S + 30.0) / TICK_S)):
        arrival.watch(sensors(ANGLES[0]))
    assert arrival.ended


def test_a_target_that_moves_waits_for_nobody_and_neither_does_a_way_without_places() -> None:
    for arrival in (started(moves=True), Arrival()):
        if arrival.ended:
            arrival.begin(End(np.zeros((1, 3)), 0.5, 60.0))
        for _ in range(150):
            arrival.watch(sensors(ANGLES[0]))
        assert arrival.tick == 150
