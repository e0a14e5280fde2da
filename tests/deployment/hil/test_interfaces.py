"""A ROS 2 node drives the simulated machine in real time; the recording repeats bit for bit."""

import time

import pytest

from deployment.hil.rig import Interfaces, Rig, Setting, free_port
from runtime.control import ControlCore
from runtime.recorder.reader import Recording
from runtime.recorder.replay import replay
from specs import ros2
from specs.scenario import load
from tests.runtime.bench import AUTOMATIC
from tests.runtime.bundles import built
from tests.runtime.ros2.peer import DOMAINS, Peer, target

for module in ("asyncua", "cyclonedds", "foxglove"):
    pytest.importorskip(module)
pytestmark = pytest.mark.slow
SECONDS = 90.0


def test_a_ros_2_node_drives_the_machine_and_the_recording_repeats():
    domain = next(DOMAINS)
    at = Interfaces(free_port(), free_port(), domain, commands=True)
    bundle = built("pd")
    scenario = load("four_targets_empty")
    with Rig(Setting(bundle.folder, scenario, planner=False, interfaces=at, retain=False)) as rig:
        node = Peer(domain)
        writer = node.publisher("/slewright/target", ros2.TARGET)
        signals = node.subscribe("/slewright/signals", ros2.SIGNALS)
        rig.begin()
        end, modes, angles, sent = time.monotonic() + SECONDS, set(), [], 0.0
        while time.monotonic() < end and (len(angles) < 2 or max(angles) - min(angles) < 0.05):
            if time.monotonic() - sent >= 0.1:
                sent = time.monotonic()
                writer.write(target(6.0, y=7.0))
            rig.step()
            for found in signals.take(10):
                modes.add(int(found.control_mode))
                angles += [found.q_slew] if found.control_mode == AUTOMATIC else []
            time.sleep(0.01)
        assert AUTOMATIC in modes
        assert max(angles) - min(angles) >= 0.05  # it turns towards the target
        rig.statistics()
        result = replay(Recording(rig.recording), ControlCore(bundle))
    assert result.first is None
    assert result.ticks > 100
