"""What is carried to another computer: wheels, a bundle for both platforms, and a recording to repeat."""

import sys
from pathlib import Path

import pytest

from deployment.bundling.build import bundle
from deployment.hil.lockstep import lockstep
from deployment.hil.wires import Wires
from runtime.bundle import Bundle
from runtime.control import ControlCore
from runtime.recorder.feed import Feed
from runtime.recorder.recorder import Recorder
from runtime.recorder.replay import identity
from runtime.recorder.segments import Disk, Folder
from runtime.ring import Ring
from runtime.scan import PERIOD_NS
from specs.scenario import load
from specs.version import VERSION
from tests.conftest import ROOT
from tests.install.roots import run

SCENARIO, SEED, TICKS = "four_targets_empty", 1, 1000  # 20 s: the first target, and the way to the second
PLATFORMS = ("x86_64-linux", "aarch64-linux")


def wheelhouse(machine: str, out: Path, *extras: str) -> Path:
    """As `make wheelhouse` fills it; skips where packages cannot be had."""
    script = [sys.executable, str(ROOT / "requirements" / "wheelhouse.py"), "--platform", machine]
    done = run([*script, "--extras", "runtime", *extras, "--out", str(out)])
    if done.returncode:
        pytest.skip(f"no packages: {done.stderr.strip().splitlines()[-1:]}")
    return out


def recorded(into: Path) -> tuple[Bundle, Path]:
    """A bundle for both platforms, and its lock-step drive of the simulated reference machine as recorded."""
    made = bundle("pd", into / "pd", PLATFORMS)
    core, out = ControlCore(made), into / "recording"
    ring = Ring.create(into / "ring", 1 << 24)
    told = {**identity(made.identity, VERSION), "controller": made.controller, "platform": PLATFORMS[0]}
    feed, recorder = Feed(ring), Recorder(ring, Folder(out, 1 << 30), told, 3000, Disk())

    def before(image, tick: int) -> None:
        if tick >= 0:
            feed.before(tick, core)

    def after(image, outputs, tick: int) -> None:
        if tick >= 0:
            feed.tick(image, outputs, (tick * PERIOD_NS, 0, 0, 0, -1))
            recorder.work()

    lockstep(core, load(SCENARIO), SEED, TICKS - 1, change=before, look=after, wires=Wires())
    recorder.close()
    ring.close()
    return made, out
