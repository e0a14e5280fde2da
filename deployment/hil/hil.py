"""Hardware in the loop: a scenario in real time over CAN and Modbus, compared with the same in lock-step.

Both runs use the same core, machine and noise; what differs are the wires (quantised values, a frame that
comes a tick earlier or later) and real time.  The tolerances are what that may come to, stated before the
comparison.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from deployment.hil.lockstep import lockstep
from deployment.hil.rig import Rig, Setting
from records.metrics import compute
from records.record import Record
from runtime.bundle import load
from runtime.control import ControlCore
from runtime.hmi.cells import SEEN, SEEN_FILE, state_of
from runtime.image import INPUT
from runtime.shared import Cell
from runtime.supervisor import Supervisor
from specs.progress import Report
from specs.scenario import TICK_S

POLL_S = 0.005
DRIVE_TICKS = 180_000  # an hour
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

    def rows(self) -> list[tuple[str, float, float, float]]:
        """What is compared, in real time and in lock-step, and the tolerance."""
        metrics = [
            (f"{name} in {unit}", self.real[name], self.simulated[name], limit)
            for name, (unit, limit) in TOLERANCES.items()
            if name in self.real
        ]
        return [*metrics, ("slew angles apart in °", self.slew_deg, 0.0, SLEW_DEG)]

    def figures(self) -> dict[str, Any]:
        """Everything for JSON."""
        tolerances = {name: limit for name, (_, limit) in TOLERANCES.items()}
        return {
            "real_time": self.real,
            "lock_step": self.simulated,
            "slew_apart_deg": self.slew_deg,
            "tolerance": {**tolerances, "slew_apart_deg": SLEW_DEG},
            "within_tolerance": not self.misses(),
            "statistics": self.statistics,
            "machine_late_ticks": self.late_ticks,
        }

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


def run(
    setting: Setting, report: Report, started: Callable[[Supervisor], None] = lambda supervisor: None
) -> Compared:
    """Both runs; RunError if a process fails. `started` is called once the runtime runs."""
    core = ControlCore(load(setting.bundle))
    report("in lock-step")
    simulated = lockstep(core, setting.scenario, setting.seed, setting.ticks, pace=setting.pace)
    report("starting bus, machine and runtime")
    with Rig(setting) as rig:
        if rig.supervisor:
            started(rig.supervisor)
        rig.begin()
        begun, total = time.monotonic(), (setting.ticks or setting.scenario.duration_ticks) * TICK_S
        while not rig.step():
            report("in real time", min(total, time.monotonic() - begun), total)
            time.sleep(POLL_S)
        real = rig.record()
        statistics = rig.statistics()
    return compared(real, simulated, statistics)


def on_page(setting: Setting, started: Callable[[Supervisor], None], report: Report) -> None:
    """The machine alone, for somebody who sets its targets on the page; until its time is over or Ctrl-C.

    The simulated operator enables automatic operation when the first target has been set.
    """
    setting = replace(setting, ticks=setting.ticks or DRIVE_TICKS)
    report("starting bus, machine and runtime")
    with Rig(setting) as rig:
        if rig.supervisor:
            started(rig.supervisor)
        seen, begun = Cell.open(rig.shared / SEEN_FILE, SEEN.itemsize, "seen"), False
        while not rig.step():
            found = state_of(seen, SEEN)
            if (
                not begun
                and found is not None
                and found["inputs"]["value"][INPUT.index["target_valid"]] > 0.5
            ):
                begun = True
                rig.begin()
            report("driving" if begun else "waiting for a target from the page")
            time.sleep(POLL_S)


def compared(real: Record, simulated: Record, statistics: dict[str, Any]) -> Compared:
    """The comparison; metrics only of targets that both runs saw to their end."""
    rows = min(len(real), len(simulated))
    angles = [record.column("true_q_slew")[:rows] for record in (real, simulated)]
    apart = np.abs(angles[0] - angles[1])
    both = [compute(record).as_dict() for record in (real, simulated)]
    metrics = [{name: found[name] for name in TOLERANCES if found[name] is not None} for found in both]
    late = int(real.meta.get("late_ticks", 0))
    return Compared(metrics[0], metrics[1], float(np.degrees(apart.max())), statistics, late)
