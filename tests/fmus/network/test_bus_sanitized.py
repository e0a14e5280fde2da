"""The tests of the bus FMU once more, its C compiled with address and undefined-behaviour checks."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.orchestrator.fmi.test_fmu_sanitized import CHECKS, runtime
from tests.orchestrator.fuzz.stepper import OPTIONS, RUNTIMES, available

CHILD = """
import sys
import pytest
from fmus.toolchain import compiler
from orchestrator.core.binding import library
library()  # the core as it is; only FMUs are compiled with checks
compiler.FLAGS += sys.argv[1].split()
sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", "-p", "no:xdist", sys.argv[2]]))
"""


@pytest.mark.long
@pytest.mark.skipif(not available(), reason="the compiler has no sanitizers")
def test_sanitizers_find_nothing(tmp_path: Path) -> None:
    test, log = Path(__file__).with_name("test_bus.py"), f":log_path={tmp_path / 'report'}"
    line = [sys.executable, "-c", CHILD, " ".join(CHECKS), str(test)]
    told = {name: OPTIONS[name] + log for name in ("ASAN_OPTIONS", "UBSAN_OPTIONS")}
    preloaded = {"LD_PRELOAD": " ".join(runtime(name) for name in RUNTIMES)}
    environment = {**os.environ, **OPTIONS, **told, **preloaded}
    done = subprocess.run(line, env=environment, capture_output=True, text=True, check=False)
    reports = "\n".join(path.read_text() for path in tmp_path.glob("report*"))
    assert done.returncode == 0, f"{done.stdout[-2000:]}\n{done.stderr[-1000:]}\n{reports[:4000]}"
    assert "passed" in done.stdout
