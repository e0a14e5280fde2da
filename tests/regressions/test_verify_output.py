"""What `slewright verify` printed where it should not have, and where it could not."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from records.record import read
from tests.verification.test_verify import ONE


@pytest.mark.long
@pytest.mark.skipif(os.name == "nt", reason="process groups of POSIX")
@pytest.mark.parametrize("wait_s", [0.0, 0.3, 0.6])
def test_ctrl_c_while_the_processes_start_shows_no_traceback(
    root: Path, tmp_path: Path, wait_s: float
) -> None:
    """Ctrl-C reaches the whole process group, also processes that are still importing."""
    line = [sys.executable, "-m", "slewright", "verify", "--out", str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    with subprocess.Popen(
        line, cwd=root, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        assert process.stderr is not None
        while "building reference" not in process.stderr.readline():
            assert process.poll() is None
        time.sleep(wait_s)
        os.killpg(process.pid, signal.SIGINT)
        said = process.stderr.read()
    assert process.returncode == 130
    assert "Traceback" not in said
    for path in (tmp_path / "records").glob("*.parquet"):
        read(path)


def test_a_log_that_knows_ascii_only_gets_the_table(root: Path, tmp_path: Path) -> None:
    line = [sys.executable, "-m", "slewright", "verify", *ONE, "--out", str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": str(root), "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(line, cwd=root, env=environment, capture_output=True, check=False)
    assert done.returncode in (0, 1), done.stderr.decode()
    assert b"four_targets_unknown" in done.stdout
