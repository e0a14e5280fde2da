"""ROS 2's types and qualities of service as Cyclone DDS takes them (specs/ros2.py has the fields)."""

import struct
from functools import cache
from typing import Any

from cyclonedds.core import Listener as Listener
from cyclonedds.idl import IdlStruct, annotations, make_idl_struct, types
from cyclonedds.qos import Policy, Qos
from cyclonedds.util import duration

from specs.ros2 import dds_type, fields_of, split, type_hash

BASES: dict[str, Any] = {
    "int8": types.int8, "uint8": types.uint8, "int16": types.int16, "uint16": types.uint16,
    "int32": types.int32, "uint32": types.uint32, "int64": types.int64, "uint64": types.uint64,
    "float32": types.float32, "float64": types.float64, "byte": types.uint8, "char": types.uint8,
    "bool": bool, "string": str, "string<=256": str,
}  # fmt: skip
BLOCKS = duration(milliseconds=5)  # for which a write may wait for readers that are slow


class Unreadable:
    """In the place of a message that cannot be read; `why` is for people."""

    sample_info: Any = None  # as of a message, of which the reader sets it

    def __init__(self, why: str) -> None:
        self.why = why


def _careful(cls: Any, *given: Any, **named: Any) -> Any:
    """The message of some bytes, or what stands in its place: what anybody may send ends no process.

    DDS looks at the bytes of a message before it brings it, but not whether its texts are UTF-8.
    """
    try:
        return IdlStruct.deserialize.__func__(cls, *given, **named)  # type: ignore[attr-defined]
    except (ValueError, LookupError, struct.error) as error:
        return Unreadable(str(error))


@cache
def message(name: str) -> Any:
    """The class of a type's messages."""
    fields: dict[str, Any] = {}
    if name.split("/")[1] == "srv":  # rmw_cyclonedds puts who asked, and the number of the request, before it
        fields |= {"guid": types.uint64, "seq": types.int64}
    for field, kind in fields_of(name):
        base, count = split(kind)
        one = BASES[base] if base in BASES else message(base)
        fields[field] = one if count is None else types.array[one, count] if count else types.sequence[one]
    plain = name.rsplit("/", 1)[1]
    made: Any = annotations.final(make_idl_struct(plain, dds_type(name).replace("::", "."), fields))
    made.deserialize = classmethod(_careful)
    return made


def topic_name(name: str) -> str:
    """A topic's name on the wire: `/joint_states` is `rt/joint_states`."""
    return f"rt{name}"


def service_topics(name: str) -> tuple[str, str]:
    """A service's topics on the wire: requests and replies."""
    return f"rq{name}Request", f"rr{name}Reply"


def qos(
    name: str,
    depth: int = 1,
    latched: bool = False,
    reliable: bool = True,
    hashed: bool = True,
    told: str = "",
) -> Qos:
    """ROS 2's quality of service: reliable or best effort, keep last, volatile or transient local.

    The type's hash goes with it, as Jazzy's middleware sends it; without `hashed`, `told` does.
    """
    chosen = [
        Policy.Reliability.Reliable(BLOCKS) if reliable else Policy.Reliability.BestEffort,
        Policy.History.KeepLast(depth),
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
    ]
    if latched:  # what a late subscriber gets: the last message alone, unless this says more
        chosen.append(Policy.DurabilityService(0, Policy.History.KeepLast(depth), -1, -1, -1))
    if hashed:
        told = f"typehash={type_hash(name)};"
    if told:
        chosen.append(Policy.Userdata(told.encode()))
    return Qos(*chosen)
