"""CANopen devices that are lost or wrong, and their master killed, in real time, in automatic operation."""

import os
import signal
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from deployment.faults.drive import AUTOMATIC
from deployment.faults.episodes import Result, episodes
from deployment.faults.plant import ATTEMPTS, PATIENCE_TICKS, STOP_TICKS, Plant
from deployment.faults.table import Fault, Outcome
from deployment.hil.canopen_devices import SimulatedDevice
from runtime.canopen import cells
from runtime.interfaces.told import Listener
from runtime.supervisor import Supervisor
from specs.canopen import definition
from specs.errors import RunError
from specs.progress import Report

ENCODERS = [n.name for n in definition().nodes if n.device.name == "encoder"]
TOLD_TICKS = 1500
VENDOR = 1  # sub-index of object 0x1018


class Driven:
    """A run with devices, which drives; what its master says."""

    def __init__(self, plant: Plant, supervisor: Supervisor) -> None:
        self.plant, self.supervisor = plant, supervisor
        self._accepted = cells.join(supervisor.folder)[0]
        self._listener = Listener(supervisor.folder, "canopen")

    def numbers(self) -> list[int]:
        """The settings in force."""
        return cells.read(self._accepted)

    def go(self) -> None:
        """All devices there, and in automatic operation; a busy computer may lose a device meanwhile."""
        for left in reversed(range(ATTEMPTS)):
            if 0 not in self.numbers() and self.plant.shown("control_mode") == AUTOMATIC:
                return
            self.plant.wait(lambda: 0 not in self.numbers())
            self.plant.acknowledge()
            with suppress(*[RunError] * bool(left)):
                self.plant.go_automatic()
                return

    def said(self) -> str:
        """What was told since the last call."""
        return "; ".join(event["what"] for event in self._listener.new())

    def one(self, random: np.random.Generator) -> SimulatedDevice:
        """One of the encoders."""
        return self.plant.devices.by_name[str(random.choice(ENCODERS))]


def _unplugged(driven: Driven, fault: Fault, random: np.random.Generator) -> Result:
    plant, device = driven.plant, driven.one(random)
    plant.drive(int(random.integers(5, 60)), lambda: False)
    found = plant.stop(device.switch_off, fault.codes)
    device.switch_on()
    return found


def _wrong_identity(driven: Driven, fault: Fault, random: np.random.Generator) -> Result:
    """In the other's place, with the same number; then the right one again."""
    plant, device = driven.plant, driven.one(random)
    place = list(plant.devices.by_name).index(device.node.name)
    plant.drive(int(random.integers(5, 60)), lambda: False)
    driven.said()
    right = dict(device.identity)
    device.identity = {VENDOR: int(random.integers(1, 0xFFFF)) | 0x1_0000}
    device.restart()
    plant.drive(STOP_TICKS, plant.stopped)
    told: list[str] = []
    until = plant.drive(TOLD_TICKS, lambda: bool(told.append(driven.said())) or _refused(told, device))
    counted = driven.numbers()[place] != 0
    device.identity = right
    device.restart()
    why = "" if plant.stopped() else "the machine went on without it"
    return 0.0, why or ("" if until else "nobody was told") or ("it counted" if counted else "")


def _refused(told: list[str], device: SimulatedDevice) -> bool:
    return f"{device.node.name} is refused: wrong device: vendor" in "; ".join(told)


def _killed(driven: Driven, fault: Fault, random: np.random.Generator) -> Result:
    plant, supervisor = driven.plant, driven.supervisor
    helper, numbers = next(h for h in supervisor.helpers if h.name == "canopen"), driven.numbers()
    plant.drive(int(random.integers(5, 60)), lambda: False)
    pid = helper.pid
    ms = plant.reaction(
        lambda: os.kill(pid, signal.SIGKILL),
        PATIENCE_TICKS,
        lambda: supervisor.watch() is None and helper.pid != pid,
    )
    plant.drive(STOP_TICKS, lambda: False)  # it has begun
    why = "" if plant.shown("control_mode") == AUTOMATIC else f"automatic ended: {plant.fault}"
    return ms, why or ("" if driven.numbers() == numbers else "devices were set up anew")


def _repeated(one: Callable[[Driven, Fault, np.random.Generator], Result]) -> Callable[..., None]:
    def run(plant: Plant, outcome: Outcome, count: int, random: np.random.Generator, report: Report) -> None:
        with Supervisor(plant.configuration()) as supervisor:
            driven = Driven(plant, supervisor)

            def inject() -> Result:
                driven.go()
                return one(driven, outcome.fault, random)

            episodes(plant, outcome, count, report, inject)

    return run


INJECTIONS = {
    "canopen_unplugged": _repeated(_unplugged),
    "canopen_wrong_identity": _repeated(_wrong_identity),
    "canopen_killed": _repeated(_killed),
}
