"""Messages in ROS 2's CDR, read by the definition that the file carries, by way of rosbags."""

from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from specs.errors import InputError

ENCODING, DEFINITION = "cdr", "ros2msg"
LONGEST = 64  # elements of an array that become channels


def decoder(text: str, name: str, topic: str) -> Callable[[bytes], dict[str, float | int | bool]]:
    """Gives the numbers of a message by their path in it; raises InputError for what is not of its
    definition.

    `text` defines the message `name`; "" where it must be one of ROS 2's own.
    """
    try:  # not in the machine controller's install
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError:
        raise InputError(f"{topic} is of ROS 2: pip install rosbags") from None

    def refused(error: Exception) -> InputError:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        return InputError(f"{topic}: a message is not of its definition {name}: {reason}")

    own, store = get_typestore(Stores.ROS2_HUMBLE).fielddefs, get_typestore(Stores.EMPTY)
    try:
        store.register({**own, **(get_types_from_msg(text, name) if text else {})})
    except Exception as error:  # noqa: BLE001 - other definitions make rosbags raise anything
        raise refused(error) from None
    if name not in store.fielddefs:
        raise InputError(f"{topic}: {name} is defined neither in the file nor by ROS 2 Humble")

    def decode(data: bytes) -> dict[str, float | int | bool]:
        try:
            return dict(_numbers(store.deserialize_cdr(data, name), ""))
        except Exception as error:  # noqa: BLE001 - as above
            raise refused(error) from None

    return decode


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
