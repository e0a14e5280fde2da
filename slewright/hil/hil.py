"""Hardware in the loop: a scenario in real time over CAN and Modbus, compared with the same in lock-step.

Both runs use the same core, machine and noise; what differs are the wires (quantised values, a frame that
comes a tick earlier or later) and real time.  The tolerances are what that may come to, stated before the
comparison.
"""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from records.metrics import compute
from records.record import Record
from runtime.bundle import load
from runtime.control import ControlCore
from slewright.hil.lockstep import lockstep
from slewright.hil.rig import Rig, Setting
from slewright.progress import Report
from specs.scenario import TICK_S

POLL_S = 0.005
# What quantised wires and a tick of delay may change: about a tenth of the metrics' own size.
TOLERANCES = {
    "speed": ("°/s", 0.5),
    "overshoot": ("°", 1.0),
    "error": ("m", 0.1),
    "tool": ("°/s", 2.0),
}
SLEW_DEG = 4.0  # largest difference of the slew angle at any time


@dataclass(frozen=True)
class Compared:
    """Metrics of both runs and how far the slew angles were apart at most."""

    real: dict[str, float]
    simulated: dict[str, float]
    slew_deg: float
    statistics: dict[str, Any]
    late_ticks: int  # of the machine, which stands in for hardware

    def misses(self) -> list[str]:
        """What is beyond its tolerance."""
        found = [
            f"{name}: {self.real[name]:.3f} in real time, {self.simulated[name]:.3f} in lock-step, "
            f"more than {limit:g} {unit} apart"
            for name, (unit, limit) in TOLERANCES.items()
            if name in self.real and not abs(self.real[name] - self.simulated[name]) <= limit
        ]
        if not self.slew_deg <= SLEW_DEG:
            found.append(f"slew angles {self.slew_deg:.2f}° apart, more than {SLEW_DEG:g}°")
        return found


def run(setting: Setting, report: Report) -> Compared:
    """Both runs; RunError if a process fails."""
    core = ControlCore(load(setting.bundle))
    report("in lock-step")
    simulated = lockstep(core, setting.scenario, setting.seed, setting.ticks, pace=setting.pace)
    report("starting bus, machine and runtime")
    with Rig(setting) as rig:
        rig.begin()
        begun, total = time.monotonic(), (setting.ticks or setting.scenario.duration_ticks) * TICK_S
        while not rig.step():
            report("in real time", min(total, time.monotonic() - begun), total)
            time.sleep(POLL_S)
        real = rig.record()
        statistics = rig.statistics()
    return compared(real, simulated, statistics)


def compared(real: Record, simulated: Record, statistics: dict[str, Any]) -> Compared:
    """The comparison; metrics only of targets that both runs saw to their end."""
    rows = min(len(real), len(simulated))
    angles = [record.column("true_q_slew")[:rows] for record in (real, simulated)]
    apart = np.abs(angles[0] - angles[1])
    both = [compute(record).as_dict() for record in (real, simulated)]
    metrics = [{name: found[name] for name in TOLERANCES if found[name] is not None} for found in both]
    late = int(real.meta.get("late_ticks", 0))
    return Compared(metrics[0], metrics[1], float(np.degrees(apart.max())), statistics, late)
