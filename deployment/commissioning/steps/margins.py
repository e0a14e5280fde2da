"""Dead band, gain and delay of the slew at limited authority, and the margins that the controller has on it.

The joystick is raised in steps, each held, until the slew turns: the dead band, both ways.  Then sines of
small amplitude drive it, a few degrees each.  The bundle's own core is given what the sensors showed
(deployment/commissioning/answers.py), and what it would have answered to its own joystick is the loop: how
much more gain and delay it bears on this machine.  A controller that bears too little is refused, before it
has moved anything.
"""

from baselines.margins.drive import Swing, drive as drive_of
from baselines.margins.experiment import FREQUENCIES_HZ, experiment
from deployment.commissioning import answers, covered, drive
from deployment.commissioning.bench import Bench
from deployment.commissioning.rig import Trace
from deployment.commissioning.steps.safety import LEFT, RIGHT, hold, release


def run(bench: Bench) -> None:
    """Dead bands, sines, then what they say."""
    hold(bench)
    bands = {sign: _dead_band(bench, sign) for sign in (1.0, -1.0)}
    bench.verdict()
    amplitude, settle_s = experiment().amplitude(max(bands.values())), experiment().settle_s
    traces = _sines(bench, amplitude)
    release(bench)
    bundle = bench.rig.core.bundle
    measured = drive_of([Swing(hz, t["u_slew"], t["q_slew"]) for hz, t in traces.items()], bands, settle_s)
    loops = answers.loops(bundle, traces, settle_s)
    bench.found |= {"amplitude": amplitude, **measured.as_dict(), **covered.margins(loops)}
    bench.found["loops"] = [loop.as_dict() for loop in loops]
    bench.found["sines"] = {str(hz): [t.first - bench.begun, len(t)] for hz, t in traces.items()}  # rows
    bench.found["plants"] = list(covered.plants(bundle) or ())
    for limit in covered.limits(bundle, loops, measured):
        bench.between(limit.name, limit.measured, limit.low, limit.high, limit.unit, covered.look(bundle))
    bench.verdict()


def _dead_band(bench: Bench, sign: float) -> float:
    """The joystick half a step before the one at which the slew turns; NaN if it never does."""
    f, rig, asked = bench.f, bench.rig, experiment()
    way = LEFT["slew"] if sign > 0 else RIGHT["slew"]
    drive.alone(bench, "slew", f.commissioning_most)
    rig.watch = drive.Guard(bench, "slew", f.commissioning_furthest)
    drive.begin(bench, "slew", sign)
    still, found = bench.before.get("rest", {}).get("zero imu_cabin_rate_z", 0.0), float("nan")
    for number, level in enumerate(asked.levels):
        rig.wanted = drive.command("slew", sign * level)
        if asked.turns(bench.wait(asked.hold_s)["imu_cabin_rate_z"] - still, sign):
            found = asked.dead_band(number)
            break
    drive.stop(bench, f.commissioning_coast)
    rig.watch = None
    bench.found[f"dead band {way}"] = found
    look = "valve of the slew, pilot pressure, brake"
    bench.between(f"slew {way}: dead band", found, asked.levels[0], asked.levels[-1], "", look)
    return found


def _sines(bench: Bench, amplitude: float) -> dict[float, Trace]:
    """frequency -> what passed while the joystick was a sine of it."""
    f, rig, asked = bench.f, bench.rig, experiment()
    rig.limit(drive.command("slew", amplitude))
    rig.watch = drive.Guard(bench, "slew", f.commissioning_furthest)
    drive.begin(bench, "slew", 1.0)
    found = {}
    for number, hz in enumerate(FREQUENCIES_HZ):
        first = rig.tick
        for k in range(asked.sine_ticks):
            rig.wanted = drive.command("slew", asked.sine(number, k, amplitude))
            rig.step()
        found[hz] = rig.since(first)
    drive.stop(bench, f.commissioning_coast)
    bench.neutral()
    return found
