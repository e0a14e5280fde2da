"""Messages of MCAP topics in ROS 2's CDR, read by the definition that the file carries, by way of rosbags."""

from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from mcap.records import Message, Schema

from specs.errors import InputError

ENCODING, DEFINITION = "cdr", "ros2msg"
LONGEST = 64  # elements of an array that become channels


def rows(messages: Sequence[Message], schema: Schema, topic: str) -> list[dict[str, float | int | bool]]:
    """The numbers of each message by their path in it; raises InputError for what is not of its
    definition.
    """
    try:  # not in the machine controller's install
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError:
        raise InputError(f"{topic} is of ROS 2: pip install rosbags") from None
    store = get_typestore(Stores.ROS2_HUMBLE)
    try:
        defined = get_types_from_msg(schema.data.decode(), schema.name)
        store.register({k: v for k, v in defined.items() if k not in store.fielddefs})
        return [dict(_numbers(store.deserialize_cdr(m.data, schema.name), "")) for m in messages]
    except Exception as error:  # noqa: BLE001 - other messages make rosbags raise anything
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{topic}: a message is not of its definition {schema.name}: {reason}") from None


def _numbers(value: Any, at: str) -> Iterator[tuple[str, float | int | bool]]:
    """Numbers in nested messages and in arrays; texts are no channels, nor the stamp of a header."""
    if is_dataclass(value):
        for field in fields(value):
            if field.name not in ("header", "__msgtype__"):
                yield from _numbers(getattr(value, field.name), f"{at}.{field.name}" if at else field.name)
    elif isinstance(value, bool | int | float | np.number | np.bool_):
        yield at or "value", value.item() if isinstance(value, np.generic) else value
    elif isinstance(value, np.ndarray | list | tuple) and len(value) <= LONGEST:
        for i, inner in enumerate(value):
            yield from _numbers(inner, f"{at}[{i}]")
