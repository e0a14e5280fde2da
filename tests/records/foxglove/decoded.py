"""Messages read by the schemas that stand in the file itself, without the SDK that wrote them."""

from pathlib import Path
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader


def message_class(name: str, schema: bytes) -> Any:
    """The class that a serialised FileDescriptorSet describes."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))


def messages(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """(ns, message) of each topic in Protocol Buffers."""
    found: dict[str, list[tuple[int, Any]]] = {}
    kinds: dict[int, Any] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if channel.message_encoding == "protobuf" and schema:
                kind = kinds.setdefault(schema.id, message_class(schema.name, schema.data))
                found.setdefault(channel.topic, []).append((message.log_time, kind.FromString(message.data)))
    return found
