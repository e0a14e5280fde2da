"""The messages of a topic as columns: decoded as they come, kept as numbers in blocks."""

import json
from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Channel as Topic, Message, Schema

from records.formats import mcap_protobuf, mcap_ros2
from records.formats.exact import EXACT
from records.formats.raw import Group, RawColumn
from records.recording import first_line
from specs.errors import InputError

OURS = "slewright"  # name of our metadata, key of our topics' metadata
JSON = "json"
STATE = "state"  # under OURS in a topic's metadata: what a program goes on from, no channels
YEAR_NS = 365 * 86_400 * 10**9  # stamps below it count from no date
BLOCK = 1 << 14  # messages that are held as such
BLOCK_BYTES = 16 << 20

Row = Mapping[str, float | int | bool]


@dataclass
class Part:
    """Values of one field in a block of messages: `kind` is bool, int or float."""

    kind: type
    values: np.ndarray
    absent: np.ndarray
    big: int | None = None  # a whole number that a float does not hold


@dataclass
class TopicRows:
    """What came of a topic."""

    topic: Topic
    schema: Schema | None
    path: Path
    times: array = field(default_factory=lambda: array("Q"))
    parts: dict[str, list[Part]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    left: Counter[str] = field(default_factory=Counter)  # texts and lists of messages
    closed: bool = False  # its messages are not read, or no longer
    _rows: list[Row] = field(default_factory=list)
    _done: int = 0
    _bytes: int = 0
    _decode: Callable[[bytes], Row] | None = None

    def __post_init__(self) -> None:
        encoding = self.topic.message_encoding
        if self.topic.metadata.get(OURS) == STATE:
            self.closed = True
        elif encoding != JSON and not self._in_protobuf and not self._in_ros2:
            self._close(f"topic {self.topic.topic}: left out, it is in {encoding or 'no encoding'}")

    @property
    def _in_protobuf(self) -> bool:
        return self.topic.message_encoding == mcap_protobuf.ENCODING and self.schema is not None

    @property
    def _in_ros2(self) -> bool:
        return (
            self.topic.message_encoding == mcap_ros2.ENCODING
            and self.schema is not None
            and self.schema.encoding == mcap_ros2.DEFINITION
        )

    def _close(self, note: str) -> None:
        self.closed = True
        self.notes.append(note)
        self.times, self.parts, self._rows = array("Q"), {}, []

    def add(self, message: Message) -> None:
        """Decode a message; raises InputError for one that is damaged."""
        if self.closed:
            return
        try:
            self._decode = self._decode or self._decoder()
            self._rows.append(self._decode(message.data))
        except InputError as error:
            if not self._in_ros2:
                raise
            self._close(f"left out: {error}")
            return
        self.times.append(message.log_time)
        self._bytes += len(message.data)
        if len(self._rows) >= BLOCK or self._bytes > BLOCK_BYTES:
            self._flush()

    def _decoder(self) -> Callable[[bytes], Row]:
        name = f"topic {self.topic.topic}"
        if self.schema is not None and self._in_protobuf:
            return mcap_protobuf.decoder(self.schema, f"{self.path}: {name}", self.left)
        if self.schema is not None and self._in_ros2:
            text = self.schema.data.decode("utf-8", "replace")
            return mcap_ros2.decoder(text, self.schema.name, name, self.left, self.notes)
        return self._of_json

    def _of_json(self, data: bytes) -> Row:
        """The numbers of a message by their path in it."""
        place = f"message {len(self.times) + 1} of {self.topic.topic}"
        try:
            ours = OURS in self.topic.metadata  # no name stands twice there
            message = json.loads(data) if ours else json.loads(data, object_pairs_hook=_object)
            found = list(_numbers(message, "", self.left))
            return dict(found) if ours else _object(found)
        except _TwiceError as error:
            raise InputError(f"{self.path}: {place} has '{error}' twice: which one holds?") from None
        except (ValueError, RecursionError) as error:
            raise InputError(f"{self.path}: {place} is not JSON: {first_line(error)}") from None

    def _flush(self) -> None:
        """Make columns of the messages that are held."""
        count = len(self._rows)
        for key in dict.fromkeys(key for row in self._rows for key in row):
            parts = self.parts.setdefault(key, [])
            if not parts and self._done:
                parts.append(_absent(self._done))
            parts.append(_part([row.get(key) for row in self._rows]))
        self._done, self._bytes, self._rows = self._done + count, 0, []
        for parts in self.parts.values():
            if (lacks := self._done - sum(len(p.values) for p in parts)) > 0:
                parts.append(_absent(lacks))

    def groups(self, zero: int, publishers: int, notes: list[str]) -> list[Group]:
        """The topic's numbers, in a list; an empty one where none were read."""
        notes += self.notes
        if self.closed or not self.times:
            return []
        self._flush()
        if self.left:
            what = ", ".join(f"{k} ({n})" for k, n in list(self.left.items())[:6])
            notes.append(f"topic {self.topic.topic}: texts and lists left out: {what}")
        if publishers > 1:
            notes.append(
                f"topic {self.topic.topic}: {publishers} publishers or schemas, kept apart; this one: "
                f"{self.schema.name if self.schema else 'no schema'}"
            )
        name = self.topic.topic.strip("/").replace("/", ".")
        units = _fields(self.schema if not self._in_ros2 and not self._in_protobuf else None, self.topic)
        alone = len(self.parts) == 1
        columns = []
        for key in list(self.parts):
            column = _column(key, self.parts.pop(key), units, notes)
            if OURS not in self.topic.metadata:
                column = replace(column, name=name if alone else f"{name}.{key}")
            columns.append(column)
        return [Group(name, _seconds(self.times, zero), columns, "message")]


def _seconds(stamps: array, zero: int) -> np.ndarray:
    """Stamps [ns] as s from `zero`, subtracted as whole numbers."""
    held = np.frombuffer(stamps, np.uint64)
    small = held.max() < 2**63 and abs(zero) < 2**62
    return np.asarray((held.astype(np.int64 if small else object) - zero) / 1e9, dtype=np.float64)


class _TwiceError(ValueError):
    """Says what stands twice in an object."""


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object in which each name, or each path in it, stands once."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise _TwiceError(Counter(name for name, _ in pairs).most_common(1)[0][0])
    return found


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
    with suppress(ValueError, RecursionError):
        _walk(json.loads(schema.data) if schema and schema.data else {}, "", found)
    for key, text in topic.metadata.items():
        if key == "unit" or key.startswith("unit:"):
            found[key[5:]] = (text, "")
    return found


def _walk(schema: Any, at: str, found: dict[str, tuple[str, str]]) -> None:
    properties = schema.get("properties") if isinstance(schema, dict) else None
    for key, inner in properties.items() if isinstance(properties, dict) else ():
        path = f"{at}.{key}" if at else key
        if isinstance(inner, dict):
            found[path] = (str(inner.get("unit", "")), str(inner.get("description", "")))
            _walk(inner, path, found)


def _absent(count: int) -> Part:
    return Part(bool, np.zeros(count, dtype=bool), np.ones(count, dtype=bool))


def _part(held: Sequence[Any]) -> Part:
    absent = np.array([value is None for value in held])
    kinds = {type(value) for value in held} - {type(None)}
    filled = [0 if value is None else value for value in held]
    big = next((v for v in filled if isinstance(v, int) and abs(v) > EXACT), None)
    if kinds <= {bool}:
        return Part(bool, np.array(filled, dtype=bool), absent)
    if kinds <= {int, bool}:
        return Part(int, np.array(filled, dtype=_whole(min(filled), max(filled)) or object), absent, big)
    return Part(float, np.array([_float(v) for v in filled]), absent, big)


def _whole(low: int, high: int) -> np.dtype | None:
    """The type that holds whole numbers exactly; None where none does."""
    if low >= -(2**63) and high < 2**63:
        return np.dtype(np.int64)
    return np.dtype(np.uint64) if low >= 0 and high < 2**64 else None


def _float(value: float) -> float:
    try:
        return float(value)
    except OverflowError:  # a whole number of some hundred digits
        return float("inf")


def _column(
    key: str, parts: Sequence[Part], fields: Mapping[str, tuple[str, str]], notes: list[str]
) -> RawColumn:
    """The blocks of a field as one column, of the type that holds all of it."""
    kinds = {p.kind for p in parts if not p.absent.all()} or {bool}
    kind = np.dtype(bool) if kinds == {bool} else None
    if kinds <= {int, bool} and kind is None:
        kind = _whole(min(int(p.values.min()) for p in parts), max(int(p.values.max()) for p in parts))
    kind = kind or np.dtype(np.float64)
    big = [p.big for p in parts if p.big is not None]
    if kind == np.float64 and big:
        notes.append(f"{key}: whole numbers beyond 2^53 are rounded to floats, such as {big[0]}")
    values = np.concatenate([_as(p.values, kind) for p in parts])
    absent = np.concatenate([p.absent for p in parts])
    unit, description = fields.get(key) or fields.get("", ("", ""))
    return RawColumn(key, unit, values, description, absent if absent.any() else None)


def _as(values: np.ndarray, kind: np.dtype) -> np.ndarray:
    if values.dtype == object and kind == np.float64:
        return np.array([_float(v) for v in values.tolist()])
    return values.astype(kind, copy=False)
