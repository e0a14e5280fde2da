"""Keeps DDS on this computer: one interface, no multicast, and sockets that hear nothing else.

Cyclone sends from the loopback address, which the kernel lets out on no other interface; but it would receive
on all of them.  So every UDP socket is bound to the loopback device as well, and what is not is refused.
"""

import os
import socket
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from specs.errors import InputError

DEVICE = b"lo\0"
PARTICIPANTS = 32  # that peers look for on this computer, as ROS 2 does
SETTINGS = f"""<CycloneDDS><Domain Id="any">
<General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
<AllowMulticast>false</AllowMulticast><MaxMessageSize>14720B</MaxMessageSize></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>{PARTICIPANTS}</MaxAutoParticipantIndex>
<Peers><Peer Address="127.0.0.1"/></Peers></Discovery>
<Internal><SocketReceiveBufferSize max="1MB"/></Internal>
<Tracing><Verbosity>none</Verbosity></Tracing>
</Domain></CycloneDDS>"""


def settings() -> None:
    """Have Cyclone read these settings, and no others; before its first participant."""
    os.environ["CYCLONEDDS_URI"] = SETTINGS


def confine() -> int:
    """Bind every UDP socket of this process to the loopback device; how many. InputError if one cannot be."""
    if not sys.platform.startswith("linux"):
        raise InputError("ros2: only Linux can keep its sockets to this computer")
    found = 0
    for end in _sockets():
        try:
            if end.getsockname()[0] != "127.0.0.1":
                end.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, DEVICE)
        except OSError as error:
            raise InputError(f"ros2: a socket cannot be kept to this computer: {error.strerror}") from None
        finally:
            end.close()
        found += 1
    return found


def open_to_others() -> list[tuple[str, int]]:
    """Addresses of UDP sockets that would hear other computers."""
    found = []
    for end in _sockets():
        address = end.getsockname()
        bound = end.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16).rstrip(b"\0")
        if address[0] != "127.0.0.1" and bound != DEVICE.rstrip(b"\0"):
            found.append((address[0], address[1]))
        end.close()
    return found


def _sockets() -> Iterator[socket.socket]:
    """The process's UDP sockets, as copies to be closed."""
    for name in os.listdir("/proc/self/fd"):  # noqa: PTH208 - the folder changes while it is read
        with suppress(OSError):
            if str(Path(f"/proc/self/fd/{name}").readlink()).startswith("socket:"):
                end = socket.socket(fileno=os.dup(int(name)))
                if end.family == socket.AF_INET and end.type == socket.SOCK_DGRAM:
                    yield end
                else:
                    end.close()
