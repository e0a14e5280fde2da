"""What goes out: a node's messages, each in its cycle, the most urgent first, counted and protected."""

from collections.abc import Mapping, Sequence

from runtime.can.codec import Codec, sent_by
from runtime.image import TICK_S
from specs.e2e import LAST_COUNT


class _Outbox:
    """One message, its next count and the ticks it is sent in."""

    def __init__(self, codec: Codec, places: list[int], phase: int) -> None:
        self.codec, self.places = codec, places
        self.every = max(1, round(codec.message.cycle_ms / 1000 / TICK_S))
        self.phase, self.count = phase % self.every, 0


class Transmitter:
    """The frames that a node sends in a tick.

    Messages of a slower cycle take turns, so that they do not all come in one tick; the order of their
    identifiers stays (TargetPosition before TargetTask).
    """

    def __init__(self, node: str, index: Mapping[str, int]) -> None:
        self._outboxes = []
        for codec in sent_by(node):
            slower = sum(box.every > 1 for box in self._outboxes)
            self._outboxes.append(_Outbox(codec, [index[f.name] for f in codec.fields], slower))

    def due(self, values: Sequence[float], tick: int) -> list[tuple[int, bytes]]:
        """Identifier and data of the frames of this tick; `values` [SI] by the index given at the start."""
        frames = []
        for box in self._outboxes:
            if tick % box.every == box.phase:
                data = box.codec.pack([values[place] for place in box.places], box.count)
                box.count = 0 if box.count == LAST_COUNT else box.count + 1
                frames.append((box.codec.message.frame_id, data))
        return frames
