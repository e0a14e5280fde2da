"""Bus, machine, operator and clients around the controller under test, in real time."""

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Container, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import TracebackType
from typing import Self

from deployment.faults.drive import AUTOMATIC, mode_number
from deployment.faults.lines import Lines
from deployment.faults.table import Outcome
from deployment.hil.canopen_devices import Devices
from deployment.hil.loads import planning
from deployment.hil.machine import Machine
from deployment.hil.machine_node import PERIOD_NS, MachineNode, Valves
from deployment.hil.panel import ARMING_TICKS
from deployment.hil.punctual import LATE, Punctual
from deployment.hil.rig import BUS_PRIORITY, HOST, MACHINE_PRIORITY, free_port, prefer
from runtime.bundle import Bundle
from runtime.can.busd import start_bus
from runtime.can.port import open_bus
from runtime.child import use
from runtime.policy import open_core
from runtime.realtime import sleep_until
from runtime.recorder.reader import Recording
from runtime.recorder.replay import replay
from runtime.shared import private_folder
from specs.canopen import definition as devices_on
from specs.errors import RunError
from specs.scenario import load as load_scenario
from specs.signals import definition, signal

SCENARIO = "four_targets_empty"
PATIENCE_TICKS = 3000
HEARD_TICKS = 10  # before the operator's switches: the planner's slower messages have come
ARMED, FAULT = mode_number("armed"), mode_number("fault")
COMMANDS = ("u_slew", "u_boom", "u_stick")
STOP_TICKS = 100
RECORDING = "recording"  # folder
ATTEMPTS = 5  # of the operator to start automatic operation
CODES = signal("fault_code").values


class Plant:
    """Bus and machine, in real time in this process; a context."""

    def __init__(self, bundle: Bundle, seed: int, canopen: bool = False) -> None:
        """`canopen`: with the CANopen devices, on a bus of their own."""
        self._stack = ExitStack()
        self.folder = Path(tempfile.mkdtemp(prefix="slewright-faults-"))
        self._stack.callback(shutil.rmtree, self.folder, ignore_errors=True)
        sockets = private_folder("slewright-bus-")
        self._stack.callback(use(sockets).close)
        self._stack.callback(shutil.rmtree, sockets, ignore_errors=True)
        self.channel = sockets / "bus"
        bus = start_bus(self.channel)
        self._stack.callback(_end, bus)
        prefer(bus.pid, BUS_PRIORITY)
        end = open_bus("slewright", str(self.channel), definition().bus.bit_rate, "Machine")
        self._stack.callback(end.shutdown)
        self.devices_channel = sockets / "devices"
        self._simulated = self._simulate_devices() if canopen else None
        scenario = load_scenario(SCENARIO)
        machine = self._stack.enter_context(Machine(scenario, seed))
        self.node = MachineNode(end, scenario, machine, planner=True, devices=self._simulated)
        self.bundle = bundle
        self._punctual, self._others = Punctual(signal("operator_heartbeat")), list[Lines]()
        self._late = False
        self.tick, self.beat, self._deadline = -ARMING_TICKS, 0, time.monotonic_ns()

    def __enter__(self) -> Self:
        prefer(os.getpid(), MACHINE_PRIORITY)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        prefer(os.getpid(), 0)
        self._stack.close()

    def _simulate_devices(self) -> Devices:
        rate = devices_on().bus.bit_rate
        bus = start_bus(self.devices_channel, rate)
        self._stack.callback(_end, bus)
        prefer(bus.pid, BUS_PRIORITY)
        return self._stack.enter_context(
            Devices(open_bus("slewright", str(self.devices_channel), rate, "Devices"))
        )

    @property
    def devices(self) -> Devices:
        """The CANopen devices; RunError if it was made without."""
        if self._simulated is None:
            raise RunError("this plant has no CANopen devices")
        return self._simulated

    def configuration(self, helper: str = "") -> Path:
        """A configuration file, with one helper or none."""
        lines = [f'bundle = "{self.bundle.folder.resolve()}"', "[can]"]
        lines += ['interface = "slewright"', f'channel = "{self.channel}"']
        if helper:  # with Modbus, what clients do to it is to be repeated
            lines += ["[recorder]", f'folder = "{RECORDING}"', "limit_mb = 50"]
        if helper == "modbus":
            lines += ["[modbus]", f'host = "{HOST}"', f"port = {free_port()}"]
        if self._simulated:
            lines += ["[canopen]", 'interface = "slewright"', f'channel = "{self.devices_channel}"']
        path = self.folder / "machine.toml"
        path.write_text("\n".join(lines) + "\n")
        return path

    def replayed(self, outcome: Outcome) -> None:
        """Repeat what was recorded of the run that has ended; a miss where that does not come out alike."""
        result = replay(Recording(self.folder / RECORDING), open_core(self.bundle))
        if result.first:
            outcome.add(self.tick, None, f"the recording does not repeat: {result.first}")

    def wait(self, condition: Callable[[], bool]) -> None:
        """Periods before the start, neutral."""
        self._deadline = time.monotonic_ns()
        for _ in range(PATIENCE_TICKS):
            self._period()
            self.node.wait(self.beat)
            self._late |= self._punctual.was_late()
            self.node.valves.at(self.beat)
            if condition():
                return
        raise RunError("the control process was not heard")

    def drive(self, ticks: int, condition: Callable[[], bool]) -> bool:
        """Periods of the scenario until `condition`, at most so many; whether it came."""
        for _ in range(ticks):
            self._period()
            self.node.tick(self.tick, self.beat)
            self._late |= self._punctual.was_late()
            self.tick += 1
            if condition():
                return True
        return False

    def go(self, mode: int = AUTOMATIC) -> None:
        """From the arming of the controller to a mode (with Modbus, targets would come from there: ARMED)."""
        self.node.valves = Valves()  # what a controller before this one said is forgotten
        self.node.panel.over["machine_fault"] = 0.0  # somebody acknowledged the lost commands
        self.wait(lambda: self.shown("control_mode") > 0)
        del self.node.panel.over["machine_fault"]
        self.tick = -ARMING_TICKS - HEARD_TICKS
        if not self.drive(500, lambda: self.shown("control_mode") == mode):
            said = ", ".join(f"{name} {self.shown(name):.0f}" for name in ("control_mode", "fault_code"))
            raise RunError(f"mode {mode} did not come: {said}")
        self.late()  # what was before is over

    def go_automatic(self) -> None:
        """As `go`, the request a while after the enabling: a busy computer must not show both in one tick."""
        self.node.panel.over["automatic_request"] = 0.0
        for left in reversed(range(ATTEMPTS)):
            try:
                self.go(ARMED)
                break
            except RunError:  # the operator's message was late when the switch was pressed
                if not left:
                    raise
        del self.node.panel.over["automatic_request"]
        if not self.drive(500, lambda: self.shown("control_mode") == AUTOMATIC):
            raise RunError("automatic operation did not come")
        self.late()

    def acknowledge(self) -> None:
        """The operator's switch off, on and off again: a fault is left."""
        for state in (0.0, 1.0, 0.0):
            self.node.panel.over["operator_enable"] = state
            self.wait_periods(10)
        del self.node.panel.over["operator_enable"]

    def wait_periods(self, count: int) -> None:
        """So many periods, neutral."""
        left = iter(range(count))
        self.wait(lambda: next(left, None) is None)

    def ready(self) -> None:
        """In automatic operation, which goes on if it is there."""
        if self.shown("control_mode") != AUTOMATIC:
            self.acknowledge()
            self.go_automatic()

    def reaction(self, act: Callable[[], object], ticks: int, condition: Callable[[], bool]) -> float | None:
        """Time [ms] from an act until `condition`; None if it does not come in so many periods."""
        begun = time.monotonic()
        act()
        came = self.drive(ticks, condition)
        return 1000.0 * (time.monotonic() - begun) if came else None

    def stop(self, act: Callable[[], object], codes: Container[str]) -> tuple[float | None, str]:
        """The same until the machine has stopped, and what is wrong with the reason: one of `codes`."""
        ms = self.reaction(act, STOP_TICKS, self.stopped)
        return ms, "" if ms is None or self.fault in codes else f"fault code {self.fault}"

    @contextmanager
    def planned(self, port: int) -> Iterator["subprocess.Popen[str]"]:
        """With a planner of the scenario, which writes over Modbus."""
        with planning(port, SCENARIO) as planner, self.beside(planner):
            yield planner

    @contextmanager
    def beside(self, process: "subprocess.Popen[str]") -> Iterator[None]:
        """With a process that belongs to the rig, and says LATE when it was."""
        self._others.append(Lines(process))
        try:
            yield
        finally:
            self._late |= LATE in self._others.pop().new()

    def late(self) -> bool:
        """Whether machine, operator or a process of the rig was late since the last call."""
        found = [self._late, *(LATE in other.new() for other in self._others)]
        self._late = False
        return any(found)

    def stopped(self) -> bool:
        """Whether the controller says that it is in FAULT, with neutral commands."""
        return self.shown("control_mode") == FAULT and not any(self.shown(n) for n in COMMANDS)

    def shown(self, name: str) -> float:
        """What the controller says."""
        return self.node.valves.value(name)

    @property
    def fault(self) -> str:
        """The fault code that the controller says."""
        return CODES[int(self.shown("fault_code"))]

    def _period(self) -> None:
        self._deadline += PERIOD_NS
        sleep_until(self._deadline)
        self.beat += 1
        self.node.listen(self.beat, time.monotonic_ns())


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()
