"""MCAP with JSON messages: a topic for each clock, a JSON schema that says each field's unit.

Of other tools' files, topics in JSON and Protocol Buffers are read: numbers become channels `topic.field`,
their unit the `unit` of the field in the schema.  A file without footer or with damaged chunks is read as far
as it is whole.
"""

import json
import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Channel as Topic, Chunk, Message, Metadata, Schema
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC, Writer

from records.formats import mcap_protobuf, mcap_ros2
from records.formats.metadata import START, as_json, at_ns, meta_of, start_of, to_ns
from records.formats.raw import Group, Raw, RawColumn
from records.formats.tables import clocks, finer
from records.measurement import Channel, Measurement
from records.recording import first_line
from specs.errors import InputError

READS = (".mcap",)
WRITES = (".mcap",)
OURS = "slewright"  # name of our metadata, key of our topics' metadata
JSON = "json"
STATE = "state"  # under OURS in a topic's metadata: what a program goes on from, no channels
EXACT = 2**53  # from here on a float skips whole numbers
YEAR_NS = 365 * 86_400 * 10**9  # stamps below it count from no date
BROKEN_CHUNK = (CRCValidationError, McapError, ValueError, RuntimeError, struct.error, zstandard.ZstdError)


# A topic's name, the name and content of its schema, its encoding, and the how manieth such publisher in the
# file it is: the same in every segment.
Key = tuple[str, str, bytes, str, int]


@dataclass
class _Contents:
    """What was read so far."""

    topics: dict[Key, Topic] = field(default_factory=dict)
    schemas: dict[Key, Schema | None] = field(default_factory=dict)
    messages: dict[Key, list[Message]] = field(default_factory=dict)
    meta: dict[str, str] = field(default_factory=dict)
    # Numbers in the file that is being read: another segment has others.
    _keys: dict[int, Key] = field(default_factory=dict)
    _schemas: dict[int, Schema] = field(default_factory=dict)

    def begin_file(self) -> None:
        """A file begins."""
        self._keys, self._schemas = {}, {}

    def add(self, part: Any) -> None:
        """A record of the file."""
        if isinstance(part, Message):
            self.messages.setdefault(self._keys[part.channel_id], []).append(part)
        elif isinstance(part, Topic):
            schema = self._schemas.get(part.schema_id)
            if part.id in self._keys:
                return  # said again, in a chunk or in the summary
            content = schema.data if schema else b""
            base = (part.topic, schema.name if schema else "", content, part.message_encoding)
            key = (*base, sum(k[:4] == base for k in self._keys.values()))
            self._keys[part.id], self.topics[key], self.schemas[key] = key, part, schema
        elif isinstance(part, Schema):
            self._schemas[part.id] = part
        elif isinstance(part, Metadata) and part.name == OURS:
            self.meta |= part.metadata


def read(path: Path, names: Mapping[str, str]) -> Raw:
    """Read every topic of JSON and Protocol Buffers; raises InputError where there is none."""
    notes: list[str] = []
    found = _Contents()
    # The file, or all segments of the runtime's recorder in a folder, oldest first
    for file in sorted(path.glob("*.mcap")) if path.is_dir() else [path]:
        found.begin_file()
        for part in _parts(file, notes):
            found.add(part)
    meta = _our_meta(found.meta)
    stamps = [m.log_time for messages in found.messages.values() for m in messages]
    if not stamps:
        raise InputError(f"{path} holds no messages" + (f" ({notes[0]})" if notes else ""))
    zero, start = _zero(min(stamps), meta, found)
    groups = [group for key in found.topics for group in _group(key, found, zero, path, notes)]
    if not groups:
        used = ", ".join(sorted({t.message_encoding or "none" for t in found.topics.values()}))
        raise InputError(
            f"{path} holds no topic in JSON, Protocol Buffers or ROS 2's CDR with its definition; its "
            f"encodings: {used}"
        )
    return Raw(groups, start, {k: v for k, v in meta.items() if k != START}, notes)


def _parts(path: Path, notes: list[str]) -> Iterator[Any]:
    """The records of the file, those of damaged chunks left out, until its end or where it was cut."""
    data = path.read_bytes()
    if not data.startswith(MCAP0_MAGIC):
        raise InputError(f"{path} is not MCAP")
    end, closed = _last_whole_record(data)
    if not closed:
        notes.append("the file was not closed, it has no footer: read as far as it is whole")
    tail = MCAP0_MAGIC if closed else b""
    records = StreamReader(BytesIO(data[:end] + tail), emit_chunks=True).records
    while True:
        try:
            part = next(records)
        except (StopIteration, EndOfFile):
            return
        except (McapError, ValueError, OverflowError, struct.error) as error:
            notes.append(f"the file is damaged: read up to there ({first_line(error)})")
            return
        yield from _chunk_records(part, notes) if isinstance(part, Chunk) else (part,)


def _last_whole_record(data: bytes) -> tuple[int, bool]:
    """Where the last whole record ends, and whether that is the footer."""
    at = len(MCAP0_MAGIC)
    while at + 9 <= len(data):
        code, length = struct.unpack_from("<BQ", data, at)
        if at + 9 + length > len(data):
            break
        at += 9 + length
        if code == Opcode.FOOTER:
            return at, True
    return at, False


def _chunk_records(chunk: Chunk, notes: list[str]) -> list[Any]:
    try:
        return breakup_chunk(chunk, validate_crc=True)
    except BROKEN_CHUNK:
        seconds = (chunk.message_end_time - chunk.message_start_time) / 1e9
        notes.append(f"dropped a damaged chunk of {seconds:.6g} s")
        return []


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


def _group(key: Key, found: _Contents, zero: int, path: Path, notes: list[str]) -> list[Group]:
    """The topic's numbers, in a list; an empty one for a topic in no JSON or without messages."""
    topic, messages = found.topics[key], found.messages.get(key, [])
    name = topic.topic.strip("/").replace("/", ".")
    if topic.metadata.get(OURS) == STATE:
        return []
    schema = found.schemas.get(key)
    in_ros2 = (
        topic.message_encoding == mcap_ros2.ENCODING
        and schema is not None
        and schema.encoding == mcap_ros2.DEFINITION
    )
    in_protobuf = topic.message_encoding == mcap_protobuf.ENCODING and schema is not None
    if topic.message_encoding != JSON and not in_protobuf and not in_ros2:
        notes.append(f"topic {topic.topic}: left out, it is in {topic.message_encoding or 'no encoding'}")
        return []
    if not messages:
        return []
    if in_protobuf and schema is not None:
        rows = mcap_protobuf.rows(messages, schema, f"{path}: topic {topic.topic}")
    elif in_ros2 and schema is not None:
        try:
            rows = mcap_ros2.rows(messages, schema, f"topic {topic.topic}")
        except InputError as error:
            notes.append(f"left out: {error}")
            return []
    else:
        left = Counter[str]()
        rows = [_row(m, topic, i, path, left) for i, m in enumerate(messages)]
        if left:
            what = ", ".join(f"{k} ({n})" for k, n in list(left.items())[:6])
            notes.append(f"topic {topic.topic}: texts and lists left out: {what}")
    if topic_count(topic.topic, found) > 1:
        notes.append(
            f"topic {topic.topic}: {topic_count(topic.topic, found)} publishers or schemas, kept apart; "
            f"this one: {schema.name if schema else 'no schema'}"
        )
    units = _fields(schema if schema and not in_ros2 and not in_protobuf else None, topic)
    keys = list(dict.fromkeys(key for row in rows for key in row))
    columns = [_column(key, rows, units, notes) for key in keys]
    if OURS not in topic.metadata:
        labels = [name if len(keys) == 1 else f"{name}.{key}" for key in keys]
        columns = [replace(c, name=label) for c, label in zip(columns, labels, strict=True)]
    time = np.array([m.log_time - zero for m in messages]) / 1e9
    return [Group(name, time, columns, "message")]


def topic_count(name: str, found: _Contents) -> int:
    """How many publishers or schemas with messages a topic has."""
    return sum(key[0] == name and bool(found.messages.get(key)) for key in found.topics)


def _row(message: Message, topic: Topic, index: int, path: Path, left: Counter[str]) -> dict[str, Any]:
    """The numbers of a message by their path in it."""
    try:
        whole = json.loads(message.data)
    except ValueError as error:
        place = f"message {index + 1} of {topic.topic}"
        raise InputError(f"{path}: {place} is not JSON: {first_line(error)}") from None
    return dict(_numbers(whole, "", left))


def _numbers(value: Any, at: str, left: Counter[str]) -> Iterator[tuple[str, float | int | bool]]:
    """Numbers in nested objects; text, lists and nothing are no channels: `left` counts them."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _numbers(inner, f"{at}.{key}" if at else str(key), left)
    elif isinstance(value, bool | int | float):
        yield at or "value", value
    elif value is not None:
        left[at or "value"] += 1


def _fields(schema: Schema | None, topic: Topic) -> dict[str, tuple[str, str]]:
    """Unit and description by path, as the schema's properties or the topic's metadata state them."""
    found: dict[str, tuple[str, str]] = {}
    with suppress(ValueError):
        _walk(json.loads(schema.data) if schema and schema.data else {}, "", found)
    for key, text in topic.metadata.items():
        if key == "unit" or key.startswith("unit:"):
            found[key[5:]] = (text, "")
    return found


def _walk(schema: Any, at: str, found: dict[str, tuple[str, str]]) -> None:
    for key, inner in schema.get("properties", {}).items() if isinstance(schema, dict) else ():
        path = f"{at}.{key}" if at else key
        if isinstance(inner, dict):
            found[path] = (str(inner.get("unit", "")), str(inner.get("description", "")))
            _walk(inner, path, found)


def _column(
    key: str, rows: list[dict[str, Any]], fields: Mapping[str, tuple[str, str]], notes: list[str]
) -> RawColumn:
    held = [row.get(key) for row in rows]
    absent = np.array([value is None for value in held])
    kinds = {type(value) for value in held} - {type(None)}
    filled = [0 if value is None else value for value in held]
    kind = (
        np.dtype(bool)
        if kinds == {bool}
        else _whole(filled)
        if kinds <= {int, bool}
        else np.dtype(np.float64)
    )
    big = [v for v in filled if isinstance(v, int) and abs(v) > EXACT]
    if kind == np.float64 and big:
        notes.append(f"{key}: whole numbers beyond 2^53 are rounded to floats, such as {big[0]}")
    values = np.array([float(v) for v in filled] if kind == np.float64 else filled, dtype=kind)
    unit, description = fields.get(key) or fields.get("", ("", ""))
    return RawColumn(key, unit, values, description, absent if absent.any() else None)


def _whole(held: list[int]) -> np.dtype:
    """The type that holds whole numbers exactly; floats where none does."""
    low, high = min(held), max(held)
    if low >= -(2**63) and high < 2**63:
        return np.dtype(np.int64)
    return np.dtype(np.uint64 if low >= 0 and high < 2**64 else np.float64)


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
            _write_topic(writer, f"/channels/{number + 1}", time, channels, zero)
        writer.finish()
    times = (c.time for c in measurement.channels.values())
    return ["times: rounded to 1 ns"] if finer(times, 1e-9) else []


def _write_topic(writer: Writer, name: str, time: np.ndarray, channels: list[Channel], zero: int) -> None:
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
