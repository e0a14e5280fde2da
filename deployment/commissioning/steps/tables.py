"""Dead bands and velocity tables of boom and stick: a sweep through the core, and `slewright calibrate
lut`'s fit.

The arm's speed is limited to half of the gate's.  The tables are written to the session's folder; nothing
uses them until a bundle is built with them.
"""

from typing import Any

from baselines.arm_velocity import lut, table_file
from baselines.arm_velocity.model import JOINTS
from baselines.arm_velocity.sweep import TICKS, Condition, Driver, shuffled, turning_points
from deployment.commissioning import drive
from deployment.commissioning.bench import Bench
from deployment.commissioning.rig import Trace
from deployment.commissioning.steps.safety import hold, release
from records.measurement import Channel, Measurement
from runtime.image import INPUT, OUTPUT

FILE = "arm-tables.toml"
LEVELS = (*(0.01 * k for k in range(10, 21, 2)), *(0.01 * k for k in range(24, 93, 4)))  # joystick
OFF_LIMITS = (
    0.16  # rad that the sweep turns back before a limit: out of the gate's zone at half the arm's speed
)
SPEED = 0.5  # share of the gate's speed limit
SEED = 1  # of the levels' order and the bootstrap
OTHER = {"boom": ("stick", -1.25), "stick": ("boom", 1.05)}  # rad, as in the sweep's own first condition


def run(bench: Bench) -> None:
    """Sweep boom, then stick; tables and dead bands of both."""
    tables = {}
    for joint in JOINTS:
        trace = _sweep(bench, joint)
        tables |= lut.calibrate([_recording(trace, joint)], [joint], SEED)
        _judge(bench, tables[joint])
    bench.files[FILE] = table_file.render(tables, "slewright commission, one pose, empty grab")
    bench.verdict()


def _sweep(bench: Bench, joint: str) -> Trace:
    f, rig = bench.f, bench.rig
    hold(bench)
    drive.go(bench, *OTHER[joint])
    other = rig.now(f"q_{OTHER[joint][0]}")
    low, high = turning_points(joint, other)
    low = max(low, getattr(f, f"{joint}_min") + OFF_LIMITS)
    high = min(high, getattr(f, f"{joint}_max") - OFF_LIMITS)
    bench.between(
        f"room of the {joint} for a sweep", high - low, 0.35, 3.0, "rad", "another pose of the other joint"
    )
    bench.verdict()
    rig.limit(drive.command(joint, 1.0), SPEED)
    rig.watch = drive.Guard(bench, joint, 3.0, others=f.commissioning_still_sweep)
    first = rig.tick
    driver = Driver(
        joint, Condition("commissioning", {joint: other}), (low, high), shuffled(LEVELS, "sweep", joint)
    )
    drive.begin(bench, joint, 1.0)
    while (commands := driver({n: rig.now(n) for n in (f"q_{joint}", f"qd_{joint}")})) is not None:
        rig.wanted = drive.command(joint, commands[f"u_{joint}"])
        rig.step(TICKS)
    drive.stop(bench, f.commissioning_settle)
    bench.neutral()
    release(bench)
    return rig.since(first)


def _recording(trace: Trace, joint: str) -> Measurement:
    names = (f"q_{joint}", f"p_{joint}_a", f"p_{joint}_b", f"u_{joint}")
    channels = {n: Channel(n, _unit(n), trace.time, trace[n].copy()) for n in names}
    return Measurement(channels, None, {}, f"sweep of the {joint}")


def _unit(name: str) -> str:
    layout = INPUT if name in INPUT.index else OUTPUT
    return layout.signals[layout.index[name]].unit


def _judge(bench: Bench, table: Any) -> None:
    f, joint = bench.f, table.joint
    for way, band in table.dead_band.items():
        bench.found[f"dead band of the {joint}, {way}"] = band.value
        low, high = f.commissioning_dead_low, f.commissioning_dead_high
        bench.between(f"dead band of the {joint}, {way}", band.value, low, high, "", "valve, pilot pressure")
    lacking = [f"{p.velocity:+.3f}" for p in table.lacking]
    bench.found[f"{joint}: points that lack data"] = lacking
    most = f.commissioning_lacking
    look = f"room of the {joint}; oil cold: {', '.join(lacking)} rad/s lack data"
    bench.between(f"{joint}: points of 25 that lack data", len(lacking), 0, most, "", look)
