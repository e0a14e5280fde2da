"""The whole system's state: what follows a snapshot is the same wherever it is restored."""

from pathlib import Path

import numpy as np
import pytest

from orchestrator.run.master import Master, Options
from orchestrator.system.layout import lay_out
from orchestrator.system.system import System
from specs.errors import RunError
from specs.faults import Fault
from tests.orchestrator.systems import OSCILLATOR, chain, load

FAULTS = (
    Fault(target="speed.x", kind="delay", delay_s=0.03),
    Fault(target="position.v", kind="noise", std=0.1),
)


def started(system: System, faults: tuple[Fault, ...] = FAULTS) -> Master:
    """The oscillator, initialised."""
    master = Master(system, lay_out(system), system.start_values({}), Options(faults=faults, seed=4))
    master.initialise()
    return master


def places(master: Master, ticks: int) -> list[float]:
    """The position after each of so many further ticks."""
    cell = master.layout.logged[0].cell
    found = []
    for _ in range(ticks):
        master.run(master.tick + 1)
        master.log_last()  # brings the system outputs up to date
        found.append(float(master.plan.reals[cell]))
    return found


@pytest.mark.parametrize("fmi_version", [2, 3])
def test_the_same_future_from_a_snapshot(tmp_path: Path, fmi_version: int) -> None:
    system = load(tmp_path, OSCILLATOR, ["position", "speed"], fmi_version)
    with started(system) as master, started(system) as other:
        places(master, 30)
        data = master.snapshot()
        future = places(master, 30)
        other.restore(data)
        assert other.tick == 30
        assert places(other, 30) == future
        master.restore(data)  # back in time in the same system
        assert places(master, 30) == future
        assert len(np.unique(future)) == 30


def test_bytes_of_another_system_are_refused(tmp_path: Path) -> None:
    system = load(tmp_path, OSCILLATOR, ["position", "speed"])
    other = load(tmp_path, chain(), ["decay", "position"])
    with started(system) as master, started(other, ()) as stranger:
        data = master.snapshot()
        for wrong in (b"", data[:-1], data + b"x", b"x" + data[1:], stranger.snapshot()):
            with pytest.raises(RunError, match="no snapshot of this system"):
                master.restore(wrong)


def test_damaged_bytes_are_refused_and_change_nothing(tmp_path: Path) -> None:
    system = load(tmp_path, OSCILLATOR, ["position", "speed"])
    with started(system) as master, started(system) as other:
        places(master, 30)
        data = master.snapshot()
        for at in (24, 32, 40, len(data) // 2, len(data) - 1):  # tick, size, check, cells and states
            with pytest.raises(RunError, match="no snapshot of this system"):
                other.restore(data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :])
        assert other.tick == 0
        other.restore(data)
        assert places(other, 5) == places(master, 5)
