"""Angles from sensors that begin again after a turn, made continuous: a model's angle does not jump."""

import math

import numpy as np

TURNS = {"rad": 2.0 * math.pi, "deg": 360.0, "rev": 1.0}  # a full turn in units of angles
WRAPS = 0.75  # of a turn: a step that large between two samples is one of the sensor
STEADY = 0.4  # of a turn: with larger steps beside those, the angle may really move so far
WITHIN = 1.05  # of a turn, within which a sensor that wraps stays (the rest is noise)


def continuous(values: np.ndarray, unit: str) -> np.ndarray:
    """An angle [n] without a sensor's jumps by a turn; values of anything else as they are."""
    turn = TURNS.get(unit)
    if turn is None or len(values) < 2 or np.ptp(values) > WITHIN * turn:
        return values
    steps = np.diff(values) / turn
    jumps = np.abs(steps) > WRAPS
    if not jumps.any() or np.any(np.abs(steps[~jumps]) > STEADY):
        return values
    return np.unwrap(values, period=turn)
