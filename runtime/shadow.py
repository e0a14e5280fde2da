"""Shadow mode: the runtime reads the machine, computes everything and commands nothing; an operator drives.

Two locks keep it quiet: no port has a way out (`Listener`), and the bus itself refuses to send
(`runtime.can.port.mute`).  Modbus shows every command as not available, so that nobody who reads it there
moves anything either.

The core runs as in automatic operation.  For that an operator stands in (`StandIn`) for the one who drives:
hands off the joystick, enabling switch and automatic switch pressed whenever the core waits for them, a fault
acknowledged as soon as its cause has gone.  The machine's readiness, its emergency stop, sensors and targets
are the real ones.  `/tick` of the recording is what the core was given and gave, so a replay repeats it bit
for bit; what the real operator did is beside it in `/operator`, as it came.
"""

from collections.abc import Iterable

import numpy as np

from runtime.can.codec import Codec, sent_by
from runtime.can.receive import Receiver
from runtime.image import INPUT, NODE, OUTPUT, Flag, Status
from runtime.protocols import Port
from runtime.recorder.feed import Feed
from runtime.recorder.seen import JOYSTICK, SEEN, SWITCHES, VALVES, new
from specs.signals import signal

COMMANDS = ("u_slew", "u_boom", "u_stick", "qd_boom_ref", "qd_stick_ref", "control_enable")
MODES = {text: number for number, text in signal("control_mode").values.items()}
WAITS_FOR_ENABLE = (MODES["standby"], MODES["fault"])
HEARTBEATS = 251
OTHER = int(Flag.OTHER_CONTROLLER)


class Listener:
    """A port of the scan without its way out."""

    def __init__(self, port: Port) -> None:
        self.receive, self.received_ns, self._flags = port.receive, port.received_ns, port.flags

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """Nothing."""

    def flags(self) -> int:
        """Those of the port, but that somebody else moves the valves: in shadow mode that is meant to be."""
        return self._flags() & ~OTHER


class Withheld:
    """A port that shows outputs, with the commands among them as not available."""

    def __init__(self, port: Port) -> None:
        self.receive, self.flags, self.received_ns = port.receive, port.flags, port.received_ns
        self._port, self._shown = port, OUTPUT.new()
        self._places = [OUTPUT.at(name) for name in COMMANDS]

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """Show all but the commands."""
        self._shown[...] = outputs
        self._shown["value"][self._places] = 0.0
        self._shown["status"][self._places] = Status.NOT_AVAILABLE
        self._port.send(self._shown, tick)


class Overheard:
    """Valve commands that somebody else sends to the machine: a reader of `runtime.can.native.NativePort`."""

    def __init__(self) -> None:
        heard = [c for c in sent_by(NODE) if _moves_valves(c)]
        names = [f.name for c in heard for f in c.fields]
        self.index = {name: i for i, name in enumerate(names)}
        self._receiver = Receiver(heard, self.index)
        n = len(names)
        self.image = np.zeros((), [("value", "<f8", (n,)), ("age", "<i4", (n,)), ("status", "u1", (n,))])
        self._receiver.fill(self.image, 0)

    def take(self, frame_id: int, data: bytes, tick: int) -> bool:
        """Take a frame; False if it is not one of these."""
        return self._receiver.take(frame_id, data, tick)

    def fill(self, image: np.ndarray, tick: int) -> None:
        """Keep what is known at `tick`; the controller's image has no place for it."""
        self._receiver.fill(self.image, tick)


class StandIn:
    """The operator that the core sees; the last port of a scan, so that what it says stands."""

    def __init__(self, overheard: Overheard, feed: Feed | None = None) -> None:
        self._overheard, self._feed = overheard, feed
        self._mode, self._enable, self._request = MODES["off"], False, False
        self._heard = [INPUT.at(name) for name in (*JOYSTICK, *SWITCHES)]
        self._there = [overheard.index[name] for name in VALVES]
        self._own = {name: INPUT.at(name) for name in (*SWITCHES, "operator_heartbeat")}
        self._hands = [INPUT.at(name) for name in JOYSTICK]
        self.seen = new()

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """Keep what the real operator does, and put a calm one in that place."""
        self._keep(inputs, tick)
        self._press()
        says = {
            "operator_enable": self._enable, "automatic_request": self._request,
            "automatic_allowed": True, "operator_heartbeat": tick % HEARTBEATS,
        }  # fmt: skip
        places = [*self._hands, *(self._own[n] for n in says)]
        inputs["value"][places] = [0.0] * len(self._hands) + [float(v) for v in says.values()]
        inputs["age"][places], inputs["status"][places] = 0, Status.OK

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """See in which mode the core is; record what was seen."""
        self._mode = int(outputs["value"][OUTPUT.index["control_mode"]])
        if self._feed:
            self._feed.ring.put(SEEN, self.seen.tobytes())

    def flags(self) -> int:
        """None."""
        return 0

    def received_ns(self) -> int:
        """No sensor comes this way."""
        return 0

    def _keep(self, inputs: np.ndarray, tick: int) -> None:
        seen, heard = self.seen, self._overheard.image
        first = len(self._heard)
        seen["tick"] = tick
        for part in ("value", "age", "status"):
            seen[part][:first] = inputs[part][self._heard]
            seen[part][first:] = heard[part][self._there]

    def _press(self) -> None:
        """A switch counts when it is pressed anew: let go for a tick, then pressed."""
        mode = self._mode
        self._enable = not self._enable if mode in WAITS_FOR_ENABLE else mode != MODES["off"]
        wanted = mode in (MODES["automatic"], MODES["hold"])
        self._request = not self._request if mode == MODES["armed"] else wanted


def silent(
    ports: Iterable[Port], shown: type | tuple[type, ...], hidden: type, stand_in: StandIn
) -> list[Port]:
    """Ports of a scan in shadow mode: those of class `hidden` listen, those of `shown` withhold commands."""
    found: list[Port] = []
    for port in ports:
        found.append(Listener(port) if isinstance(port, hidden) else port)
        if isinstance(port, shown):
            found[-1] = Withheld(port)
    return [*found, stand_in]


def _moves_valves(codec: Codec) -> bool:
    return any(f.name in VALVES for f in codec.fields)
