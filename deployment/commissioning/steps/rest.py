"""Sensors at rest: alive, plausible; zeros against gravity, balance, or what the operator measures.

boom and stick: the operator's inclinometer; slew: the mark for straight ahead; IMUs: gravity, inclination and
accelerations against each other; pressures: what the arm's weight needs; all others: rest.
"""

import math

import numpy as np

from deployment.commissioning import balance
from deployment.commissioning.bench import Bench
from deployment.commissioning.rig import AXES, Trace
from deployment.commissioning.wiring import IMUS, PRESSURES
from runtime.image import INPUT

ALIVE = (
    *(f"qd_{axis}" for axis in AXES), *PRESSURES, "p_pump",
    *(f"imu_{i}_{kind}_{a}" for i in IMUS for kind in ("rate", "acc") for a in "xyz"),
    *(f"imu_{i}_{a}" for i in IMUS for a in ("roll", "pitch")),
)  # fmt: skip


def run(bench: Bench) -> None:
    """Everything stands still; the arm is measured."""
    bench.do("ready", "Upper carriage straight ahead on its mark, grab empty and hanging still")
    trace = bench.wait(bench.f.commissioning_rest)
    _alive(bench, trace)
    _slow(bench, trace)
    _angles(bench, trace)
    for imu in IMUS:
        _imu(bench, trace, imu)
    _pressures(bench, trace)
    bench.equal(
        "brake_released", float(np.median(trace["brake_released"])), 0.0, "the brake's pressure switch"
    )
    bench.verdict()


def _alive(bench: Bench, trace: Trace) -> None:
    """Noise: none at all is a dead sensor, too much is a bad one."""
    most = {"rad": bench.f.commissioning_noise_angle, "rad/s": bench.f.commissioning_noise_rate}
    most |= {"m/s2": bench.f.commissioning_noise_acc, "Pa": bench.f.commissioning_noise_pressure}
    for name in ALIVE:
        unit, spread = INPUT.signals[INPUT.index[name]].unit, float(np.std(trace[name]))
        look = f"the sensor of {name}: frozen, not connected, or disturbed"
        bench.between(f"{name}: noise at rest", spread, 1e-9, most[unit], unit, look)


def _slow(bench: Bench, trace: Trace) -> None:
    """Rates and velocities: zero at rest; the mean is their zero."""
    for name in (*(f"qd_{a}" for a in AXES), *(f"imu_{i}_rate_{a}" for i in IMUS for a in "xyz")):
        bench.found[f"zero {name}"] = zero = float(np.mean(trace[name]))
        most = bench.f.commissioning_zero_rate
        bench.between(f"{name}: zero", zero, -most, most, "rad/s", f"the zero of {name}")


def _angles(bench: Bench, trace: Trace) -> None:
    most = bench.f.commissioning_zero_angle
    boom = math.radians(
        bench.number("measure.boom", "Boom above the horizontal by the inclinometer", "degrees")
    )
    stick = math.radians(
        bench.number("measure.stick", "Stick above the horizontal (negative: below)", "degrees")
    )
    for name, reference in (("q_slew", 0.0), ("q_boom", boom), ("q_stick", stick - boom)):
        bench.found[f"zero {name}"] = zero = float(np.mean(trace[name])) - reference
        look = f"encoder of {name}: channel, sense of rotation, scale, preset"
        bench.between(
            f"{name}: error against the reference of {reference:.3f} rad", zero, -most, most, "rad", look
        )


def _imu(bench: Bench, trace: Trace, imu: str) -> None:
    f, mean = bench.f, {n: float(np.mean(trace[f"imu_{imu}_{n}"])) for n in ("roll", "pitch")}
    x, y, z = (float(np.mean(trace[f"imu_{imu}_acc_{a}"])) for a in "xyz")
    look = f"the {imu} IMU: axes, mounting, units"
    size = math.hypot(x, y, z)
    bench.between(f"{imu} IMU: gravity", size, f.gravity - 0.4, f.gravity + 0.4, "m/s2", look)
    bench.between(f"{imu} IMU: gravity along its up axis", z, f.gravity - 0.4, f.gravity + 0.4, "m/s2", look)
    by_gravity = {"roll": math.atan2(y, z), "pitch": math.atan2(-x, math.hypot(y, z))}
    for name, angle in mean.items():
        # The tool hangs plumb; the cabin stands as the ground does, so its inclination is no zero.
        bench.found[f"{'zero' if imu == 'tool' else 'level'} imu_{imu}_{name}"] = angle
        apart, most = angle - by_gravity[name], f.commissioning_inclination
        bench.between(f"{imu} IMU: {name}", angle, -f.commissioning_level, f.commissioning_level, "rad", look)
        bench.between(f"{imu} IMU: {name} less that of gravity", apart, -most, most, "rad", look)


def _pressures(bench: Bench, trace: Trace) -> None:
    f, bar = bench.f, {n: float(np.mean(trace[n])) / 1e5 for n in (*PRESSURES, "p_pump")}
    low = -f.commissioning_zero_pressure / 1e5
    for name, value in bar.items():
        bench.between(f"{name}: at rest", value, low, 400.0, "bar", f"the sensor of {name}: range, wiring")
    apart = f.commissioning_slew_apart / 1e5
    look = "slew pressure sensors: wiring, zero; is the machine on level ground?"
    bench.between("p_slew_a less p_slew_b", bar["p_slew_a"] - bar["p_slew_b"], -apart, apart, "bar", look)
    boost = f.slew_boost_pressure / 1e5
    for name in ("p_slew_a", "p_slew_b"):
        bench.between(f"{name}: boost pressure", bar[name], 0.6 * boost, 1.6 * boost, "bar", look)
    standby = f.pump_standby / 1e5
    bench.between("p_pump: standby", bar["p_pump"], 0.6 * standby, 1.6 * standby, "bar", "the pump's sensor")
    for joint, load in balance.at_rest(trace).items():
        bench.found[f"unexplained at the {joint}"] = load
        most = f.commissioning_balance
        look = f"p_{joint}_a, p_{joint}_b: swapped, scale, zero; q_boom, q_stick; is the grab empty?"
        bench.between(f"weight that the {joint} carries beyond the empty grab", load, -most, most, "kg", look)
