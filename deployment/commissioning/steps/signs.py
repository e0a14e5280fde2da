"""Sign of a valve and of every sensor that its motion shows: slew, boom and stick, one after the other,
slowly.

The joystick is raised until the axis moves (its breakaway), held a little above, let go; then the other way.
What agrees with itself is told by redundancy: encoder angle, encoder velocity and gyroscope; driven
chamber, other chamber and pump; brake; tool.  Whether valve and sensors are reversed together is told by
the operator alone.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from baselines.arm_velocity.lut import GRID
from baselines.arm_velocity.session import present_tables
from deployment.commissioning import drive
from deployment.commissioning.bench import Bench, hanging_height
from deployment.commissioning.rig import AXES, Trace
from deployment.commissioning.steps import timing
from deployment.commissioning.steps.safety import LEFT, RIGHT, hold, release
from runtime.image import TICK_S

SIDES = {1.0: ("a", "b"), -1.0: ("b", "a")}  # driven chamber, other chamber
TOOL = {"slew": ("roll", "x"), "boom": ("pitch", "y"), "stick": ("pitch", "y")}
LATE = 10  # ticks by which the encoder's velocity is late


@dataclass
class Pulse:
    """One way: what passed, in rows of `trace`: from `begun` on it moved, at `ended` the joystick was let
    go."""

    sign: float
    trace: Trace
    begun: int
    ended: int
    breakaway: float
    level: float

    @property
    def steady(self) -> Trace:
        """The last second at the level; the last tick, if it never moved."""
        return self.trace.part(min(max(self.begun, self.ended - 50), self.ended - 1), self.ended)


def run(bench: Bench, axis: str) -> None:
    """Both ways, then all checks over both."""
    f = bench.f
    bench.found["height"] = hanging_height(bench.rig.now("q_boom"), bench.rig.now("q_stick"))
    bench.between(
        "height of the grab", bench.found["height"], f.commissioning_lowest + 0.5, 25.0, "m", "raise the arm"
    )
    first = _roomy(bench, axis)
    bench.verdict()
    hold(bench)
    drive.alone(bench, axis, f.commissioning_most)
    pulses = sorted((_pulse(bench, axis, sign) for sign in (first, -first)), key=lambda p: -p.sign)
    bench.neutral()
    for pulse in pulses:
        _moves(bench, axis, pulse)
    bench.verdict()
    for pulse in pulses:
        _agrees(bench, axis, pulse)
        (_slew_pressures if axis == "slew" else _arm_pressures)(bench, axis, pulse)
        _in_time(bench, axis, pulse)
    if axis == "slew":
        _mirrored(bench, pulses)
        _cabin(bench, pulses)
    _tool(bench, axis, pulses)
    bench.verdict()
    release(bench)


def _roomy(bench: Bench, axis: str) -> float:
    """The way with more room to the joint's limits, 1 or -1; it comes first, the other leads back."""
    if axis == "slew":
        return 1.0
    f, q = bench.f, bench.rig.now(f"q_{axis}")
    above, below = getattr(f, f"{axis}_max") - q, q - getattr(f, f"{axis}_min")
    least = f.commissioning_room
    bench.between(
        f"room of the {axis} to its limit", max(above, below), least, 4.0, "rad", "another pose of the arm"
    )
    return 1.0 if above > below else -1.0


def _pulse(bench: Bench, axis: str, sign: float) -> Pulse:
    f, rig = bench.f, bench.rig
    guard = rig.watch = drive.Guard(bench, axis, f.commissioning_furthest)
    bench.operator.watching()
    first, start = rig.tick, guard.start[axis]
    still = bench.before.get("rest", {}).get("zero imu_cabin_rate_z", 0.0)

    def moves() -> bool:
        turning = axis == "slew" and abs(rig.now("imu_cabin_rate_z") - still) > f.commissioning_turning
        return turning or abs(rig.now(f"q_{axis}") - start) > f.commissioning_moved

    breakaway = drive.until_it_moves(bench, axis, sign, moves, f.commissioning_most)
    begun = rig.tick - first
    level = min(breakaway + f.commissioning_above, f.commissioning_most)
    if breakaway == breakaway:
        rig.wanted = drive.command(axis, sign * level)
        bench.wait(f.commissioning_pulse)
    ended = rig.tick - first
    drive.stop(bench, f.commissioning_coast if axis == "slew" else f.commissioning_settle)
    rig.watch = None
    way = LEFT[axis] if sign > 0 else RIGHT[axis]
    what = f"The {'upper carriage' if axis == 'slew' else axis} moved {way}, and nothing else moved"
    seen = bench.seen(f"see.{axis}.{sign:+.0f}", f"{what}, seen from the cabin")
    name = f"{axis} driven {way}: seen by the operator"
    bench.equal(name, "yes" if seen else "no", "yes", f"valve of the {axis}: swapped, reversed, dead")
    return Pulse(sign, rig.since(first), begun, ended, breakaway, level)


def _moves(bench: Bench, axis: str, pulse: Pulse) -> None:
    """It moved, the right way, from the command on at which it should, as fast as it should."""
    f, way = bench.f, LEFT[axis] if pulse.sign > 0 else RIGHT[axis]
    look = f"valve of the {axis}: not connected, wrong scale; encoder of the {axis} dead"
    low, high = f.commissioning_breakaway_low, f.commissioning_breakaway_high
    bench.between(f"{axis} {way}: joystick at which it moves", pulse.breakaway, low, high, "", look)
    q = pulse.trace[f"q_{axis}"]
    moved = float(q[-1] - q[0]) * pulse.sign
    look = f"sign of the valve or of the encoder of the {axis}"
    bench.between(
        f"{axis} {way}: moved the way it was driven", moved, f.commissioning_moved, 2.0, "rad", look
    )
    bench.found[f"breakaway {way}"], bench.found[f"moved {way}"] = pulse.breakaway, moved
    for other in AXES:
        if other != axis:
            most = float(np.abs(pulse.trace[f"q_{other}"] - pulse.trace[f"q_{other}"][0]).max())
            bench.between(
                f"{other} meanwhile", most, 0.0, f.commissioning_still_angle, "rad", "swapped valves"
            )
            mean = float(np.mean(pulse.steady[f"qd_{other}"]))
            limit = f.commissioning_still_rate
            bench.between(f"qd_{other} meanwhile", mean, -limit, limit, "rad/s", "swapped encoders")


def _agrees(bench: Bench, axis: str, pulse: Pulse) -> None:
    """Encoder angle, encoder velocity, gyroscope: the same motion, three times."""
    f, way = bench.f, LEFT[axis] if pulse.sign > 0 else RIGHT[axis]
    trace, rest = pulse.trace, bench.before.get("rest", {})
    q, share = trace[f"q_{axis}"], f.commissioning_agreement
    moved = float(q[-1] - q[0])
    names = [(f"qd_{axis}", f"velocity of the {axis}: sign, scale, which encoder")]
    if axis == "slew":
        names.append(("imu_cabin_rate_z", "gyroscope of the cabin, or the encoder of the slew: scale, sign"))
    for name, look in names:
        swept = float(np.sum(trace[name] - rest.get(f"zero {name}", 0.0)) * TICK_S)
        ratio = swept / moved if moved else float("nan")
        title = f"{axis} {way}: integral of {name} over q_{axis}"
        bench.between(title, ratio, 1.0 - share, 1.0 + share, "", look)
    if axis == "slew":
        moving = np.abs(trace["imu_cabin_rate_z"]) > f.commissioning_turning
        released = float(np.mean(trace["brake_released"][moving])) if moving.any() else float("nan")
        bench.between(
            f"brake_released while the slew turns {way}", released, 0.9, 1.0, "", "the brake's switch"
        )
    else:
        expected = float(np.interp(pulse.sign * pulse.level, present_tables()[axis], GRID)) * pulse.sign
        ratio = drive.speed(pulse.steady[f"q_{axis}"]) * pulse.sign / expected
        bench.found[f"speed {way}"] = ratio * expected
        look = f"valve of the {axis}: scale; scale of its encoder; oil cold"
        title = f"{axis} {way}: speed over that of the table in specs"
        bench.between(title, ratio, f.commissioning_speed_low, f.commissioning_speed_high, "", look)


def _arm_pressures(bench: Bench, axis: str, pulse: Pulse) -> None:
    """The pump holds its margin above the chamber that is driven, and that one only."""
    f, way, (driven, _) = bench.f, LEFT[axis] if pulse.sign > 0 else RIGHT[axis], SIDES[pulse.sign]
    steady = pulse.steady
    margin = float(np.mean(steady["p_pump"] - steady[f"p_{axis}_{driven}"])) / 1e5
    usual, share = f.pump_margin / 1e5, f.commissioning_margin
    look = f"p_{axis}_{driven} or p_pump: swapped, scale, zero"
    title = f"{axis} {way}: p_pump less p_{axis}_{driven}"
    bench.between(title, margin, usual * (1.0 - share), usual * (1.0 + share), "bar", look)
    follows = _together(steady["p_pump"], steady[f"p_{axis}_{driven}"])
    bench.found[f"margin {way}"], bench.found[f"follows {way}"] = margin, follows


def _slew_pressures(bench: Bench, axis: str, pulse: Pulse) -> None:
    f, way, (driven, other) = bench.f, LEFT[axis] if pulse.sign > 0 else RIGHT[axis], SIDES[pulse.sign]
    part = pulse.trace.part(pulse.begun, pulse.ended)
    high, low = float(part[f"p_slew_{driven}"].max()) / 1e5, float(part[f"p_slew_{other}"].max()) / 1e5
    pump = float(part["p_pump"].max()) / 1e5
    look = f"p_slew_{driven} and p_slew_{other}: swapped, scale"
    least = f.commissioning_slew_drive / 1e5
    bench.between(f"slew {way}: p_slew_{driven} drives", high, least, pump + 15.0, "bar", look)
    bench.between(f"slew {way}: p_slew_{other} does not", low, -5.0, 60.0, "bar", look)
    bench.found[f"drives {way}"] = high


def _in_time(bench: Bench, axis: str, pulse: Pulse) -> None:
    """Sensors show the motion at the same time, and the valve ends it in time."""
    way, zeros = LEFT[axis] if pulse.sign > 0 else RIGHT[axis], bench.before.get("rest", {})
    names = {f"qd_{axis}": LATE * TICK_S}
    names |= {"imu_cabin_rate_z": 0.0, "imu_tool_rate_z": 0.0} if axis == "slew" else {}
    for name, usual in names.items():
        angle = timing.swept(pulse.trace[name], zeros.get(f"zero {name}", 0.0))
        look = f"q_{axis}, {name}: filters, delays on the bus"
        timing.agree(bench, f"{axis} {way}: {name}", angle, pulse.trace[f"q_{axis}"], look, usual)
    if axis == "slew":
        shown = pulse.trace[f"p_slew_{SIDES[pulse.sign][0]}"]
    else:
        shown = np.abs(_rate(pulse.trace[f"q_{axis}"]))
    before, after = shown[pulse.ended - 25 : pulse.ended], shown[pulse.ended :]
    ended = np.flatnonzero(after < 0.5 * np.mean(before))
    lasts = float(ended[0]) * TICK_S if len(ended) else float("nan")
    look = f"valve and sensors of the {axis}: delays; oil cold"
    title = f"{axis} {way}: {'pressure' if axis == 'slew' else 'speed'} halved after the joystick was let go"
    bench.between(title, lasts, 0.0, bench.f.commissioning_lets_go, "s", look)


def _mirrored(bench: Bench, pulses: list[Pulse]) -> None:
    """The drive is symmetrical: both ways need the same pressure for the same joystick."""
    f = bench.f
    for kind in ("driven", "other"):
        values = []
        for pulse in pulses:
            side = SIDES[pulse.sign][0 if kind == "driven" else 1]
            part = pulse.trace.part(pulse.begun, pulse.ended)
            values.append(float(np.percentile(part[f"p_slew_{side}"], 80)) / max(pulse.level, 0.01))
        share = f.commissioning_mirrored
        look = "p_slew_a, p_slew_b: scale; slope of the ground"
        bench.between(
            f"slew: {kind} pressure, left over right", values[0] / values[1], 1 / share, share, "", look
        )


def _cabin(bench: Bench, pulses: list[Pulse]) -> None:
    """Accelerations of the cabin's IMU in its circle about the slew axis: how it is mounted.

    What the machine's own rocking adds is not known to this; so the limits are wide.
    """
    f, measured, expected = bench.f, [], []
    for pulse in pulses:
        rate = savgol_filter(pulse.trace["imu_cabin_rate_z"], 25, 2)
        turning = savgol_filter(rate, 25, 2, deriv=1, delta=TICK_S)
        x, y = f.imu_cabin_x, f.imu_cabin_y
        for name, wanted in (("x", -turning * y - rate**2 * x), ("y", turning * x - rate**2 * y)):
            acc = pulse.trace[f"imu_cabin_acc_{name}"]
            measured.append(acc - np.mean(acc))
            expected.append(wanted - np.mean(wanted))
    m, e = np.concatenate(measured), np.concatenate(expected)
    slope = float(m @ e / (e @ e))
    bench.found["cabin IMU in its circle"] = slope
    share = f.commissioning_circle
    look = "the cabin IMU: turned on its bracket, axes"
    bench.between(
        "cabin IMU: acceleration in its circle over what it should be", slope, 1 - share, 1 + share, "", look
    )


def _tool(bench: Bench, axis: str, pulses: list[Pulse]) -> None:
    """The tool's angle changes as its rate says; a slew to the left leaves it behind on the right."""
    (angle, about), f = TOOL[axis], bench.f
    zero = bench.before.get("rest", {}).get(f"zero imu_tool_rate_{about}", 0.0)
    rate = np.concatenate([p.trace[f"imu_tool_rate_{about}"] - zero for p in pulses])
    change = np.concatenate([_rate(p.trace[f"imu_tool_{angle}"]) for p in pulses])
    slope, share = float(rate @ change / (change @ change)), f.commissioning_agreement
    look = "the tool IMU: axes, mounting, which IMU it is"
    bench.between(
        f"tool IMU: rate_{about} over the change of its {angle}", slope, 1 - share, 1 + share, "", look
    )
    if axis == "slew":
        for pulse in pulses:
            part = pulse.trace.part(pulse.begun, pulse.ended)["imu_tool_roll"]
            behind = float(np.mean(part) - pulse.trace["imu_tool_roll"][0]) * -pulse.sign
            way = LEFT["slew"] if pulse.sign > 0 else RIGHT["slew"]
            least = f.commissioning_behind
            bench.between(f"tool behind a slew to the {way}", behind, least, 0.6, "rad", look)


def _together(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.corrcoef(a, b)[0, 1])


def _rate(angle: np.ndarray) -> np.ndarray:
    """Smoothed derivative of an angle [n], rad/s."""
    return np.asarray(savgol_filter(angle, 15, 2, 1, TICK_S))
