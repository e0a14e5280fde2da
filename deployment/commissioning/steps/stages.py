"""Automatic operation with limited authority: a target to the left and back, at 10 %, then 25, 50 and 100 %.

The share is that of the gate's speed limits and of the rate at which commands may grow; commands reach as far
above the breakaway that was found.  Ways to neutral are never slowed.  Each stage begins only after the one
before passed, and with the operator's automatic switch.
"""

import math

import numpy as np

from deployment.commissioning.bench import Bench
from deployment.commissioning.rig import AXES, Rig, Trace
from deployment.commissioning.steps.safety import LEFT, RIGHT, hold, release
from fmus.equations import kinematics
from runtime.image import TICK_S

TURN_DEG = {0.1: 15.0, 0.25: 30.0, 0.5: 45.0, 1.0: 60.0}  # to the left and back
MODES = ("automatic", "hold", "armed")


def run(bench: Bench, share: float) -> None:
    """One stage."""
    rig = bench.rig
    radius, height = kinematics.arm_tip(rig.now("q_boom"), rig.now("q_stick"), kinematics.geometry())
    z = float(height) - kinematics.geometry().tool_length
    start = rig.now("q_slew")
    _check_target(bench, float(radius), z)
    hold(bench)
    rig.limit(*authority(bench, share))
    for number, turn in enumerate((math.radians(TURN_DEG[share]), 0.0), 1):
        _to(bench, share, start + turn, float(radius), z, number)
    bench.do("switch.automatic.0", "Turn the automatic switch off")
    bench.until(lambda: rig.mode == "armed", 2.0)
    bench.equal("mode, automatic switch off", rig.mode, "armed", f"fault: {rig.fault}")
    rig.ask_for({})
    bench.neutral()
    release(bench)
    bench.verdict()


def authority(bench: Bench, share: float) -> tuple[tuple[float, ...], float, float]:
    """Largest commands, share of speed, share of rise; commands by the breakaways that were found."""
    if share >= 1.0:
        return (1.0, 1.0, 1.0), 1.0, 1.0
    reach = []
    for axis in AXES:
        found = bench.before[axis]
        band = max(found[f"breakaway {LEFT[axis]}"], found[f"breakaway {RIGHT[axis]}"])
        reach.append(band + share * bench.f.commissioning_reach * (1.0 - band))
    bench.found["largest commands"] = dict(zip(AXES, reach, strict=True))
    return tuple(reach), share, share


def _check_target(bench: Bench, radius: float, z: float) -> None:
    reason = kinematics.reachable(radius, 0.0, z)
    bench.equal("pose within the controller's reach", reason or "yes", "yes", "drive the arm to a usual pose")
    bench.verdict()


def _to(bench: Bench, share: float, slew: float, radius: float, z: float, number: int) -> None:
    f, rig = bench.f, bench.rig
    target = {"target_x": radius * math.cos(slew), "target_y": radius * math.sin(slew), "target_z": z}
    rig.ask_for(
        {**target, "target_valid": 1.0, "target_number": float(number), "load_told": 0.0, "pace": 1.0}
    )
    bench.operator.watching()
    first, before = rig.tick, rig.now("q_slew")
    if number == 1:
        bench.do("switch.automatic.1", "Turn the automatic switch on")
        bench.until(lambda: rig.mode == "automatic", 1.0)
    rig.watch = _Watch(bench, share)
    bench.wait(f.commissioning_stage)
    rig.watch = None
    trace = rig.since(first)
    bench.equal(f"target {number}: mode", rig.mode, "automatic", f"fault: {rig.fault}")
    _judge(bench, share, trace, slew, before, number)
    way = "left" if slew > before else "right"
    seen = bench.seen(
        f"see.slew.{math.copysign(1, slew - before):+.0f}", f"The carriage went to the {way} and came to rest"
    )
    bench.equal(
        f"target {number}: seen by the operator", "yes" if seen else "no", "yes", "the whole chain of signs"
    )
    bench.verdict()


class _Watch:
    """Ends a stage at once: too fast for its share, or out of automatic operation."""

    def __init__(self, bench: Bench, share: float) -> None:
        self.bench, self.most = bench, _fastest(bench, share)

    def __call__(self, rig: Rig) -> None:
        """Look at a tick."""
        speed = abs(rig.now("imu_cabin_rate_z"))
        if not speed <= self.most:
            look = "authority, gyroscope of the cabin"
            self.bench.fail("slew speed", speed, f"at most {self.most:.3g}", look, "rad/s")
        if rig.mode not in MODES:
            self.bench.fail("mode", rig.mode, "automatic", f"fault: {rig.fault}")


def _fastest(bench: Bench, share: float) -> float:
    """rad/s: where the gate pushes no further, and what the drive still gains then."""
    return share * bench.f.gate_speed_slew + bench.f.commissioning_gains


def _judge(bench: Bench, share: float, trace: Trace, slew: float, before: float, number: int) -> None:
    f, q = bench.f, trace["q_slew"]
    sign = math.copysign(1.0, slew - before)
    over = max(0.0, float((sign * (q - slew)).max()))
    error = abs(float(np.mean(q[-50:])) - slew)
    fastest = float(np.abs(trace["imu_cabin_rate_z"]).max())
    bench.found |= {f"fastest {number}": fastest, f"overshoot {number}": over, f"error {number}": error}
    near = np.flatnonzero(np.abs(q - slew) > f.commissioning_arrived)
    bench.found[f"arrived {number}"] = float(len(near) and (near[-1] + 1) * TICK_S)
    look = "the bundle's controller; breakaways"
    bench.between(f"target {number}: overshoot", over, 0.0, f.commissioning_overshoot, "rad", look)
    bench.between(f"target {number}: error at the end", error, 0.0, f.commissioning_arrived, "rad", look)
    bench.between(f"target {number}: fastest", fastest, 0.0, _fastest(bench, share), "rad/s", look)
