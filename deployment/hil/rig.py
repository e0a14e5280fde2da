"""The runtime and the simulated machine in real time on one computer: bus, machine and runtime, each in
processes.

The bus and the machine stand in for hardware, which keeps its time by itself; so they get real-time priority
where that is allowed, below the control process and above everything else.
"""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from secrets import randbelow
from types import TracebackType
from typing import Any, Self

from deployment.hil.planner import Planner
from records.record import Record, read
from runtime.can.busd import start_bus
from runtime.child import use
from runtime.helpers import ROOT
from runtime.realtime import PRIORITY
from runtime.shared import private_folder
from runtime.supervisor import Counts, Supervisor
from specs.errors import RunError
from specs.scenario import Scenario

BUS_PRIORITY, MACHINE_PRIORITY = PRIORITY - 10, PRIORITY - 20
PATIENCE_S = 120.0  # for processes to start, on a computer that does other things
HOST = "127.0.0.1"
DOMAINS, PARTICIPANTS = 102, 32  # of ROS 2; in each, on one computer


@dataclass(frozen=True)
class Interfaces:
    """Ports of Foxglove and OPC UA, and ROS 2's domain."""

    foxglove: int
    opcua: int
    domain: int
    commands: bool = False  # whether ROS 2 publishers may command
    policy: str = ""  # the ROS 2 node that has the role of the policy outside


@dataclass(frozen=True)
class Setting:
    """What a rig runs."""

    bundle: Path
    scenario: Scenario
    seed: int = 1
    pace: float = 1.0
    ticks: int | None = None  # of the scenario; None: all
    recorder: bool = True
    retain: bool = True
    hmi: int | None = None  # port of the operator's page; None: without it
    planner: bool = True  # False: targets come from the page
    interfaces: Interfaces | None = None  # with all of them


class Rig:
    """Bus, machine and runtime, started and ready; a context, which ends them all."""

    def __init__(self, setting: Setting) -> None:
        self.setting = setting
        self.folder = Path(tempfile.mkdtemp(prefix="slewright-hil-"))
        self.sockets = private_folder("slewright-bus-")
        self._used = use(self.sockets)  # what is left by a rig that was killed is removed by the next run
        self.port = free_port()
        self._bus: subprocess.Popen[bytes] | None = None
        self._machine: subprocess.Popen[str] | None = None
        self.supervisor: Supervisor | None = None
        self.planner = Planner(HOST, self.port, setting.scenario, setting.pace)

    @property
    def channel(self) -> Path:
        """The bus's socket."""
        return self.sockets / "bus"

    @property
    def recording(self) -> Path:
        """Where the runtime records."""
        return self.folder / "recording"

    @property
    def shared(self) -> Path:
        """Where the runtime's shared memory is, while it runs."""
        return self.supervisor.folder if self.supervisor else self.folder

    def __enter__(self) -> Self:
        try:
            self._bus = start_bus(self.channel)
            prefer(self._bus.pid, BUS_PRIORITY)
            self._machine = self._start_machine()
            self.supervisor = Supervisor(self._configuration())
            self.supervisor.__enter__()
            self.await_true(lambda: self.counts().ticks > 0, "the first cycle")
            if self.setting.planner:
                self.planner.connect()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        self.close()

    def begin(self) -> None:
        """The scenario's first tick."""
        machine = self._running()
        if machine.stdin:
            machine.stdin.write("start\n")
            machine.stdin.flush()
        if self.setting.planner:
            self.planner.start()

    def step(self) -> bool:
        """Keep planner and helpers going; True once the machine is through. RunError if a process failed."""
        if self.setting.planner:
            self.planner.work()
        if self.supervisor and (code := self.supervisor.watch()) is not None:
            raise RunError(f"the control process ended with {code}")
        return self._running().poll() is not None

    def record(self) -> Record:
        """The machine's record, at the end."""
        if self._running().wait(PATIENCE_S) != 0:
            raise RunError("the machine's process failed")
        return read(self.folder / "machine.parquet")

    def statistics(self) -> dict[str, Any]:
        """End the runtime; what its cycles came to."""
        assert self.supervisor  # noqa: S101  (within the context)
        return self.supervisor.run(lambda _: None, stop=lambda: True)

    def counts(self) -> Counts:
        """What the control process published last."""
        return self.supervisor.now() if self.supervisor else Counts()

    def await_true(self, condition: Callable[[], bool], what: str) -> None:
        """Wait; RunError if it never happens."""
        end = time.monotonic() + PATIENCE_S
        while not condition():
            if time.monotonic() > end:
                raise RunError(f"waited for {what} in vain")
            if self.supervisor and (code := self.supervisor.watch()) is not None:
                raise RunError(f"the control process ended with {code} before {what}")
            time.sleep(0.01)

    def close(self) -> None:
        """End everything and remove the folders."""
        self.planner.close()
        if self.supervisor:
            self.supervisor.close()
        for process in (self._machine, self._bus):
            if process and process.poll() is None:
                process.send_signal(signal.SIGTERM)
                with suppress(subprocess.TimeoutExpired):
                    process.wait(5)
                process.kill()
                process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)
        shutil.rmtree(self.sockets, ignore_errors=True)
        self._used.close()

    def _running(self) -> subprocess.Popen[str]:
        assert self._machine  # noqa: S101  (within the context)
        return self._machine

    def _start_machine(self) -> subprocess.Popen[str]:
        told = {
            "scenario": self.setting.scenario.name,
            "seed": self.setting.seed,
            "pace": self.setting.pace,
            "ticks": self.setting.ticks,
            "channel": str(self.channel),
            "record": str(self.folder / "machine.parquet"),
        }
        command = [sys.executable, "-m", "deployment.hil.machine_node", json.dumps(told)]
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT
        )
        if not process.stdout or process.stdout.readline() != "ready\n":
            raise RunError("the machine's process did not start")
        prefer(process.pid, MACHINE_PRIORITY)
        return process

    def _configuration(self) -> Path:
        s = self.setting
        lines = [
            f'bundle = "{s.bundle.resolve()}"',
            "[can]",
            'interface = "slewright"',
            f'channel = "{self.channel}"',
        ]
        lines += ["[modbus]", f'host = "{HOST}"', f"port = {self.port}"]
        lines += ["[recorder]", 'folder = "recording"'] * s.recorder + [
            "[retain]",
            'folder = "retained"',
        ] * s.retain
        lines += ["[hmi]", f"port = {s.hmi}"] if s.hmi else []
        if s.interfaces:
            lines += [
                "[foxglove]",
                f"port = {s.interfaces.foxglove}",
                "[opcua]",
                f"port = {s.interfaces.opcua}",
            ]
            lines += ["[ros2]", f"domain = {s.interfaces.domain}"]
            lines += ["commands = true"] * s.interfaces.commands
            lines += [f'policy = "{s.interfaces.policy}"'] * bool(s.interfaces.policy)
        path = self.folder / "machine.toml"
        path.write_text("\n".join(lines) + "\n")
        return path


def prefer(pid: int, priority: int) -> None:
    """Real-time priority for a process that stands in for hardware, if that is allowed; 0: none."""
    policy = os.SCHED_FIFO if priority else os.SCHED_OTHER
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(pid, policy | os.SCHED_RESET_ON_FORK, os.sched_param(priority))


def free_port() -> int:
    with socket.create_server((HOST, 0)) as server:
        return server.getsockname()[1]


def free_domain() -> int:
    """A ROS 2 domain in which nobody on this computer is: two that measure beside each other do not meet."""
    begin = randbelow(DOMAINS)
    for domain in ((begin + k) % DOMAINS for k in range(DOMAINS)):
        with ExitStack() as stack:
            try:
                for index in range(PARTICIPANTS):  # where each would hear of others (RTPS 2.5, 9.6.2)
                    end = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
                    end.bind(("", 7410 + 250 * domain + 2 * index))
                return domain
            except OSError:
                continue
    raise RunError("somebody is in every ROS 2 domain of this computer")
