"""A policy in a ROS 2 node of its own process drives the simulated machine, and is killed."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from deployment.bundling.default import drives_itself
from deployment.hil.rig import Interfaces, Rig, Setting, free_port
from runtime.control import ControlCore
from runtime.interfaces.outside import COMMANDS
from runtime.interfaces.view import INDEX, Seen, View
from runtime.recorder.reader import Recording
from runtime.recorder.replay import replay
from specs.errors import InputError
from specs.scenario import load
from tests.conftest import ROOT
from tests.runtime.bench import AUTOMATIC, FAULT, FAULTS
from tests.runtime.bundles import built
from tests.runtime.ros2.peer import DOMAINS

for module in ("asyncua", "cyclonedds", "foxglove", "onnxruntime"):
    pytest.importorskip(module)
pytestmark = pytest.mark.long
NODE, POLICY = "/swing/policy", "learning/policies/full.onnx"
ATTEMPTS, SECONDS, TURNED = 4, 60.0, 0.05
AXES = ("u_slew", "u_boom", "u_stick")


@contextmanager
def policy(domain: int) -> Iterator[subprocess.Popen[bytes]]:
    """The example, in a process of its own."""
    command = [sys.executable, "examples/nodes/ros2_policy.py", POLICY, str(domain)]
    process = subprocess.Popen(command, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)})
    try:
        yield process
    finally:
        process.kill()
        process.wait()


class Watched:
    """A rig, and what its control process publishes."""

    def __init__(self, rig: Rig) -> None:
        self._rig, self._view = rig, View.join(rig.shared)
        self.angles: list[float] = []
        self.moved = False

    def until(self, true: Callable[[Seen], bool]) -> Seen | None:
        """The images for which something is true; None if that did not come."""
        end = time.monotonic() + SECONDS
        while time.monotonic() < end:
            self._rig.step()
            if seen := self._view.new():
                if seen.of("control_mode") == AUTOMATIC:
                    self.angles.append(seen.of("q_slew"))
                if true(seen):
                    return seen
            time.sleep(0.005)
        return None

    def turned(self, seen: Seen) -> bool:
        """Whether the policy turned the machine, or it stopped."""
        far = max(self.angles, default=0.0) - min(self.angles, default=0.0)
        return far >= TURNED or seen.of("control_mode") == FAULT


def test_what_brings_no_policy_refuses_its_bundle():
    with pytest.raises(InputError, match="its controller is a policy outside, and here is none"):
        drives_itself(built("outside").folder, lambda what, done=None, total=None: None)


def test_a_policy_in_another_process_drives_and_its_loss_stops_the_machine():
    bundle = built("outside")
    for _ in range(ATTEMPTS):
        domain = next(DOMAINS)
        at = Interfaces(free_port(), free_port(), domain, policy=NODE)
        setting = Setting(bundle.folder, load("four_targets_empty"), interfaces=at, retain=False)
        with Rig(setting) as rig, policy(domain) as node:
            watched = Watched(rig)
            assert watched.until(lambda seen: all(seen.status[INDEX[s.name]] == 0 for s in COMMANDS))
            rig.begin()
            driving = watched.until(watched.turned)
            assert driving
            if driving.of("control_mode") == AUTOMATIC:
                node.kill()
                stopped = watched.until(lambda seen: seen.of("control_mode") == FAULT)
                assert stopped
                assert stopped.of("fault_code") == FAULTS["policy_timeout"]
                assert watched.until(lambda seen: not any(seen.of(name) for name in AXES))
            rig.statistics()
            assert replay(Recording(rig.recording), ControlCore(bundle)).first is None
        if driving.of("control_mode") == AUTOMATIC:
            return
    pytest.skip("this computer is too busy for the simulated machine to keep its time")
