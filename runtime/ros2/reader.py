"""What comes on a topic: messages that can be read, and of whom nothing comes."""

from typing import Any

from cyclonedds.domain import DomainParticipant
from cyclonedds.qos import Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from runtime.ros2.wire import Unreadable, message

UNSIGNED = 2**64 - 1  # as a message's handles are; those of a list come with a sign


class Reader:
    """Reads a topic; `topic` is its name on the wire, `kind` the type of its messages."""

    def __init__(self, participant: DomainParticipant, topic: str, kind: str, quality: Qos) -> None:
        self.topic, self.kind = topic, kind
        self.entity = DataReader(participant, Topic(participant, topic, message(kind)), quality)
        self._unreadable: dict[int, str] = {}

    def take(self, most: int) -> list[Any]:
        """Messages that came, as far as they can be read."""
        found = self.entity.take(most)
        for sample in found:
            if isinstance(sample, Unreadable):
                self._unreadable[sample.sample_info.publication_handle] = sample.why
        return [s for s in found if s.sample_info.valid_data and not isinstance(s, Unreadable)]

    def unreadable(self) -> dict[int, str]:
        """Why messages could not be read, by the handle of their publisher; of those since the last call."""
        found, self._unreadable = self._unreadable, {}
        return found

    def hears(self, publisher: int) -> bool:
        """Whether DDS brings what the publisher of this handle sends."""
        return publisher in {handle & UNSIGNED for handle in self.entity.get_matched_publications()}
