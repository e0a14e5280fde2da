"""MCAP with JSON messages: a topic for each clock, a JSON schema that says each field's unit.

Of other tools' files, topics in JSON and Protocol Buffers are read: numbers become channels `topic.field`,
their unit the `unit` of the field in the schema.  A file without footer or with damaged chunks is read as far
as it is whole.
"""

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Channel as Topic, Message, Metadata, Schema
from mcap.writer import Writer

from records.formats.mcap_records import records_of
from records.formats.mcap_topics import JSON, OURS, YEAR_NS, TopicRows
from records.formats.metadata import START, as_json, at_ns, meta_of, start_of, to_ns
from records.formats.raw import Raw
from records.formats.tables import clocks, finer
from records.measurement import Channel, Measurement
from specs.errors import InputError

READS = (".mcap",)
WRITES = (".mcap",)

# A topic's name, the name and content of its schema, its encoding, and the how manieth such publisher in the
# file it is: the same in every segment.
Key = tuple[str, str, bytes, str, int]


@dataclass
class _Contents:
    """What was read so far."""

    path: Path
    topics: dict[Key, TopicRows] = field(default_factory=dict)
    counts: Counter[Key] = field(default_factory=Counter)  # messages
    meta: dict[str, str] = field(default_factory=dict)
    first: int | None = None  # stamp
    lost: int = 0  # messages of topics that nothing declares: that stood in a damaged chunk
    # Numbers in the file that is being read: another segment has others.
    _keys: dict[int, Key] = field(default_factory=dict)
    _schemas: dict[int, Schema] = field(default_factory=dict)

    def begin_file(self) -> None:
        """A file begins."""
        self._keys, self._schemas = {}, {}

    def add(self, part: Any) -> None:
        """A record of the file."""
        if isinstance(part, Message):
            key = self._keys.get(part.channel_id)
            if key is None:
                self.lost += 1
                return
            self.counts[key] += 1
            self.first = part.log_time if self.first is None else min(self.first, part.log_time)
            self.topics[key].add(part)
        elif isinstance(part, Topic):
            schema = self._schemas.get(part.schema_id)
            if part.id in self._keys:
                return  # said again, in a chunk or in the summary
            content = schema.data if schema else b""
            base = (part.topic, schema.name if schema else "", content, part.message_encoding)
            key = (*base, sum(k[:4] == base for k in self._keys.values()))
            self._keys[part.id] = key
            self.topics.setdefault(key, TopicRows(part, schema, self.path))
        elif isinstance(part, Schema):
            self._schemas[part.id] = part
        elif isinstance(part, Metadata) and part.name == OURS:
            self.meta |= part.metadata

    def publishers(self, topic: str) -> int:
        """How many publishers or schemas with messages a topic has."""
        return sum(key[0] == topic for key in self.counts)


def read(path: Path, names: Mapping[str, str]) -> Raw:
    """Read every topic of JSON, Protocol Buffers and ROS 2; raises InputError where there is none."""
    notes: list[str] = []
    found = _Contents(path)
    # The file, or all segments of the runtime's recorder in a folder, oldest first
    for file in sorted(path.glob("*.mcap")) if path.is_dir() else [path]:
        found.begin_file()
        for part in records_of(file, notes):
            found.add(part)
    if found.lost:
        notes.append(f"messages of topics that are not declared: left out {found.lost}")
    meta = _our_meta(found.meta)
    if found.first is None:
        raise InputError(f"{path} holds no messages" + (f" ({notes[0]})" if notes else ""))
    zero, start = _zero(found.first, meta, found)
    groups = [
        group
        for key, rows in found.topics.items()
        for group in rows.groups(zero, found.publishers(key[0]), notes)
    ]
    if not groups:
        used = ", ".join(sorted({key[3] or "none" for key in found.topics}))
        raise InputError(
            f"{path} holds no topic in JSON, Protocol Buffers or ROS 2's CDR with its definition; its "
            f"encodings: {used}"
        )
    return Raw(groups, start, {k: v for k, v in meta.items() if k != START}, notes)


def _our_meta(stored: Mapping[str, str]) -> dict[str, Any]:
    """Our own metadata; what the runtime's recorder says of itself stands under `recorded`."""
    if "meta" not in stored:
        return {"recorded": dict(stored)} if stored else {}
    try:
        return json.loads(stored["meta"])
    except ValueError:
        return {}


def _zero(first: int, meta: Mapping[str, Any], found: _Contents) -> tuple[int, datetime | None]:
    """The stamp [ns] that is 0 s, and the time of day then."""
    if start := start_of(meta):
        return to_ns(start), start
    return (first, at_ns(first)) if first >= YEAR_NS and "meta" not in found.meta else (0, None)


def write(measurement: Measurement, path: Path) -> list[str]:
    """Write a topic for each clock; returns what MCAP does not keep."""
    zero = to_ns(measurement.start) if measurement.start else 0
    first = min(c.time[0] for c in measurement.channels.values() if len(c.time))
    if zero + round(1e9 * first) < 0:
        raise InputError(f"{path}: MCAP holds no times before 1970")
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="slewright")
        writer.add_metadata(OURS, {"meta": as_json(meta_of(measurement))})
        for number, (time, channels) in enumerate(clocks(measurement.channels.values())):
            write_topic(writer, f"/channels/{number + 1}", time, channels, zero)
        writer.finish()
    times = (c.time for c in measurement.channels.values())
    return ["times: rounded to 1 ns"] if finer(times, 1e-9) else []


def write_topic(writer: Writer, name: str, time: np.ndarray, channels: list[Channel], zero: int) -> None:
    """A topic with the channels of one clock: values over `time` [s], 0 s at the stamp `zero` [ns]."""
    schema = writer.register_schema(name=name.strip("/"), encoding="jsonschema", data=_schema(channels))
    topic = writer.register_channel(
        topic=name, message_encoding=JSON, schema_id=schema, metadata={OURS: "channels"}
    )
    names = [c.name for c in channels]
    finite = [np.isfinite(c.values) for c in channels]
    whole = all(f.all() for f in finite)
    stamps = (zero + np.round(1e9 * time).astype(np.int64)).tolist()
    columns = [c.values.tolist() for c in channels]
    for i, (stamp, row) in enumerate(zip(stamps, zip(*columns, strict=True), strict=True)):
        message = dict(zip(names, row, strict=True))
        if not whole:
            message = {n: v for (n, v), f in zip(message.items(), finite, strict=True) if f[i]}
        data = json.dumps(message, separators=(",", ":")).encode()
        writer.add_message(channel_id=topic, log_time=stamp, publish_time=stamp, sequence=i, data=data)


def _schema(channels: list[Channel]) -> bytes:
    """The JSON schema of a topic: name, unit and description of each field."""
    kinds = {"b": "boolean", "i": "integer", "u": "integer"}
    properties = {
        c.name: {
            "type": kinds.get(c.values.dtype.kind, "number"),
            "unit": c.unit,
            "description": c.description,
        }
        for c in channels
    }
    return json.dumps({"type": "object", "properties": properties}, ensure_ascii=False).encode()
