"""The processes beside the control process: started before it, watched, started again, ended last."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

from runtime.child import die_with_parent
from specs.errors import InputError

END_S = 5.0  # how long a helper may take to finish its files
ROOT = Path(__file__).resolve().parent.parent
_told: list[int] = []


def end_with(number: int) -> None:
    """End at this signal, and with the parent; leave Ctrl-C, which all processes get, to the parent."""
    signal.signal(number, _note)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    die_with_parent(number)


def run(main: Callable[[str], None]) -> None:
    """Run a process's `main` with its argument: wrong input is one line and exit code 2."""
    try:
        main(sys.argv[1])
    except InputError as error:
        sys.stderr.write(f"slewright: {error}\n")
        sys.exit(2)


def told_to_end() -> bool:
    """True once the signal came."""
    return bool(_told)


@dataclass
class Helper:
    """A process of ours: `python -m MODULE JSON`."""

    name: str
    module: str
    told: Mapping[str, Any]
    folder: Path | None = None  # the run's shared memory
    starts: int = 0
    process: subprocess.Popen[bytes] | None = field(default=None, repr=False)

    def start(self) -> None:
        """Start it, away from the terminal's input (runtime/child.py)."""
        whose = [str(os.getpid()), str(self.folder or "")]
        command = [sys.executable, "-m", "runtime.child", *whose, self.module, json.dumps(self.told)]
        self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, cwd=ROOT)
        self.starts += 1

    @property
    def pid(self) -> int:
        """Of the running process; 0 if there is none."""
        return self.process.pid if self.process else 0

    def ended(self) -> int | None:
        """Its exit code, None while it runs."""
        return self.process.poll() if self.process else 0

    def end(self) -> int:
        """Let it finish, or kill it when it does not; its exit code."""
        if self.process is None:
            return 0
        if self.process.poll() is None:
            self.process.terminate()
        try:
            return self.process.wait(END_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.wait()


def _note(number: int, _: FrameType | None) -> None:
    _told.append(number)
