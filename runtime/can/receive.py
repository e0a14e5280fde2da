"""What came: frames of a node's messages, checked end to end, with the age of every value.

A frame counts if its length, checksum and counter are right.  The counter may have gone on by one, and by one
more for each cycle that passed without a frame; it may not stand still (a repeated frame is no news).  Until
its next right frame a message with a wrong one has the status CHECKSUM; its values stay and grow old.  Where
right frames with counters that cannot be come again and again, two nodes send the message: TWO_SENDERS.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from runtime.can.codec import Codec
from runtime.image import Status, timeout_ticks
from specs.e2e import LAST_COUNT

COUNTS = LAST_COUNT + 1
# Doubt that only one node sends a message (wire.c has the same): so much for each counter that cannot be, one
# less for each right frame; from the third of a steady row on they are two.
DOUBT, TWO_SENDERS, MOST_DOUBT = 16, 40, 64
SPARE = 1  # counts that may be missed without a cycle that passed: two frames can change places with a tick


class _Inbox:
    """What is known of one message."""

    def __init__(self, codec: Codec, places: list[int]) -> None:
        self.codec, self.places = codec, places
        self.count: int | None = None
        self.tick = -1  # of the last right frame
        self.stamp_ns = 0
        self.refused = self.repeated = 0
        self.doubt, self.fresh = 0, False

    def doubt_after(self, count: int) -> None:
        """A right frame whose counter cannot be: of a second sender, if there are more of them."""
        if self.fresh or count != self.count:
            self.doubt = min(self.doubt + DOUBT, MOST_DOUBT)
        self.repeated += count == self.count
        self.fresh = False

    def follows(self, count: int, tick: int) -> bool:
        """Whether the counter is one that may come now."""
        if self.count is None:
            return True
        gone = (count - self.count) % COUNTS
        missed = max(0, tick - self.tick) // self.codec.cycle_ticks
        return 1 <= gone <= 1 + SPARE + missed or missed >= LAST_COUNT


class Receiver:
    """Values, ages and status of the signals of some messages, in places of an image."""

    def __init__(self, messages: Iterable[Codec], index: Mapping[str, int]) -> None:
        self._inboxes = {
            codec.message.frame_id: _Inbox(codec, [index[f.name] for f in codec.fields]) for codec in messages
        }
        fields = [f for box in self._inboxes.values() for f in box.codec.fields]
        self.places = np.array([index[f.name] for f in fields], dtype=np.intp)
        size = max(index.values(), default=-1) + 1
        self._timeouts = np.zeros(size, dtype=np.int64)
        for field in fields:
            self._timeouts[index[field.name]] = timeout_ticks(field.signal)
        self._values = [0.0] * size
        self._status = [int(Status.NEVER)] * size
        self._ticks = [-1] * size
        for field in fields:
            self._values[index[field.name]] = field.signal.start

    @property
    def wrong(self) -> int:
        """Frames refused so far."""
        return sum(box.refused for box in self._inboxes.values())

    def told(self) -> list[tuple[str, int, int]]:
        """Of each message: name, frames refused so far, and how many of them were repeated."""
        return [(b.codec.message.name, b.refused, b.repeated) for b in self._inboxes.values()]

    def stamp_ns(self, frame_id: int) -> int:
        """When the last right frame of a message came (0: none)."""
        return self._inboxes[frame_id].stamp_ns

    def take(self, frame_id: int, data: bytes, tick: int, stamp_ns: int = 0) -> bool:
        """Take a frame that came in `tick`; False if its message is not for us or the frame is wrong."""
        box = self._inboxes.get(frame_id)
        if box is None:
            return False
        count = box.codec.count(data)
        if count is None or not box.follows(count, tick):
            self._refuse(box, count)
            return False
        box.fresh, box.doubt = count != box.count, max(0, box.doubt - 1)
        box.count, box.tick, box.stamp_ns = count, tick, stamp_ns
        for place, (value, status) in zip(box.places, box.codec.unpack(data), strict=True):
            self._status[place], self._ticks[place] = status, tick
            if status == Status.OK or status == Status.RANGE:
                self._values[place] = value
        return True

    def _refuse(self, box: _Inbox, count: int | None) -> None:
        box.refused += 1
        if count is not None:
            box.doubt_after(count)
        if count is not None and count != box.count:
            box.count = count  # a sender that started anew is believed from its second frame on
        for place in box.places:
            if self._ticks[place] >= 0:
                self._status[place] = Status.CHECKSUM

    def fill(self, image: np.ndarray, tick: int) -> None:
        """Put values, ages and status into an image (runtime/image.py) at `tick`."""
        places = self.places
        ticks = np.array(self._ticks)[places]
        age = np.where(ticks < 0, -1, tick - ticks)
        status = np.array(self._status, dtype=np.uint8)[places]
        late = (age >= self._timeouts[places]) & (ticks >= 0)
        image["value"][places] = np.array(self._values)[places]
        image["age"][places] = age
        doubted = [box.doubt >= TWO_SENDERS for box in self._inboxes.values() for _ in box.places]
        status = np.where(np.array(doubted, dtype=bool), Status.TWO_SENDERS, status)
        image["status"][places] = np.where(late, Status.TIMEOUT, status)
