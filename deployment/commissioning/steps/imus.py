"""Both IMUs turned by hand, about each of their axes: every rate, acceleration and angle against gravity.

The operator takes an IMU off its bracket and turns it.  Roll and pitch by gravity, by the IMU's own angle
and by its rate must agree in sign and size; the way it was turned is known, because the operator was told.
About the upright axis gravity says nothing: there the quarter turn that was asked for is the reference.
This is the only step that moves rates about x and y of a cabin that stands firm.
"""

import math

import numpy as np

from deployment.commissioning.bench import Bench
from deployment.commissioning.rig import Trace
from deployment.commissioning.steps import timing
from deployment.commissioning.wiring import IMUS
from runtime.image import TICK_S

TEXTS = {
    "x": "its left side up, by 45° or more",
    "y": "its front down, by 45° or more",
    "z": "to the left about its upright axis, by a quarter turn",
}
OTHER = {"cabin": "tool", "tool": "cabin"}


def run(bench: Bench) -> None:
    """Six turns, and back."""
    for imu in IMUS:
        before = bench.wait(1.0)
        for axis, text in TEXTS.items():
            begin = bench.rig.tick
            bench.do(
                f"turn.{imu}.{axis}.out",
                f"Take the {imu} IMU off its bracket, hold it as mounted, turn it {text}",
            )
            turning = bench.rig.since(begin)
            held = bench.wait(bench.f.commissioning_held)
            _turned(bench, imu, axis, before, turning, held)
            _in_time(bench, imu, axis, before, bench.rig.since(begin))
            bench.do(f"turn.{imu}.{axis}.back", "Turn it back as it was mounted")
        bench.verdict()
    bench.do("ready", "Both IMUs back on their brackets")
    bench.verdict()


def _turned(bench: Bench, imu: str, axis: str, before: Trace, turning: Trace, held: Trace) -> None:
    f, look = bench.f, f"the {imu} IMU: order and sign of its axes, units, which IMU it is"
    swept = {a: _swept(imu, a, before, turning) for a in "xyz"}
    angle = _by_gravity(imu, axis, before, held) if axis != "z" else math.pi / 2
    low, high = f.commissioning_turn_low, f.commissioning_turn_high
    bench.between(f"{imu} IMU about {axis}: turned", angle, low, high, "rad", look)
    share = f.commissioning_turn_share if axis != "z" else f.commissioning_quarter_share
    ratio = swept[axis] / angle if angle else float("nan")
    bench.between(f"{imu} IMU: rate_{axis} over the turn", ratio, 1.0 - share, 1.0 + share, "", look)
    for other in "xyz".replace(axis, ""):
        bench.between(f"{imu} IMU: rate_{other} meanwhile", swept[other], -0.35, 0.35, "rad", look)
    _angles(bench, imu, axis, angle, before, held, look)
    x, y, z = _mean(held, imu)
    bench.between(
        f"{imu} IMU: gravity while turned about {axis}", math.hypot(x, y, z), 9.3, 10.3, "m/s2", look
    )
    other = {a: _swept(OTHER[imu], a, before, turning) for a in "xyz"}
    most = max(abs(v) for v in other.values())
    bench.between(f"{OTHER[imu]} IMU meanwhile", most, 0.0, 0.35, "rad", "the two IMUs are swapped")


def _angles(bench: Bench, imu: str, axis: str, angle: float, before: Trace, held: Trace, look: str) -> None:
    for name, about in (("roll", "x"), ("pitch", "y")):
        signal, other = f"imu_{imu}_{name}", about != axis
        change = float(np.mean(held[signal]) - np.mean(before[signal]))
        expected = 0.0 if other else angle
        most = bench.f.commissioning_turn_angle if not other else 0.35
        bench.between(
            f"{imu} IMU: {name}, turned about {axis}", change, expected - most, expected + most, "rad", look
        )
        if other:
            sideways = _by_gravity(imu, about, before, held)
            bench.between(
                f"{imu} IMU: gravity's {name}, turned about {axis}", sideways, -0.35, 0.35, "rad", look
            )


def _in_time(bench: Bench, imu: str, axis: str, before: Trace, turn: Trace) -> None:
    """Angle and accelerations follow the rate at once; about the upright axis they say nothing."""
    if axis == "z":
        return
    rate, angle = f"rate_{axis}", {"x": "roll", "y": "pitch"}[axis]
    turned = timing.swept(turn[f"imu_{imu}_{rate}"], float(np.mean(before[f"imu_{imu}_{rate}"])))
    sideways = {"x": "y", "y": "x"}[axis]
    expected = {angle: turned, f"acc_{sideways}": np.sin(turned), "acc_z": np.cos(turned)}
    look = f"the {imu} IMU: its filters, delays on the bus"
    for name, reference in expected.items():
        title = f"{imu} IMU, turned about {axis}: {name} than {rate}"
        timing.agree(bench, title, turn[f"imu_{imu}_{name}"], reference, look)


def _swept(imu: str, axis: str, before: Trace, turning: Trace) -> float:
    """Integral of a rate less its zero, rad."""
    name = f"imu_{imu}_rate_{axis}"
    return float(np.sum(turning[name] - np.mean(before[name])) * TICK_S)


def _by_gravity(imu: str, axis: str, before: Trace, held: Trace) -> float:
    """Turn about x or y by the accelerations, rad."""
    angles = []
    for trace in (before, held):
        x, y, z = _mean(trace, imu)
        angles.append(math.atan2(y, z) if axis == "x" else math.atan2(-x, math.hypot(y, z)))
    return angles[1] - angles[0]


def _mean(trace: Trace, imu: str) -> tuple[float, float, float]:
    x, y, z = (float(np.mean(trace[f"imu_{imu}_acc_{a}"])) for a in "xyz")
    return x, y, z
