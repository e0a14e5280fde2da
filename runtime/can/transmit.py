"""What goes out: a node's messages, each in its cycle, the most urgent first, counted and protected."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from runtime.can.codec import Codec, sent_by
from specs.e2e import LAST_COUNT


class Turn(NamedTuple):
    """A message is sent in the ticks that are `phase` modulo `every`."""

    codec: Codec
    every: int
    phase: int


def turns(node: str) -> list[Turn]:
    """When a node sends its messages, the most urgent first.

    Messages of a slower cycle take turns, so that they do not all come in one tick; the order of their
    identifiers stays (TargetPosition before TargetTask).
    """
    found: list[Turn] = []
    for codec in sent_by(node):
        slower = sum(turn.every > 1 for turn in found)
        found.append(Turn(codec, codec.cycle_ticks, slower % codec.cycle_ticks))
    return found


class _Outbox:
    """One message and its next count."""

    def __init__(self, turn: Turn, places: list[int]) -> None:
        self.codec, self.every, self.phase = turn
        self.places, self.count = places, 0


class Transmitter:
    """The frames that a node sends in a tick."""

    def __init__(self, node: str, index: Mapping[str, int]) -> None:
        self._outboxes = [_Outbox(turn, [index[f.name] for f in turn.codec.fields]) for turn in turns(node)]

    def due(self, values: Sequence[float], tick: int) -> list[tuple[int, bytes]]:
        """Identifier and data of the frames of this tick; `values` [SI] by the index given at the start."""
        frames = []
        for box in self._outboxes:
            if tick % box.every == box.phase:
                data = box.codec.pack([values[place] for place in box.places], box.count)
                box.count = 0 if box.count == LAST_COUNT else box.count + 1
                frames.append((box.codec.message.frame_id, data))
        return frames
