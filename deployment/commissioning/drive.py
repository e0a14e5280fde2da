"""Motions of the procedure: slow, of one axis, watched every tick, and ended by the first thing that is odd.

Commands go by the operator's joystick in the input image, so the core's state machine and gate, its authority
limited for the step, stand between all of this and the valves.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from deployment.commissioning.bench import Bench, hanging_height
from deployment.commissioning.rig import AXES, STILL, Rig
from runtime.image import TICK_S

ARMING = (
    0.11  # joystick for one tick, so that the core takes it for manual operation; far below any dead band
)
NEAR = 0.03  # rad, to an angle that a joint is moved to
LEAD = 0.35  # s, encoder's delay and the valve's
SLOWEST = 0.02  # rad/s with which a move counts as one that gets there
MAY_MOVE = ("armed", "manual", "stopping")


@dataclass
class Guard:
    """Ends a motion of `axis` at once: another axis moves, it goes too far, or the core is not in manual."""

    bench: Bench
    axis: str
    furthest: float  # rad, that the axis may move from where it stood
    modes: tuple[str, ...] = MAY_MOVE
    others: float | None = None  # rad, that other axes may; None: commissioning_still_angle

    def __post_init__(self) -> None:
        self.start = {a: self.bench.rig.now(f"q_{a}") for a in AXES}

    def __call__(self, rig: Rig) -> None:
        """Look at the tick that has just passed."""
        bench, f = self.bench, self.bench.f
        if rig.taken_over:
            bench.fail("joystick", "moved by the operator", "at rest", "start the step again when ready")
        if rig.mode not in self.modes:
            look = f"fault: {rig.fault}; was the enabling switch held?"
            bench.fail("mode while the machine moves", rig.mode, "manual", look)
        for axis in AXES:
            moved = abs(rig.now(f"q_{axis}") - self.start[axis])
            others = f.commissioning_still_angle if self.others is None else self.others
            most = self.furthest if axis == self.axis else others
            if not moved <= most:
                look = f"valves and encoders of {self.axis} and {axis}: swapped?"
                bench.fail(
                    f"q_{axis} moved while the {self.axis} is driven",
                    moved,
                    f"at most {most:.3g}",
                    look,
                    "rad",
                )
        if hanging_height(rig.now("q_boom"), rig.now("q_stick")) < f.commissioning_lowest:
            bench.fail(
                "height of the grab", "too low", f"at least {f.commissioning_lowest:g} m", "raise the arm"
            )


def command(axis: str, value: float) -> tuple[float, float, float]:
    """A joystick of one axis."""
    return tuple(value if a == axis else 0.0 for a in AXES)  # type: ignore[return-value]


def alone(bench: Bench, axis: str, most: float) -> None:
    """Limit the core's authority to commands of one axis, up to `most`, rising slowly."""
    bench.rig.limit(command(axis, most), 1.0, bench.f.commissioning_rise)


def begin(bench: Bench, axis: str, sign: float) -> None:
    """The core in manual operation, its command still neutral for the valves."""
    bench.rig.wanted = command(axis, sign * ARMING)
    bench.rig.step()
    bench.rig.wanted = STILL


def until_it_moves(bench: Bench, axis: str, sign: float, moves: Callable[[], bool], most: float) -> float:
    """Raise the joystick slowly until the axis moves; the joystick [0, 1] then, NaN if it never did."""
    f, rig = bench.f, bench.rig
    begin(bench, axis, sign)
    steps = round((most - f.commissioning_ramp_from) / (f.commissioning_ramp * TICK_S))
    for k in range(steps + 1):
        value = f.commissioning_ramp_from + k * f.commissioning_ramp * TICK_S
        rig.wanted = command(axis, sign * value)
        rig.step()
        if moves():
            return value
    return float("nan")


def stop(bench: Bench, seconds: float) -> None:
    """Neutral, and time to come to rest."""
    bench.rig.wanted = STILL
    bench.wait(seconds)


def speed(q: np.ndarray) -> float:
    """Mean speed of an angle [n], rad/s: the slope of a line through it."""
    return float(np.polyfit(np.arange(len(q)) * TICK_S, q, 1)[0])


def go(bench: Bench, joint: str, target: float) -> None:
    """Move one joint to an angle, at the speed that its sign was found with; Failed if it does not get
    there."""
    f, rig = bench.f, bench.rig
    way = target - rig.now(f"q_{joint}")
    if abs(way) < NEAR:
        return
    low = min(
        hanging_height(*_pose(rig.now("q_boom"), rig.now("q_stick"), joint, q))
        for q in np.linspace(rig.now(f"q_{joint}"), target, 9)
    )
    bench.between(
        f"height on the way of the {joint}", low, f.commissioning_lowest, 30.0, "m", "raise the arm first"
    )
    bench.verdict()
    sign = float(np.sign(way))
    alone(bench, joint, f.commissioning_most)
    rig.watch = Guard(bench, joint, abs(way) + 0.1)
    begin(bench, joint, sign)
    rig.wanted = command(joint, sign * f.commissioning_most)
    there = bench.until(
        lambda: sign * (target - rig.now(f"q_{joint}") - LEAD * rig.now(f"qd_{joint}")) < 0.0,
        2.0 + abs(way) / SLOWEST,
    )
    stop(bench, f.commissioning_settle)
    rig.watch = None
    left = abs(target - rig.now(f"q_{joint}")) if there else float("nan")
    bench.between(
        f"{joint} to {target:.2f} rad: left", left, 0.0, 2 * NEAR, "rad", "the joint's valve; the gate"
    )
    bench.verdict()


def _pose(boom: float, stick: float, joint: str, q: float) -> tuple[float, float]:
    return (q, stick) if joint == "boom" else (boom, q)
