"""A recording read by the code that web viewers read MCAP with, which shares nothing with ours.

SLEWRIGHT_NODE names a folder with node_modules (npm install @mcap/core @mcap/nodejs @mcap/support).
"""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from runtime.image import INPUT
from runtime.recorder.feed import TIMING
from runtime.recorder.reader import Recording, Tick
from tests.runtime.core.test_replay_core import recorded

FOLDER = os.environ.get("SLEWRIGHT_NODE", "")
READER = Path(__file__).with_name("read.mjs")


@pytest.mark.skipif(not shutil.which("node"), reason="node is not installed")
@pytest.mark.skipif(not FOLDER, reason="SLEWRIGHT_NODE names no folder with @mcap/core")
def test_every_tick_and_its_values_are_there(tmp_path: Path) -> None:
    path, _ = recorded(tmp_path, 1200)
    (segment,) = path.glob("*.mcap")
    done = subprocess.run(
        ["node", str(READER), FOLDER, str(segment)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    entries = [item.entry for item in Recording(path).items() if isinstance(item, Tick)]
    images = [np.frombuffer(entry, INPUT.dtype, 1, TIMING.size)[0] for entry in entries]
    total = 0.0
    for image in images:
        total += float(image["value"][INPUT.index["q_slew"]])
    found = json.loads(done.stdout)
    assert found == {"counts": {"/tick": 1200, "/snapshot": 3}, "sum": total}
