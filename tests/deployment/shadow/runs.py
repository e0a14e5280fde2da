"""Runs in shadow mode on the simulated machine, each made once a session."""

import atexit
import shutil
import tempfile
from functools import cache
from pathlib import Path

from deployment.shadow.recorded import Shadowed, read
from deployment.shadow.simulated import Simulated
from specs import scenario
from tests.runtime.bundles import built

TICKS = 1000


@cache
def recorded(which: str = "nominal", valves: bool = False, ticks: int = TICKS) -> tuple[Path, list]:
    """(folder of the recording, what the runtime said on the bus)."""
    folder = Path(tempfile.mkdtemp(prefix="slewright-shadow-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    with Simulated(built("pd"), scenario.load("four_targets_empty"), folder, 2, which, valves) as run:
        run.run(ticks)
        return folder, run.wire.spoken


@cache
def repeated(which: str = "nominal", valves: bool = False, ticks: int = TICKS) -> Shadowed:
    """The same, read and repeated."""
    return read(recorded(which, valves, ticks)[0], built("pd"))
