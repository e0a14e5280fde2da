"""The CAN bus in lock-step: every value of a tick goes through its frame, both ways; no bus, no time."""

from collections.abc import Sequence

import numpy as np

from deployment.hil.machine import COMMANDS
from runtime.can.codec import Codec, received_by
from runtime.can.receive import Receiver
from runtime.can.transmit import Transmitter
from runtime.image import INPUT, NODE, OUTPUT
from specs.signals import definition

FIRST = 100  # ticks before the scenario at which the wires begin: the slowest message has come by then


class Wires:
    """Codes the input images of a lock-step run, and the commands back."""

    def __init__(self) -> None:
        nodes = definition().bus.nodes
        heard = received_by(NODE)
        self._senders = [Transmitter(n, INPUT.index) for n in nodes if n != NODE and _speaks(n, heard)]
        self._inputs = Receiver(heard, INPUT.index)
        told = [c for c in received_by("Machine") if c.message.sender == NODE]
        self._own = Transmitter(NODE, OUTPUT.index)
        self._commands = Receiver(told, OUTPUT.index)
        self._image = OUTPUT.new()
        self._begun = False

    def bring(self, image: np.ndarray, tick: int) -> None:
        """Replace an input image by what its frames, and those before, say of it."""
        values = image["value"].tolist()
        if not self._begun:
            for early in range(-FIRST, tick):
                self._send(_resting(values), early)
            self._begun = True
        self._send(values, tick)
        self._inputs.fill(image, tick + FIRST)

    def commands(self, outputs: np.ndarray, tick: int) -> dict[str, float]:
        """What arrives at the valves."""
        for frame_id, data in self._own.due(outputs["value"].tolist(), tick + FIRST):
            self._commands.take(frame_id, data, tick + FIRST)
        self._commands.fill(self._image, tick + FIRST)
        return {n: float(self._image["value"][OUTPUT.index[n]]) for n in COMMANDS}

    def _send(self, values: Sequence[float], tick: int) -> None:
        for sender in self._senders:
            for frame_id, data in sender.due(values, tick + FIRST):
                self._inputs.take(frame_id, data, tick + FIRST)


def _resting(values: Sequence[float]) -> list[float]:
    """The same without the operator's switch."""
    found = list(values)
    found[INPUT.index["operator_enable"]] = 0.0
    return found


def _speaks(node: str, heard: Sequence[Codec]) -> bool:
    """Whether the controller hears anything of a node."""
    return any(c.message.sender == node for c in heard)
