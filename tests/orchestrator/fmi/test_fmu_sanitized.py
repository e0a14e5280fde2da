"""The tests of the binding once more, binding and FMUs built with address and undefined-behaviour checks."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fmus.toolchain import compiler
from fmus.toolchain.build import BUILD
from orchestrator.core import native
from tests.orchestrator.fuzz.stepper import OPTIONS, RUNTIMES, available

CHECKS = ("-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer")
RUNS = ("model_exchange", "timed_clocks", "scheduled", "connected_clocks")
TESTS = (
    *(f"test_fmu_{name}.py" for name in ("values", "calls", "libraries")),
    *(f"../run/test_{name}.py" for name in RUNS),
)
UNFIT = "not memory"  # the sanitizer has an allocator of its own
CHILD = """
import sys
from pathlib import Path
import pytest
from orchestrator.core import native
library, *arguments = sys.argv[1:]
binaries = native.Binaries(Path(library), Path(library).parent / native.HOST)
native.binaries = lambda: binaries
sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", *arguments]))
"""


def sanitized() -> Path:
    """The core's library with checks, kept by the hash of its sources."""
    folder = BUILD / "tests" / "sanitized" / native.source_hash()[:16]
    done = folder / "complete"
    if not done.exists():
        native.build(folder, extra=CHECKS)
        done.touch()
    return folder / f"{native.LIBRARY}{compiler.host().suffix}"


def runtime(name: str) -> str:
    """Path of a run-time library of the compiler."""
    line = ["cc", f"-print-file-name={name}"]
    return subprocess.run(line, capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.long
@pytest.mark.skipif(not available(), reason="the compiler has no sanitizers")
def test_sanitizers_find_nothing(tmp_path: Path) -> None:
    folder, log = Path(__file__).parent, f":log_path={tmp_path / 'report'}"  # pytest swallows what is printed
    line = [
        sys.executable,
        "-c",
        CHILD,
        str(sanitized()),
        *(str(folder / name) for name in TESTS),
        "-k",
        UNFIT,
    ]
    environment = {
        **os.environ,
        **OPTIONS,
        **{name: OPTIONS[name] + log for name in ("ASAN_OPTIONS", "UBSAN_OPTIONS")},
        "LD_PRELOAD": " ".join(runtime(name) for name in RUNTIMES),
        "SLEWRIGHT_TEST_FLAGS": " ".join(CHECKS),
    }
    done = subprocess.run(
        line, capture_output=True, text=True, check=False, env=environment, cwd=folder.parents[2]
    )
    reports = "".join(path.read_text()[:3000] for path in tmp_path.iterdir())
    assert reports == ""
    assert done.returncode == 0, (done.stdout + done.stderr)[-6000:]
    assert " passed" in done.stdout
