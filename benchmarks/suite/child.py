"""The process that answers: it is given recordings and plain model, nothing else, and is timed."""

import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

LIMIT_S = 1800.0  # of wall-clock time, after which it counts as failed
KEPT = ("PATH", "HOME", "LANG", "TMPDIR", "CC", "LD_LIBRARY_PATH", "SYSTEMROOT")  # of the environment


@dataclass(frozen=True)
class Ended:
    """How a child ended: exit code, core seconds (user and system, its own children's too), last words."""

    code: int
    seconds: float
    said: str


def run(arguments: Sequence[str], folder: Path, limit_s: float = LIMIT_S) -> Ended:
    """Run `python ARGUMENTS` in `folder`; on KeyboardInterrupt it is ended too."""
    environment = {k: v for k in KEPT if (v := os.environ.get(k)) is not None}
    # one core each: cases share the machine, and seconds are core seconds
    environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONUTF8": "1"}
    environment["PYTHONPATH"] = os.pathsep.join(p for p in sys.path if p and Path(p).is_dir())
    log = folder / "child.log"
    with log.open("wb") as stream:
        process = subprocess.Popen(
            [sys.executable, *arguments], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
            stdout=stream, stderr=subprocess.STDOUT,
        )  # fmt: skip
        timer = threading.Timer(limit_s, process.kill)
        timer.start()
        try:
            code, seconds = _wait(process)
        except BaseException:
            process.kill()
            process.wait()
            raise
        finally:
            timer.cancel()
    lines = log.read_text(errors="replace").strip().splitlines()
    return Ended(code, seconds, lines[-1] if lines else "")


def _wait(process: subprocess.Popen) -> tuple[int, float]:
    """Exit code and core seconds of a process, waited for."""
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, usage.ru_utime + usage.ru_stime
