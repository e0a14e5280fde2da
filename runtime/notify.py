"""What the service manager is told: that the controller works, and, as long as it does, again and again.

The protocol is sd_notify(3): lines in datagrams to the socket that NOTIFY_SOCKET names.  Without one nothing
is said.  The watchdog is fed only when the control process has gone on since the last time, so that a cycle
that hangs ends the service; nothing starts it again (runtime/systemd).
"""

import os
import socket
from collections.abc import MutableMapping
from contextlib import suppress

SOCKET, PROCESS = "NOTIFY_SOCKET", ("WATCHDOG_PID", "WATCHDOG_USEC")


class Notifier:
    """The way to the service manager that started this process, if one did."""

    def __init__(self, address: str = "") -> None:
        self._socket: socket.socket | None = None
        self._seen = 0  # ticks of the control process when the watchdog was fed last
        if address:
            # "@" stands for the zero byte with which an abstract address begins
            self._address = "\0" + address[1:] if address.startswith("@") else address
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.setblocking(False)

    @classmethod
    def of(cls, environment: MutableMapping[str, str] = os.environ) -> "Notifier":
        """The one that the environment names; taken out of it, so that no helper speaks for this process."""
        for name in PROCESS:
            environment.pop(name, None)
        return cls(environment.pop(SOCKET, ""))

    def ticked(self, ticks: int, status: str) -> None:
        """The control process has made `ticks` cycles; the first news of any means that it is ready."""
        if ticks <= self._seen:
            return
        first, self._seen = not self._seen, ticks
        self._say(*(["READY=1"] if first else []), "WATCHDOG=1", f"STATUS={status}")

    def ending(self) -> None:
        """This process is about to end: it may take a while until all files are whole."""
        self._say("STOPPING=1")

    def close(self) -> None:
        """Say nothing more."""
        if self._socket:
            self._socket.close()
            self._socket = None

    def _say(self, *lines: str) -> None:
        if self._socket:
            with suppress(OSError):  # nobody there, or too busy: what matters will be said again
                self._socket.sendto("\n".join(lines).encode(), self._address)
