"""The event-locating integrator against closed forms."""

import numpy as np
import pytest

from blindtest.integrator import Flow
from specs.errors import RunError

G = 9.81


class Block:
    """A block on an incline with Coulomb friction: q'' = g sin(a) - mu g cos(a) sign(v), or at rest."""

    def __init__(self, angle: float, friction: float, speed: float) -> None:
        self.pull, self.grip = G * np.sin(angle), friction * G * np.cos(angle)
        self.slide = float(np.sign(speed))

    def flow(self, step: float = 0.05) -> Flow:
        return Flow(2, self.rates, self.guards, self.jump, step)

    def rates(self, t, x):
        return np.array([x[1], self.pull - self.slide * self.grip]) if self.slide else np.zeros(2)

    def guards(self, t, x):
        if self.slide:
            return np.array([self.slide * x[1], 1.0])
        return np.array([self.grip - self.pull, self.grip + self.pull])

    def jump(self, t, x, which):
        sticks = abs(self.pull) <= self.grip
        self.slide = 0.0 if sticks else float(np.sign(self.pull))
        return np.array([x[0], 0.0])


def test_a_block_pushed_uphill_stops_where_energy_says_and_stays():
    block = Block(angle=0.3, friction=0.5, speed=-2.0)
    x, events = block.flow().advance(0.0, 10.0, np.array([0.0, -2.0]))
    way = -(2.0**2) / (2 * (block.pull + block.grip))
    assert x == pytest.approx([way, 0.0], abs=1e-11)
    assert events == 1
    assert block.slide == 0.0


def test_a_block_on_a_steep_incline_turns_and_slides_down():
    block = Block(angle=0.8, friction=0.5, speed=-2.0)
    x, events = block.flow().advance(0.0, 2.0, np.array([0.0, -2.0]))
    up, down = block.pull + block.grip, block.pull - block.grip
    turn = 2.0 / up
    assert events == 1
    assert x[0] == pytest.approx(-2.0 * turn + 0.5 * up * turn**2 + 0.5 * down * (2.0 - turn) ** 2, abs=1e-10)
    assert x[1] == pytest.approx(down * (2.0 - turn), abs=1e-10)


def test_a_ball_bounces_at_the_times_of_the_geometric_series():
    def jump(t, x, which):
        return np.array([0.0, -0.5 * x[1]])

    flow = Flow(2, lambda t, x: np.array([x[1], -G]), lambda t, x: x[:1], jump, 0.1)
    fall = np.sqrt(2 * 1.0 / G)
    x, events = flow.advance(0.0, fall * (1 + 1.0 + 0.5 + 0.1), np.array([1.0, 0.0]))
    assert events == 3
    assert x[1] == pytest.approx((0.5**3 - 0.1) * np.sqrt(2 * G), rel=1e-9)


def test_smooth_motion_has_fourth_order():
    def error(step):
        flow = Flow(2, lambda t, x: np.array([x[1], -x[0]]), lambda t, x: np.ones(1), lambda t, x, i: x, step)
        return abs(flow.advance(0.0, 2.0, np.array([1.0, 0.0]))[0][0] - np.cos(2.0))

    assert error(0.1) / error(0.05) == pytest.approx(16.0, rel=0.1)


def test_events_without_end_are_told():
    flow = Flow(1, lambda t, x: -np.ones(1), lambda t, x: x, lambda t, x, i: x, 0.1)
    with pytest.raises(RunError, match="without end"):
        flow.advance(0.0, 1.0, np.array([0.05]))
