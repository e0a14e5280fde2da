"""Recordings outside of any plan, for tests of what happens in one."""

from pathlib import Path

from learning.collection.command import Command, Sample
from learning.collection.machine import Machine
from learning.collection.plan import Plan, Recording
from learning.collection.recorder import record
from records.record import Record, read


def one(seconds: float, q_boom: float = 1.1, q_stick: float = -1.3, load_kg: float = 0.0) -> Recording:
    """A recording outside of any plan."""
    return Recording(0, "one", "one", "steps", "train", 0, seconds, q_boom, q_stick, load_kg)


def made(machine: Machine, plan: Plan, recording: Recording, pilot, path: Path) -> Record:
    record(machine, recording, pilot, plan.limits, 1, path, {})
    return read(path)


class Always:
    """A pilot that wants one thing for ever."""

    def __init__(self, command: Command) -> None:
        self.command = command

    def __call__(self, period: int, seen: Sample) -> Command:
        return self.command
