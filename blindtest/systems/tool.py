"""The free-swinging tool on a suspension that slewing and luffing move; equations in native/tool.c.

Inputs are the recorded motion of the suspension, outputs roll, pitch and their rates; the plain model is
fmus/models/tool.
"""

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from blindtest.integrator import doubles, library
from blindtest.systems.axis import blocks
from blindtest.systems.system import STEP, Base, Drive, Signal, Trace, around
from specs.errors import RunError

AXES = ("roll", "pitch")
BASE = ("tool_length_x", "tool_length_y", "tool_damping_x", "tool_damping_y", "gravity")
COUPLING = (
    "coriolis",
    "centrifugal",
    "euler",
    "wind_x",
    "wind_y",
    "misalignment",
    "motion_lag",
    "motion_delay",
    "rate_offset",
    "hoist",
)


@dataclass(frozen=True)
class Tool:
    """The tool; disturbances [n, 2] are angular accelerations of roll and of pitch, rad/s2."""

    base: tuple[Base, ...]
    name: str = "tool"
    model: str = "fmus/models/tool"
    inputs: tuple[Signal, ...] = (
        Signal("q_slew", "rad", noise=1e-5),
        Signal("qd_slew", "rad/s", noise=5e-5),
        Signal("radius", "m", noise=1e-4),
        Signal("radius_rate", "m/s", noise=2e-4),
        Signal("height", "m", noise=1e-4),
    )
    outputs: tuple[Signal, ...] = (
        Signal("q_tool_x", "rad", noise=1e-3, quantum=1e-4),
        Signal("q_tool_y", "rad", noise=1e-3, quantum=1e-4),
        Signal("qd_tool_x", "rad/s", noise=2e-3, quantum=1e-4),
        Signal("qd_tool_y", "rad/s", noise=2e-3, quantum=1e-4),
    )
    starts: int = 4
    disturbances: int = 2

    def simulate(
        self,
        values: Mapping[str, float],
        drive: Drive,
        start: np.ndarray,
        disturbance: np.ndarray | None = None,
        noise: np.ndarray | None = None,
    ) -> Trace:
        """Run it on a moving suspension [n, 5] from roll, pitch and rates `start` [4]."""
        n = len(drive.commands)
        y = np.empty((n, 4))
        library().bt_tool(
            doubles(np.array([values[name] for name in BASE])),
            doubles(np.array([values.get(name, 0.0) for name in COUPLING])),
            doubles(blocks(values, AXES)),
            ctypes.c_int(n),
            ctypes.c_double(STEP),
            doubles(np.ascontiguousarray(drive.commands, dtype=float)),
            doubles(np.zeros((n, 2)) if disturbance is None else np.ascontiguousarray(disturbance)),
            doubles(np.zeros((n, 4)) if noise is None else np.ascontiguousarray(noise)),
            doubles(np.ascontiguousarray(start, dtype=float)),
            doubles(y),
        )
        if not np.isfinite(y).all() or np.abs(y[:, :2]).max() > 1.4:
            raise RunError("tool: it swings over the top")
        return Trace(drive.commands, y)


def draw(rng: np.random.Generator) -> Tool:
    """A tool beside the values of specs."""
    base = [around(name, rng, known=name == "gravity") for name in BASE]
    return Tool(tuple(base))
