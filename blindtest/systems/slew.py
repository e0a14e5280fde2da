"""The slew drive with its two chambers, supply, relief and brake; equations in native/slew.c.

The plain model is fmus/models/slew with recorded joystick, inertia and rate of the inertia.  Wrong are those
parameters that its own fit calls identified and that act most (`FREE`); all others are told right.
"""

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from blindtest.integrator import doubles, library
from blindtest.systems.axis import absent, block, longest
from blindtest.systems.system import STEP, Base, Drive, Signal, Trace, around
from specs import parameters
from specs.errors import RunError

FREE = (
    "slew_dead_band",
    "slew_spool_lag",
    "slew_inlet_flow",
    "slew_friction_viscous",
    "slew_friction_dry",
    "slew_leak_internal",
    "slew_cut_off_high",
    "slew_stop_flow",
)
BASE = tuple(parameters.load("slew"))
EXTRA = (
    "sag",
    "shared",
    "warming",
    "counterbalance",
    "air",
    "brake_lag",
    "one_relief",
    "payload",
    "bias_a",
    "bias_b",
)
LONGEST = 0.001  # s, of a step: an open outlet's time constant is 0.5 ms
LAGS = ("in_lag", "out_lag_q", "out_lag_v")


@dataclass(frozen=True)
class Slew:
    """The slew drive; a disturbance is a torque on the carriage, N.m."""

    base: tuple[Base, ...]
    name: str = "slew"
    model: str = "fmus/models/slew"
    inputs: tuple[Signal, ...] = (
        Signal("u_slew", "1", noise=2e-4),
        Signal("inertia", "kg.m2", noise=50.0),
        Signal("inertia_rate", "kg.m2/s", noise=20.0),
    )
    outputs: tuple[Signal, ...] = (
        Signal("q_slew", "rad", noise=2e-4, quantum=1e-5),
        Signal("qd_slew", "rad/s", noise=1e-3, quantum=5e-5),
        Signal("p_slew_a", "Pa", noise=5e4, quantum=1e4),
        Signal("p_slew_b", "Pa", noise=5e4, quantum=1e4),
    )
    starts: int = 2
    disturbances: int = 1

    def simulate(
        self,
        values: Mapping[str, float],
        drive: Drive,
        start: np.ndarray,
        disturbance: np.ndarray | None = None,
        noise: np.ndarray | None = None,
    ) -> Trace:
        """Run it from angle and speed `start` at boost pressure; closed loop is a P speed loop."""
        n = len(drive.commands)
        effects = {k: v for k, v in values.items() if k in absent()}
        u = np.ascontiguousarray(drive.commands, dtype=float).copy()
        y = np.empty((n, 4))
        reference = None if drive.reference is None else np.ascontiguousarray(drive.reference)
        events = library().bt_slew(
            doubles(np.array([values[name] for name in BASE])),
            doubles(np.array([values.get(name, 0.0) for name in EXTRA])),
            doubles(block(effects)),
            ctypes.c_int(n),
            ctypes.c_double(STEP),
            ctypes.c_double(longest(LONGEST, effects, LAGS)),
            doubles(u),
            doubles(reference),
            doubles(np.array([drive.gains[0], drive.gains[3]]) if drive.closed else None),
            doubles(np.zeros(n) if disturbance is None else np.ascontiguousarray(disturbance)),
            doubles(np.zeros((n, 4)) if noise is None else np.ascontiguousarray(noise)),
            doubles(np.ascontiguousarray(start, dtype=float)),
            doubles(y),
        )
        if events < 0 or not np.isfinite(y).all():
            raise RunError("slew: the run does not stay finite")
        return Trace(u, y, events)


def draw(rng: np.random.Generator) -> Slew:
    """A slew drive beside the values of specs."""
    return Slew(tuple(around(name, rng, known=name not in FREE) for name in BASE))
