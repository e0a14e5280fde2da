"""Bus checkout: every message that the controller expects is there, often enough, right, in range.

Nothing is moved and nobody has to do anything; commands are sent as neutral and not enabled.
"""

import numpy as np

from deployment.commissioning.bench import Bench
from deployment.commissioning.wiring import OPTIONAL
from runtime.can.codec import received_by
from runtime.image import INPUT, NODE, TICK_S, Flag, Group, Status, group

HEARTBEATS = ("operator_heartbeat", "machine_heartbeat", "imu_cabin_heartbeat", "imu_tool_heartbeat")
WORDS = {s.value: s.name.lower().replace("_", " ") for s in Status}


def run(bench: Bench) -> None:
    """Listen, then judge every message and every signal."""
    rig, f = bench.rig, bench.f
    bench.wait(f.commissioning_listen / 2)  # counters are known from the second frame on
    rig.bus.clear()
    rig.bus.counting = True
    trace = bench.wait(f.commissioning_listen)
    rig.bus.counting = False
    bench.equal(
        "bus", "off" if rig.image["flags"] & Flag.BUS_OFF else "on", "on", "bit rate, termination, wiring"
    )
    for codec in received_by(NODE):
        message = codec.message
        if message.sender not in OPTIONAL:
            _message(bench, message.name, message.sender, message.cycle_ms / 1000, len(trace) * TICK_S)
    for place, s in enumerate(INPUT.signals):
        gone = s.can is not None and not rig.bus.frames[s.can.message]  # said of its message already
        if group(s) not in (Group.PLANNER, Group.POLICY) and not gone:
            _signal(bench, s.name, trace.status[:, place])
    for name in HEARTBEATS:
        counts = len(np.unique(trace[name]))
        bench.between(f"{name}: values seen", counts, 3, float("inf"), "", "the sender repeats old frames")
    bench.found["unknown frames"] = {f"{i:#x}": n for i, n in rig.bus.unknown.items()}
    bench.verdict()


def _message(bench: Bench, name: str, sender: str, cycle_s: float, seconds: float) -> None:
    tolerance = bench.f.commissioning_rate_tolerance
    count, wrong = bench.rig.bus.frames[name], bench.rig.bus.wrong[name]
    low, high = ((1.0 + side * tolerance) * seconds / cycle_s + side for side in (-1.0, 1.0))
    where = f"{sender}: supply, cable, its configuration of the cycle ({cycle_s * 1000:g} ms)"
    bench.between(f"message {name}: rate", count / seconds, low / seconds, high / seconds, "1/s", where)
    bench.equal(
        f"message {name}: frames with a wrong checksum or counter", wrong, 0, f"{sender}: DBC, data ID"
    )


def _signal(bench: Bench, name: str, status: np.ndarray) -> None:
    worst = int(status[np.argmax(status != Status.OK)])
    share = float(np.mean(status != Status.OK))
    if share:
        said = f"{WORDS[worst]} in {share:.0%} of the ticks"
        bench.equal(f"signal {name}", said, "ok", f"the sensor of {name}, its cable, its range")
