"""A segment that was not closed gets its index and footer, so that every reader opens it."""

from pathlib import Path

from mcap.records import Channel, Message, Metadata, Schema
from mcap.writer import MCAP0_MAGIC, Writer

from runtime.recorder.message import places
from runtime.recorder.reader import parts
from runtime.recorder.segments import CHUNK_TICKS


def is_closed(path: Path) -> bool:
    """True if the file ends as MCAP does."""
    with path.open("rb") as file:
        file.seek(0, 2)
        size = file.tell()
        file.seek(max(0, size - len(MCAP0_MAGIC)))
        return size > len(MCAP0_MAGIC) and file.read() == MCAP0_MAGIC


def mend(path: Path) -> bool:
    """Rewrite what is whole in an unclosed file, delete it if nothing is; True if it was unclosed."""
    if is_closed(path):
        return False
    temporary = path.with_suffix(".mending")
    with temporary.open("wb") as file:
        writer = Writer(file, chunk_size=CHUNK_TICKS * places().message_bytes)
        writer.start(profile="", library="slewright")
        messages = _copy(path, writer)
        writer.finish()
    if messages:
        temporary.replace(path)
    else:
        temporary.unlink()
        path.unlink()
    return True


def _copy(path: Path, writer: Writer) -> int:
    """Copy what is whole; the number of messages."""
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    count = 0
    for part in parts(path, []):
        if isinstance(part, Metadata):
            writer.add_metadata(part.name, part.metadata)
        elif isinstance(part, Schema) and part.id not in schemas:
            schemas[part.id] = writer.register_schema(part.name, part.encoding, part.data)
        elif isinstance(part, Channel) and part.id not in channels:
            kind = schemas.get(part.schema_id, 0)
            channels[part.id] = writer.register_channel(
                part.topic, part.message_encoding, kind, part.metadata
            )
        elif isinstance(part, Message):
            writer.add_message(
                channels[part.channel_id], part.log_time, part.data, part.publish_time, part.sequence
            )
            count += 1
    return count
