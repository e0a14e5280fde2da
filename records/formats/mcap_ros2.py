"""Messages in ROS 2's CDR, read by the definition that the file carries, by way of rosbags."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np

from specs.errors import InputError

ENCODING, DEFINITION = "cdr", "ros2msg"
LONGEST = 64  # elements of an array that become channels


def decoder(
    text: str, name: str, topic: str, left: Counter[str], notes: list[str]
) -> Callable[[bytes], dict[str, float | int | bool]]:
    """Gives the numbers of a message by their path in it; raises InputError for what is not of its
    definition.

    `text` defines the message `name`; "" where it must be one of ROS 2's own.  `left` counts texts and
    long arrays, which are no channels; `notes` says where names put elements in another place.
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

    named = _Named(topic, notes)

    def decode(data: bytes) -> dict[str, float | int | bool]:
        try:
            return dict(_numbers(store.deserialize_cdr(data, name), "", left, named))
        except Exception as error:  # noqa: BLE001 - as above
            raise refused(error) from None

    return decode


@dataclass
class _Named:
    """Places of elements that a list `name` beside them names, as in joint states: a name keeps its own."""

    topic: str
    notes: list[str]
    places: dict[str, dict[str, int]] = field(default_factory=dict)
    moved: bool = False

    def order(self, at: str, names: Any) -> list[int] | None:
        """The places of the elements of a message; None where nothing names them."""
        if not isinstance(names, list) or not names or len(set(names)) < len(names):
            return None
        if not all(isinstance(n, str) for n in names):
            return None
        known = self.places.setdefault(at, {})
        found = [known.setdefault(n, len(known)) for n in names]
        if not self.moved and found != list(range(len(names))):
            self.moved = True
            self.notes.append(
                f"{self.topic}: messages name their elements in several orders: each keeps its place, by the "
                "first message with its name"
            )
        return found


def _numbers(
    value: Any, at: str, left: Counter[str], named: _Named, order: list[int] | None = None
) -> Iterator[tuple[str, float | int | bool]]:
    """Numbers in nested messages and in arrays; texts are no channels, nor the stamp of a header."""
    if is_dataclass(value):
        order = named.order(at, getattr(value, "name", None))
        for one in fields(value):
            if one.name not in ("header", "__msgtype__") and not (one.name == "name" and order):
                inner = getattr(value, one.name)
                yield from _numbers(inner, f"{at}.{one.name}" if at else one.name, left, named, order)
    elif isinstance(value, bool | int | float | np.number | np.bool_):
        yield at or "value", value.item() if isinstance(value, np.generic) else value
    elif isinstance(value, np.ndarray | list | tuple) and len(value) <= LONGEST:
        places = order if order and len(order) == len(value) else range(len(value))
        for i, inner in zip(places, value, strict=True):
            yield from _numbers(inner, f"{at}[{i}]", left, named)
    else:
        left[at] += 1
