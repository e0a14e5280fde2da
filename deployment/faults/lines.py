"""What another process says, line by line, without waiting for it."""

import os
import select
import subprocess


class Lines:
    """Lines of a process on its standard output, after those that were read of it before."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        if not process.stdout:
            raise ValueError("a process whose output is no pipe")
        self._from, self._rest = process.stdout, b""
        self.ended = False

    def new(self) -> list[str]:
        """Those that are complete, and new; `ended` once there can be no more."""
        while not self.ended and select.select([self._from], [], [], 0)[0]:
            found = os.read(self._from.fileno(), 4096)
            self.ended = not found
            self._rest += found
        *whole, self._rest = self._rest.split(b"\n")
        return [line.decode(errors="replace").strip() for line in whole]
