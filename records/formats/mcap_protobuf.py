"""Messages of MCAP topics in Protocol Buffers, read by the schema that the file carries."""

from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

from mcap.records import Schema

from specs.errors import InputError

ENCODING = "protobuf"


def decoder(
    schema: Schema, topic: str, left: Counter[str]
) -> Callable[[bytes], dict[str, float | int | bool]]:
    """Gives the numbers of a message by their path in it; raises InputError for what is not of the schema.

    `left` counts texts and lists, which are no channels.
    """
    try:  # not in the extra `formats`: few files need it
        from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
        from google.protobuf.message import DecodeError
    except ImportError:
        raise InputError(f"{topic} is in Protocol Buffers: pip install protobuf") from None
    wrong = (DecodeError, KeyError, TypeError, ValueError, RecursionError)

    def refused(error: Exception) -> InputError:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        return InputError(f"{topic}: a message is not of its schema {schema.name}: {reason}")

    try:
        pool = descriptor_pool.DescriptorPool()
        for file in _in_order(descriptor_pb2.FileDescriptorSet.FromString(schema.data).file):
            pool.Add(file)
        kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
    except wrong as error:
        raise refused(error) from None

    def decode(data: bytes) -> dict[str, float | int | bool]:
        try:
            return dict(_numbers(kind.FromString(data), "", left))
        except wrong as error:
            raise refused(error) from None

    return decode


def _in_order(files: Any) -> list[Any]:
    """Definitions behind those that they need, in whatever order the file has them."""
    left, done = {f.name: f for f in files}, list[Any]()
    while left:
        ready = [f for f in left.values() if not any(d in left for d in f.dependency)] or list(left.values())
        for file in ready:
            done.append(left.pop(file.name))
    return done


def _numbers(message: Any, at: str, left: Counter[str]) -> Iterator[tuple[str, float | int | bool]]:
    """Numbers in nested messages; text, bytes and repeated fields are no channels: `left` counts them."""
    for field in message.DESCRIPTOR.fields:
        if field.has_presence and not message.HasField(field.name):
            continue  # what was not set is absent, not 0
        value, path = getattr(message, field.name), f"{at}{field.name}"
        if field.is_repeated or isinstance(value, str | bytes):
            left[path] += bool(value)
        elif field.message_type is not None:
            yield from _numbers(value, f"{path}.", left)
        elif isinstance(value, bool | int | float):
            yield path, value
