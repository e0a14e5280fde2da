"""Load zero: the empty grab weighed in several poses, the machine's own figures fitted to it (load estimate).

The result is a file of `slewright estimate calibrate`'s form; `slewright bundle --load-calibration` takes it.
"""

import json

from baselines.load.balance import unknowns
from baselines.load.calibration import calibrate, uncalibrated
from baselines.load.calibration_file import as_dict
from baselines.load.influence import influence
from deployment.commissioning import balance, drive
from deployment.commissioning.bench import Bench
from deployment.commissioning.steps.safety import hold, release

FILE = "load-calibration.json"
POSES = (
    (1.25, -1.4),
    (1.0, -1.2),
    (1.1, -1.9),
    (1.3, -1.9),
)  # boom, stick, rad: bore sides between 90 and 200 bar


def run(bench: Bench) -> None:
    """Poses, rests, fit."""
    bench.do("ready", "Grab empty, closed, and hanging free")
    hold(bench)
    first = bench.rig.tick
    for pose in POSES:
        for joint, target in zip(("boom", "stick"), pose, strict=True):
            drive.go(bench, joint, target)
        drive.stop(bench, bench.f.commissioning_weigh)
    bench.neutral()
    release(bench)
    fitted = calibrate([balance.measurement(bench.rig.since(first), zeros=_zeros(bench))], [0.0])
    known = unknowns()
    for u, value in zip(known, fitted.values, strict=True):
        off = float(abs(value - u.value) / u.sd)
        bench.between(
            f"{u.name}: off its nominal", off, 0.0, 3.0, "standard deviations", "pressure sensors, grab"
        )
    bench.found["kg at rest, standard deviation before"] = influence(uncalibrated())["total"]
    now = bench.found["kg at rest, standard deviation now"] = influence(fitted)["total"]
    bench.between(
        "load at rest: standard deviation", now, 0.0, bench.f.commissioning_tared, "kg", "more poses"
    )
    bench.files[FILE] = json.dumps(as_dict(fitted), indent=2) + "\n"
    bench.verdict()


def _zeros(bench: Bench) -> dict[str, float]:
    """What the core will take off the sensors before its own estimate sees them."""
    found = bench.before["rest"]
    return {n.removeprefix("zero "): v for n, v in found.items() if n.startswith("zero ")}
