"""The simulated machine alone on a bus, for a controller that was started by itself (`slewright run`).

Its operator is simulated, too: he presses his switches anew whenever the controller waits for them, so that
targets from Modbus are all that is missing.  Lines on the input set signals by hand, for as long as they are
not taken back: `joystick_slew 0.4`, `emergency_stop 1`; a name alone takes it back.
"""

import os
import select
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from subprocess import Popen

import can

from deployment.hil.canopen_devices import Devices
from deployment.hil.machine_node import NODES, MachineNode, beats
from deployment.hil.rig import BUS_PRIORITY, MACHINE_PRIORITY, prefer
from runtime.can.busd import start_bus
from runtime.can.port import open_bus
from runtime.configuration import LOCAL_BUS
from specs.canopen import definition as devices_on
from specs.errors import InputError, nearest
from specs.scenario import TICK_S
from specs.signals import definition, signal, signals

PRESS_S = 0.5  # s, that a switch is off before it is pressed, and then on before it is pressed anew
ACKNOWLEDGE_S = 2.0  # s, that a fault is looked at first
MODES = {text: number for number, text in signal("control_mode").values.items()}
WAITING = tuple(MODES[n] for n in ("standby", "fault"))  # for the enabling switch
SWITCHES = ("operator_enable", "automatic_request")
DRIVING = tuple(MODES[n] for n in ("automatic", "hold"))
Say = Callable[[str], None]


@dataclass
class Operator:
    """Two switches, pressed anew when the controller's mode waits for that; one call a tick."""

    mode: int = MODES["off"]
    _ticks: int = 0  # in this mode

    def switches(self, mode: int) -> dict[str, float]:
        """What they are at, now that the controller says `mode`."""
        self._ticks = self._ticks + 1 if mode == self.mode else 0
        self.mode = mode
        pressed = self._pressed(ACKNOWLEDGE_S if mode == MODES["fault"] else PRESS_S)
        enable = pressed if mode in WAITING else mode != MODES["off"]
        request = pressed if mode == MODES["armed"] else mode in DRIVING
        return dict(zip(SWITCHES, (float(enable), float(request)), strict=True))

    def _pressed(self, off_s: float) -> bool:
        """Off first, then on; and again, for nothing may have come of it."""
        return self._ticks * TICK_S % (off_s + PRESS_S) >= off_s


@dataclass
class ByHand:
    """Signals that lines on the input have set."""

    values: dict[str, float] = field(default_factory=dict)

    def take(self, line: str) -> str:
        """Obey a line; what to answer."""
        name, _, text = line.strip().partition(" ")
        sent = sorted(s.name for s in signals().values() if s.can and sender(s.name) in NODES)
        if name not in sent:
            return f"no signal '{name}' that the machine or its operator sends; {nearest(name, sent)}"
        if not text.strip():
            self.values.pop(name, None)
            return f"{name} by itself again"
        try:
            value = float(text)
        except ValueError:
            return f"{name}: '{text.strip()}' is no number"
        if not isfinite(value):
            return f"{name}: {value} is no number that a frame could carry"
        self.values[name] = value
        return f"{name} {value:g} until '{name}' alone takes it back"


def sender(name: str) -> str:
    """The node whose message carries a signal on CAN."""
    place = signal(name).can
    return definition().bus.messages[place.message].sender if place else ""


class MachineOnBus:
    """The machine on its bus; a context, which ends the bus if it made it."""

    def __init__(self, interface: str, channel: str, rate: int = 0, node: str = "Machine") -> None:
        """Join the bus, after making it if it is a local one that nobody has made; `rate` 0: the specs'."""
        self._made: Popen[bytes] | None = None
        rate = rate or definition().bus.bit_rate
        if interface == LOCAL_BUS and not _answers(Path(channel), rate):
            Path(channel).unlink(missing_ok=True)
            self._made = start_bus(Path(channel), rate)
            prefer(self._made.pid, BUS_PRIORITY)
        self.bus: can.BusABC = open_bus(interface, channel, rate, node)

    def __enter__(self) -> "MachineOnBus":
        prefer(os.getpid(), MACHINE_PRIORITY)
        return self

    def __exit__(self, *about: object) -> None:
        prefer(os.getpid(), 0)
        self.bus.shutdown()
        if self._made:
            self._made.terminate()
            self._made.wait()


@contextmanager
def devices(interface: str, channel: str) -> Iterator[Devices]:
    """The machine's CANopen devices on their bus."""
    rate = devices_on().bus.bit_rate
    with MachineOnBus(interface, channel, rate, "Devices") as end, Devices(end.bus) as found:
        yield found


def _answers(path: Path, rate: int) -> bool:
    """Whether there is a bus; a socket that nobody answers at was left behind."""
    if not path.exists():
        return False
    if not path.is_socket():
        raise InputError(f"{path} is there already, and no local bus")
    try:
        open_bus(LOCAL_BUS, str(path), rate, "").shutdown()
    except InputError:
        return False
    return True


def drive(node: MachineNode, ticks: int | None, say: Say, operator: Operator | None) -> None:
    """Let the machine live for so many ticks (None: for ever)."""
    by_hand, lines, shown = ByHand(), Lines(), ""
    for beat, _ in beats():
        if ticks is not None and beat >= ticks:
            break
        for line in lines.come():
            say(by_hand.take(line))
        node.listen(beat, time.monotonic_ns())
        node.panel.over = dict.fromkeys(SWITCHES, 0.0)
        if operator:
            node.panel.over |= operator.switches(_mode(node))
        node.panel.over |= by_hand.values
        node.tick(beat, beat)
        node.rows.clear()  # nothing is recorded: the controller does that
        if (found := state(node)) != shown:
            shown = found
            say(f"{beat * TICK_S:.1f} s: {shown}")


def _mode(node: MachineNode) -> int:
    return int(node.valves.value("control_mode")) if node.valves.heard else MODES["off"]


def state(node: MachineNode) -> str:
    """What the controller says that it does."""
    if not node.valves.heard:
        return "no controller"
    mode, fault = (int(node.valves.value(n)) for n in ("control_mode", "fault_code"))
    why = f", {signal('fault_code').values.get(fault, fault)}" if fault else ""
    return f"controller in {signal('control_mode').values.get(mode, mode)}{why}"


class Lines:
    """Whole lines that stand on the input; a job in the background leaves the terminal to others."""

    def __init__(self, end: int = 0) -> None:
        self._end, self._open, self._begun = end, True, b""

    def come(self) -> list[str]:
        """Those that came since; never waits."""
        if not self._open or not self._ours() or not select.select([self._end], [], [], 0)[0]:
            return []
        data = os.read(self._end, 4096)
        self._open = bool(data)
        *whole, self._begun = (self._begun + data).split(b"\n")
        return [line.decode(errors="replace").strip() for line in whole if line.strip()]

    def _ours(self) -> bool:
        return not os.isatty(self._end) or os.tcgetpgrp(self._end) == os.getpgrp()
