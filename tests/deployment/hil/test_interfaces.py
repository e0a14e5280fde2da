"""A ROS 2 node drives the simulated machine in real time; the recording repeats bit for bit."""

import threading
import time

import pytest

from deployment.hil.rig import Interfaces, Rig, Setting, free_port
from runtime.control import ControlCore
from runtime.recorder.reader import Recording
from runtime.recorder.replay import replay
from specs import ros2
from specs.scenario import load
from tests.runtime.bench import AUTOMATIC, FAULT
from tests.runtime.bundles import built
from tests.runtime.ros2.peer import DOMAINS, Peer, target

for module in ("asyncua", "cyclonedds", "foxglove"):
    pytest.importorskip(module)
pytestmark = pytest.mark.long
SECONDS = 90.0
ATTEMPTS = 4  # a busy computer may hold the simulated sensors up for so long that the machine goes to fault
TURNED = 0.05  # [rad]


class Driver(threading.Thread):
    """Publishes a target ten times a second, whatever the test waits for."""

    def __init__(self, node: Peer) -> None:
        super().__init__(daemon=True)
        self._writer, self._end = node.publisher("/slewright/target", ros2.TARGET), threading.Event()

    def run(self) -> None:
        while not self._end.wait(0.1):
            self._writer.write(target(6.0, y=7.0))

    def close(self) -> None:
        self._end.set()
        self.join()


def drive(rig: Rig, domain: int) -> tuple[set[int], float]:
    """The modes seen, and by how much the machine turned in automatic."""
    node = Peer(domain)
    signals, driver = node.subscribe("/slewright/signals", ros2.SIGNALS), Driver(node)
    driver.start()
    rig.begin()
    end, modes, angles = time.monotonic() + SECONDS, set(), list[float]()
    while time.monotonic() < end and spread(angles) < TURNED and FAULT not in modes:
        rig.step()
        for found in signals.take(10):
            modes.add(int(found.control_mode))
            angles += [found.q_slew] if found.control_mode == AUTOMATIC else []
        time.sleep(0.01)
    driver.close()
    return modes, spread(angles)


def spread(values: list[float]) -> float:
    return max(values, default=0.0) - min(values, default=0.0)


def test_a_ros_2_node_drives_the_machine_and_the_recording_repeats():
    bundle = built("pd")
    for _ in range(ATTEMPTS):
        domain = next(DOMAINS)
        at = Interfaces(free_port(), free_port(), domain, commands=True)
        setting = Setting(
            bundle.folder, load("four_targets_empty"), planner=False, interfaces=at, retain=False
        )
        with Rig(setting) as rig:
            modes, turned = drive(rig, domain)
            rig.statistics()
            result = replay(Recording(rig.recording), ControlCore(bundle))
        assert result.first is None
        if FAULT not in modes:
            assert turned >= TURNED, modes  # towards the target
            assert result.ticks > 100
            return
    pytest.skip("this computer is too busy for the simulated machine to keep its time")
