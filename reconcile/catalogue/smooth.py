"""Kinked functions rounded over a stated width, so that they can be differentiated."""

from typing import Any

import casadi as ca

Scalar = Any


def sign(x: Scalar, width: Scalar) -> Scalar:
    """-1 .. 1; within 4 % of the sign beyond two widths."""
    return ca.tanh(x / width)


def positive(x: Scalar, width: Scalar) -> Scalar:
    """max(x, 0), larger by half a width at the kink."""
    return 0.5 * (x + ca.sqrt(x * x + width * width))


def magnitude(x: Scalar, width: Scalar) -> Scalar:
    """|x|, equal to it at zero."""
    return ca.sqrt(x * x + width * width) - width


def clip(x: Scalar, low: Scalar, high: Scalar, width: Scalar) -> Scalar:
    """x held between low and high; wrong by a quarter of width²/distance away from the kinks."""
    return low + positive(x - low, width) - positive(x - high, width)


def dead_zone(x: Scalar, low: Scalar, high: Scalar, width: Scalar) -> Scalar:
    """What of x lies above high or below low, both kinks at the same distance; zero at their middle."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    z = x - middle
    return positive(z - half, width) - positive(-z - half, width)
