"""Two ways to stop a slow slew: the enabling switch let go, and a controller that falls silent.

The second tests the machine's own watchdog (docs/explanation/hazards.md): commands stop for a moment, as if
the controller had died, and the machine must centre its valves and say so.
"""

import numpy as np

from deployment.commissioning import drive
from deployment.commissioning.bench import Bench
from deployment.commissioning.rig import Trace
from deployment.commissioning.steps.safety import hold, release
from runtime.image import TICK_S
from specs.signals import signal

TIMEOUT = next(n for n, text in signal("machine_fault").values.items() if text == "command_timeout")
NEVER = 1 << 20
ANY = (*drive.MAY_MOVE, "standby", "fault")


def run(bench: Bench) -> None:
    """Both, one after the other."""
    f = bench.f
    trace = _turning(bench)
    bench.do("switch.enable.0", "While it turns: let go of the enabling switch")
    bench.wait(f.commissioning_coast)
    trace = bench.rig.since(trace.first)
    let_go = _first(trace["operator_enable"] < 0.5)
    neutral = _first(trace["u_slew"][let_go:] == 0.0) * TICK_S
    look = "the control core's gate (specs/parameters/gate.toml)"
    bench.between("enabling switch let go: command neutral after", neutral, 0.0, 0.1, "s", look)
    _rests(bench, "enabling switch let go", trace, let_go)
    bench.neutral()
    bench.verdict()
    trace = _turning(bench)
    bench.rig.bus.muted = True
    try:
        silent = len(bench.wait(f.commissioning_silence)) + len(trace)
    finally:
        bench.rig.bus.muted = False
    bench.wait(f.commissioning_coast)
    trace = bench.rig.since(trace.first)
    begun = silent - round(f.commissioning_silence / TICK_S)
    said = _first(trace["machine_fault"][begun:] == TIMEOUT) * TICK_S
    look = "the watchdog on the machine's side: it must centre the valves when SlewCommand stops"
    most = f.commissioning_silence
    bench.between("controller silent: machine reports command_timeout after", said, 0.0, most, "s", look)
    _rests(bench, "controller silent", trace, begun)
    bench.equal("machine_fault, controller heard again", bench.rig.now("machine_fault"), 0.0, look)
    bench.neutral()
    bench.verdict()
    hold(bench)  # acknowledges the fault
    release(bench)


def _turning(bench: Bench) -> Trace:
    """Have the slew turn slowly; what passed."""
    f, rig = bench.f, bench.rig
    hold(bench)
    first = rig.tick
    drive.alone(bench, "slew", f.commissioning_most)
    band = bench.before["slew"]["breakaway left"]
    rig.watch = drive.Guard(bench, "slew", f.commissioning_furthest, ANY)
    drive.begin(bench, "slew", 1.0)
    rig.wanted = drive.command("slew", min(band + f.commissioning_above, f.commissioning_most))
    bench.wait(f.commissioning_pulse)
    turning = rig.now("imu_cabin_rate_z")
    bench.between(
        "slew turns", turning, f.commissioning_turning, 0.6, "rad/s", "was the enabling switch held?"
    )
    bench.verdict()
    return rig.since(first)


def _rests(bench: Bench, what: str, trace: Trace, at: int) -> None:
    """How far it went on, and that it came to rest."""
    f, q = bench.f, trace["q_slew"]
    went = float(q[-1] - q[min(at, len(q) - 1)])
    last = drive.speed(q[-25:])
    bench.found[f"coasts, {what}"] = went
    look = "brake and return valves of the slew"
    bench.between(f"{what}: the slew goes on by", abs(went), 0.0, f.commissioning_goes_on, "rad", look)
    bench.between(f"{what}: speed at the end", abs(last), 0.0, f.commissioning_rests, "rad/s", look)


def _first(there: np.ndarray) -> int:
    """Index of the first that holds; NEVER if none does."""
    places = np.flatnonzero(there)
    return int(places[0]) if len(places) else NEVER
