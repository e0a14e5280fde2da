"""The ROS 2 process: `python -m runtime.ros2.process JSON`, started by the supervisor.

It publishes what `image.cell` holds, in every tick, takes targets where the configuration allows it, and ends
at SIGTERM.
"""

import json
import os
import signal as signals
import time
from pathlib import Path
from typing import Any

from runtime.helpers import end_with, run
from runtime.hmi.alarms import Level
from runtime.interfaces import outside, seats
from runtime.interfaces.beside import library, ready, until_told
from runtime.interfaces.news import Line, News
from runtime.interfaces.told import Teller
from runtime.interfaces.view import Seen, View
from runtime.ros2 import loopback
from specs import urdf
from specs.errors import InputError
from specs.signals import signal

LOG_LEVELS = {Level.CRITICAL: 40, Level.WARNING: 30, Level.NOTE: 20}  # rcl_interfaces/Log
DIAGNOSED = {Level.CRITICAL: 2, Level.WARNING: 1, Level.NOTE: 0}  # diagnostic_msgs/DiagnosticStatus
LOG, DIAGNOSTICS, MODEL = "/rosout", "/diagnostics", "/robot_description"
DIAGNOSTIC, LOG_TYPE = "diagnostic_msgs/msg/DiagnosticArray", "rcl_interfaces/msg/Log"
LINES = 100  # of the log that wait, and that a late subscriber gets
EVERY = 50  # ticks between two states of the diagnostics


class Live:
    """The node, and what it publishes."""

    def __init__(self, told: dict[str, Any]) -> None:
        from runtime.ros2 import messages
        from runtime.ros2.commands import Commands
        from runtime.ros2.node import Node
        from runtime.ros2.parameters import Parameter, Parameters, read
        from runtime.ros2.policy import PolicyCommands
        from runtime.ros2.services import Services
        from runtime.ros2.unheard import Unheard

        folder = Path(told["folder"])
        self._view, self._news = View.join(folder), News()
        self.lines: list[Line] = []
        self._teller = Teller(folder, "ros2")
        self.node = node = Node(told["domain"])
        self._messages = messages
        self._topics = [*messages.TOPICS, *([messages.CLOCK] if told["simulated"] else [])]
        for topic in self._topics:
            node.publisher(topic.name, topic.type)
        node.publisher(LOG, LOG_TYPE, latched=True, depth=LINES)
        node.publisher(DIAGNOSTICS, DIAGNOSTIC)
        node.publisher(MODEL, "std_msgs/msg/String", latched=True)
        self._commands = Commands(node, self._seat(folder), self.tell) if told["commands"] else None
        role = told["policy"]
        self._policy = PolicyCommands(node, role, outside.join(folder), self.tell) if role else None
        known = {n: Parameter(v, "of this run") for n, v in told["about"].items()}
        known |= read(Path(told["bundle"])) if told["bundle"] else {}
        self._services = Services(node, Parameters(known), self._mode, self._stop, self.tell)
        self._unheard = Unheard(node, self.tell)
        self._seen: Seen | None = None
        node.announce()
        node.publish(MODEL, messages.message("std_msgs/msg/String")(data=urdf.render()))
        self._lost = False

    def _seat(self, folder: Path) -> seats.Seat:
        granted = seats.join_granted(folder)
        if granted is None:
            raise InputError(f"ros2: {folder} has no cell of who has the right to command")
        return seats.Seat("ros2", seats.join(folder, "ros2"), granted, self.tell)

    def _mode(self) -> str:
        """Mode and fault, for people; "" if they are not known."""
        if self._seen is None or self._view.stale:
            return ""
        said = {n: signal(n).values for n in ("control_mode", "fault_code")}
        mode, fault = (texts.get(int(self._seen.of(n)), "?") for n, texts in said.items())
        return f"{mode}, fault {fault}"

    def _stop(self) -> bool:
        """End who commands over ROS 2; whether there was one."""
        ways = [way for way in (self._commands, self._policy) if way]
        return sum(way.stop("stop was called") for way in ways) > 0

    def tell(self, text: str, level: Level = Level.WARNING) -> None:
        """Something happened: on the console, in the HMI's alarms, and on /rosout."""
        if self._teller.tell(text, level):
            self.lines.append(Line("interface", level, text))

    def work(self) -> None:
        """Publish what is new, take what came."""
        peers = self.node.peers()
        if self._commands:
            self._commands.work(peers)
        if self._policy:
            self._policy.work(peers)
        now = time.monotonic_ns()
        self._services.work(peers, now)
        self._unheard.work(peers, now)
        seen = self._view.new()
        self._seen = seen or self._seen
        if seen:
            self._lost = False
            self._publish(seen)
        elif self._view.joined and self._view.stale and not self._lost:
            self._lost = True
            self.lines.append(Line("lost", Level.CRITICAL, "the control process no longer publishes"))
        while self.lines:
            self._log(self.lines.pop(0), self._view.last_ns)

    def _publish(self, seen: Seen) -> None:
        for topic in self._topics:
            if seen.tick % topic.every == 0:
                self.node.publish(topic.name, topic.made(seen))
        self.lines += self._news.of(seen)
        if seen.tick % EVERY == 0:
            self.node.publish(DIAGNOSTICS, self._diagnostics(seen))

    def _log(self, line: Line, at_ns: int) -> None:
        made, stamp = self._messages.message(LOG_TYPE), self._messages.time_of(at_ns)
        self.node.publish(LOG, made(stamp, LOG_LEVELS[line.level], "slewright", line.text, "", "", 0))

    def _diagnostics(self, seen: Seen) -> Any:
        """Every alarm that lasts; one that says all is well where there is none."""
        status = self._messages.message("diagnostic_msgs/msg/DiagnosticStatus")
        found = [
            status(DIAGNOSED[c.level], f"slewright: {c.key}", f"{c.text}: {c.cause}", "slewright", [])
            for c in self._news.present.values()
        ]
        well = status(0, "slewright", "no alarms", "slewright", [])
        return self._messages.message(DIAGNOSTIC)(self._messages.header(seen.time_ns, ""), found or [well])


def main(text: str) -> None:
    """Publish until told to end."""
    end_with(signals.SIGTERM)
    loopback.settings()
    library("cyclonedds", "cyclonedds", "ros2")
    live = Live(json.loads(text))
    if others := loopback.open_to_others():
        raise InputError(f"ros2: sockets {others} would hear other computers")
    ready(json.loads(text)["ready"], os.getpid())
    until_told(live.work)


if __name__ == "__main__":
    run(main)
