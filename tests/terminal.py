"""The command at a terminal: a pseudo terminal with somebody who reads, types and presses Ctrl-C."""

import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from tests.conftest import ROOT

PATIENCE_S = 120.0
CTRL_C = "\x03"
CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\r")  # colours, movements of the cursor


class Terminal:
    """`slewright` with these arguments at a terminal of its own; a context, which ends it."""

    def __init__(self, *arguments: str | Path, cwd: Path = ROOT) -> None:
        plain = {"PYTHONPATH": str(ROOT), "NO_COLOR": "1", "COLUMNS": "200", "TERM": "xterm"}
        self._ours, theirs = pty.openpty()
        # A session of its own, so that the terminal can become its controlling one and Ctrl-C a signal.
        line = [sys.executable, "-c", START, *map(str, arguments)]
        self.process = subprocess.Popen(
            line, cwd=cwd, env={**os.environ, **plain}, stdin=theirs, stdout=theirs, stderr=theirs
        )
        os.close(theirs)
        self.said = ""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            try:
                self.process.wait(10.0)
            except subprocess.TimeoutExpired:
                self.process.kill()
        self.process.wait()
        os.close(self._ours)

    def until(self, pattern: str, seconds: float = PATIENCE_S) -> re.Match[str]:
        """Read until this was said after what was found last; AssertionError if it never is."""
        end = time.monotonic() + seconds
        while (found := re.search(pattern, self.said)) is None:
            assert time.monotonic() < end, f"waited for '{pattern}': {self.said}"
            assert self._read(0.2), f"ended without '{pattern}': {self.said}"
        self.said = self.said[found.end() :]
        return found

    def type(self, text: str) -> None:
        """Keys; Enter is a new line."""
        os.write(self._ours, text.encode())

    def ends(self, seconds: float = PATIENCE_S) -> int:
        """Read to the end; the exit code."""
        end = time.monotonic() + seconds
        while self._read(0.2):
            assert time.monotonic() < end, f"does not end: {self.said}"
        return self.process.wait(max(1.0, end - time.monotonic()))

    def _read(self, seconds: float) -> bool:
        """Take what comes within some time; False at the end."""
        if not select.select([self._ours], [], [], seconds)[0]:
            return True
        try:
            data = os.read(self._ours, 65536)
        except OSError:  # how Linux says that nobody has the other end any more
            return False
        self.said += CONTROL.sub("", data.decode(errors="replace"))
        return bool(data)


# SIGINT may have been ignored by whoever started the tests in the background.
START = """
import fcntl, os, signal, sys, termios
os.setsid()
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
signal.signal(signal.SIGINT, signal.default_int_handler)
from slewright.__main__ import main
main(sys.argv[1:])
"""
