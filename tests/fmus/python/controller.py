"""A controller of a few lines, as a user would write it."""

import numpy as np


class Controller:
    """A PI controller that also filters."""

    inputs = {"target": {"start": 1.0, "unit": "rad"}, "angle": {"start": 0.0, "unit": "rad"}}  # noqa: RUF012
    outputs = {"u": 0.0, "filtered": np.zeros(3), "steps": 0, "settled": False}  # noqa: RUF012
    parameters = {"gain": {"start": 2.0, "min": 0.0, "max": 10.0}, "fails_at": 1e9}  # noqa: RUF012
    step_s = 0.1

    target: float
    angle: float
    gain: float
    fails_at: float
    filtered: np.ndarray

    def start(self) -> None:
        self.integral, self.steps, self.settled, self.u = 0.0, 0, False, 0.0

    def step(self, time: float, h: float) -> None:
        print("what a class prints does not disturb")
        if time >= self.fails_at:
            raise ValueError("no way on")
        error = self.target - self.angle
        self.integral += h * error
        self.u = self.gain * error + self.integral
        self.filtered = np.roll(self.filtered, 1)
        self.filtered[0] = self.u
        self.steps += 1
        self.settled = abs(error) < 0.01
