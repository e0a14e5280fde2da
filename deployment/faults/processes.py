"""Processes that are killed, at random moments, while the controller drives the machine in real time."""

import os
import shutil
import signal
import subprocess
import tempfile
import time
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from deployment.faults.attacks import attacker
from deployment.faults.drive import AUTOMATIC, mode_number
from deployment.faults.table import Fault, Outcome
from deployment.hil.canopen_devices import Devices
from deployment.hil.loads import clients, planning
from deployment.hil.machine import Machine
from deployment.hil.machine_node import PERIOD_NS, MachineNode, Valves
from deployment.hil.panel import ARMING_TICKS
from deployment.hil.rig import BUS_PRIORITY, HOST, MACHINE_PRIORITY, free_port, prefer
from runtime.bundle import Bundle
from runtime.can.busd import start_bus
from runtime.can.port import open_bus
from runtime.child import use
from runtime.image import Flag
from runtime.policy import open_core
from runtime.realtime import sleep_until
from runtime.recorder.reader import Recording
from runtime.recorder.replay import replay
from runtime.shared import private_folder
from runtime.supervisor import Supervisor
from specs.canopen import definition as devices_on
from specs.errors import RunError
from specs.progress import Report
from specs.scenario import load as load_scenario
from specs.signals import definition

SCENARIO = "four_targets_empty"
PATIENCE_TICKS = 3000
HEARD_TICKS = 10  # before the operator's switches: the planner's slower messages have come
ARMED, FAULT = mode_number("armed"), mode_number("fault")
COMMANDS = ("u_slew", "u_boom", "u_stick")
BURST_S = 0.2
ATTACK_TICKS = 40  # longer than a heartbeat may stand still
RECORDING = "recording"  # folder
ATTEMPTS = 5  # of the operator to start automatic operation
HELPERS = {"recorder_killed": ("recorder", Flag.RECORDER_LOST), "modbus_killed": ("modbus", Flag.MODBUS_LOST)}


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
            self.node.valves.at(self.beat)
            if condition():
                return
        raise RunError("the control process was not heard")

    def drive(self, ticks: int, condition: Callable[[], bool]) -> bool:
        """Periods of the scenario until `condition`, at most so many; whether it came."""
        for _ in range(ticks):
            self._period()
            self.node.tick(self.tick, self.beat)
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

    def stopped(self) -> bool:
        """Whether the controller says that it is in FAULT, with neutral commands."""
        return self.shown("control_mode") == FAULT and not any(self.shown(n) for n in COMMANDS)

    def shown(self, name: str) -> float:
        """What the controller says."""
        return self.node.valves.value(name)

    def _period(self) -> None:
        self._deadline += PERIOD_NS
        sleep_until(self._deadline)
        self.beat += 1
        self.node.listen(self.beat, time.monotonic_ns())


def run_all(
    bundle: Bundle,
    wanted: Sequence[Fault],
    count: int,
    seed: int,
    report: Report,
    more: Mapping[str, Callable[..., None]],
) -> list[Outcome]:
    """Each of the `wanted` faults `count` times; `more` injects those that are not here."""
    makers: dict[str, Callable[..., None]] = {
        **more,
        "control_killed": _control_killed,
        "modbus_flooding": _flooded,
        "modbus_client_gone": _client_gone,
        "modbus_reading_flood": _attacked,
        "modbus_second_writer": _attacked,
        "modbus_idle_connections": _attacked,
    }
    outcomes = []
    for fault in wanted:
        random = np.random.default_rng([seed, zlib.crc32(fault.name.encode())])
        outcome = Outcome(fault)
        with Plant(bundle, seed, canopen=fault.name.startswith("canopen_")) as plant:
            makers.get(fault.name, _helper_killed)(plant, outcome, count, random, report)
        outcomes.append(outcome)
    return outcomes


def _control_killed(
    plant: Plant, outcome: Outcome, count: int, random: np.random.Generator, report: Report
) -> None:
    path = plant.configuration()
    for number in range(count):
        report(outcome.fault.name, number, count)
        with Supervisor(path) as supervisor:
            plant.go()
            plant.drive(int(random.integers(5, 60)), lambda: False)
            killed = time.monotonic()
            os.kill(supervisor.control.pid, signal.SIGKILL)
            neutral = plant.drive(50, lambda: not plant.node.valves.follows)
            ms = 1000.0 * (time.monotonic() - killed)
            outcome.add(plant.tick, ms if neutral else None)


def _client_gone(
    plant: Plant, outcome: Outcome, count: int, random: np.random.Generator, report: Report
) -> None:
    """A client in a process of its own drives the machine, and is killed."""
    with Supervisor(plant.configuration("modbus")) as supervisor:
        modbus = supervisor.wanted.modbus
        port = modbus.port if modbus else 0
        for number in range(count):
            report(outcome.fault.name, number, count)
            with planning(port, SCENARIO) as client:
                plant.acknowledge()
                plant.go_automatic()
                plant.drive(int(random.integers(5, 60)), lambda: False)
                killed = time.monotonic()
                client.kill()
                stopped = plant.drive(100, plant.stopped)
                ms = 1000.0 * (time.monotonic() - killed)
            code = definition().signals["fault_code"].values[int(plant.shown("fault_code"))]
            why = "" if code in outcome.fault.codes or not stopped else f"fault code {code}"
            outcome.add(plant.tick, ms if stopped else None, why)
    plant.replayed(outcome)


def _attacked(
    plant: Plant, outcome: Outcome, count: int, random: np.random.Generator, report: Report
) -> None:
    """A planner drives the machine by Modbus while other clients attack (attacks.py): it goes on."""
    with Supervisor(plant.configuration("modbus")) as supervisor:
        modbus = supervisor.wanted.modbus
        port = modbus.port if modbus else 0
        with planning(port, SCENARIO), attacker(port, outcome.fault.name) as attack:
            for number in range(count):
                report(outcome.fault.name, number, count)
                if plant.shown("control_mode") != AUTOMATIC:
                    plant.acknowledge()
                    plant.go_automatic()
                plant.drive(int(random.integers(5, 20)), lambda: False)
                judged = attack()
                left = plant.drive(ATTACK_TICKS, lambda: plant.shown("control_mode") != AUTOMATIC)
                code = definition().signals["fault_code"].values[int(plant.shown("fault_code"))]
                why = judged()
                outcome.add(plant.tick, 0.0, f"automatic ended: {code}" if left else why)
    plant.replayed(outcome)


def _flooded(plant: Plant, outcome: Outcome, count: int, random: np.random.Generator, report: Report) -> None:
    """Bursts at moments that the clients choose; each counts as caught if nothing changed in all of them."""
    with Supervisor(plant.configuration("modbus")) as supervisor:
        modbus = supervisor.wanted.modbus
        with clients(modbus.port if modbus else 0, BURST_S, count) as found:
            process = found["process"]
            plant.go(ARMED)
            plant.drive(
                PATIENCE_TICKS,
                lambda: process.poll() is not None or plant.shown("control_mode") != ARMED,
            )
            left = process.poll() is not None
        why = "" if left and plant.shown("control_mode") == ARMED else "the mode changed"
        why = why or ("overruns" if supervisor.now().overruns else "")
        for _ in range(count):
            outcome.add(plant.tick, 0.0, why)
    plant.replayed(outcome)


def _helper_killed(
    plant: Plant, outcome: Outcome, count: int, random: np.random.Generator, report: Report
) -> None:
    name, flag = HELPERS[outcome.fault.name]
    with Supervisor(plant.configuration(name)) as supervisor:
        helper = next(h for h in supervisor.helpers if h.name == name)
        plant.go(ARMED if name == "modbus" else AUTOMATIC)
        for number in range(count):
            report(outcome.fault.name, number, count)
            plant.drive(int(random.integers(5, 60)), lambda: False)
            killed = time.monotonic()
            os.kill(helper.pid, signal.SIGKILL)
            seen = plant.drive(100, lambda: bool(int(plant.shown("runtime_flags")) & flag))
            ms = 1000.0 * (time.monotonic() - killed)
            back = plant.drive(PATIENCE_TICKS, lambda: _well(supervisor, plant, flag))
            why = "" if back else "it did not come back"
            if supervisor.watch() is not None or supervisor.now().overruns:
                why = "the control process was touched"
            outcome.add(plant.tick, ms if seen else None, why)


def _well(supervisor: Supervisor, plant: Plant, flag: Flag) -> bool:
    """Watch as `slewright run` does, who waits before the next start; whether the flag has gone."""
    supervisor.watch()
    return not int(plant.shown("runtime_flags")) & flag


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()
