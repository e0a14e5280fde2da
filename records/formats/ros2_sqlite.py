"""ROS 2 bags in SQLite (`.db3`, or its folder), read by their own definitions, else those of ROS 2 Humble."""

import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from mcap.records import Channel as Topic, Message, Schema

from records.formats import mcap_ros2
from records.formats.mcap_topics import YEAR_NS, TopicRows
from records.formats.metadata import at_ns
from records.formats.raw import Raw
from specs.errors import InputError

READS = (".db3",)
WRITES = ()
ZSTD = b"\x28\xb5\x2f\xfd"


def read(path: Path, names: Mapping[str, str]) -> Raw:
    """Read every topic whose messages are defined; raises InputError where there is none."""
    topics, notes, first = dict[tuple[str, str], TopicRows](), list[str](), None
    for file in sorted(path.glob("*.db3")) if path.is_dir() else [path]:
        for topic, message in _messages(file, topics, path, notes):
            first = message.log_time if first is None else min(first, message.log_time)
            topic.add(message)
    if first is None:
        raise InputError(f"{path} holds no messages" + (f" ({notes[0]})" if notes else ""))
    zero, start = (first, at_ns(first)) if first >= YEAR_NS else (0, None)
    of_name = [name for name, _ in topics]
    groups = [g for (name, _), t in topics.items() for g in t.groups(zero, of_name.count(name), notes)]
    if not groups:
        raise InputError(f"{path} holds no topic with numbers" + "".join(f"; {n}" for n in notes[:2]))
    return Raw(groups, start, {}, notes)


def _messages(
    file: Path, topics: dict[tuple[str, str], TopicRows], path: Path, notes: list[str]
) -> Iterator[tuple[TopicRows, Message]]:
    """The messages of a file in the order in which they were written, as far as it is whole."""
    begun = False
    try:
        # A bag that was not closed has its last messages in a file beside it: then it must be locked to read.
        alone = "" if file.with_name(f"{file.name}-wal").is_file() else "&immutable=1"
        with closing(sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro{alone}", uri=True)) as bag:
            known = _topics(bag, topics, path)
            for number, stamp, data in bag.execute(
                "SELECT topic_id, timestamp, data FROM messages ORDER BY id"
            ):
                begun = True
                if number not in known or not isinstance(data, bytes) or not 0 <= stamp < 2**63:
                    raise InputError(f"{file} is damaged: a message of topic {number} at {stamp} ns")
                if data.startswith(ZSTD):
                    raise InputError(
                        f"{file}: its messages are compressed; convert the bag without compression"
                    )
                yield known[number], Message(number, stamp, data, stamp, 0)
    except (sqlite3.Error, TypeError, ValueError, OverflowError) as error:
        if not begun:
            raise InputError(f"{file} is damaged or no bag of ROS 2: {error}") from None
        notes.append(f"{file.name} is damaged: read up to there ({error})")


def _topics(
    bag: sqlite3.Connection, topics: dict[tuple[str, str], TopicRows], path: Path
) -> dict[int, TopicRows]:
    """The topics of a file by their numbers in it."""
    tables = {name for (name,) in bag.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    defined: dict[str, tuple[str, Any]] = {}
    if "message_definitions" in tables:
        rows = bag.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
        defined = {kind: (encoding, text) for kind, encoding, text in rows}
    found = {}
    for number, name, kind, form in bag.execute("SELECT id, name, type, serialization_format FROM topics"):
        encoding, text = defined.get(kind, ("", ""))
        text = text if encoding == mcap_ros2.DEFINITION else ""
        schema = Schema(data=str(text or "").encode(), encoding=mcap_ros2.DEFINITION, id=1, name=str(kind))
        topic = Topic(id=1, topic=str(name), message_encoding=str(form), metadata={}, schema_id=1)
        found[number] = topics.setdefault((str(name), str(kind)), TopicRows(topic, schema, path))
    return found
