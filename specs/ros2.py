"""ROS 2's message types: those that are used of its standard packages, and our own, made from the signals.

A type is a table of fields.  From it come the `.msg` and `.idl` files of the package `slewright_msgs`, the
types on the wire (runtime/ros2/wire.py), and the type hash that ROS 2 peers compare (RIHS01: ROS Enhancement
Proposal 2016, SHA-256 over the type's description as JSON).
"""

import json
import re
from collections.abc import Iterator
from functools import cache
from hashlib import sha256

from specs.errors import InputError, nearest
from specs.signals import Signal, definition

PACKAGE = "slewright_msgs"
SIGNALS, TARGET, POLICY = (f"{PACKAGE}/msg/{name}" for name in ("Signals", "Target", "PolicyCommand"))
MADE = "Generated from specs/signals.toml by slewright generate; do not edit."
STANDARD = """
builtin_interfaces/msg/Time: int32 sec, uint32 nanosec
std_msgs/msg/Header: builtin_interfaces/msg/Time stamp, string frame_id
std_msgs/msg/String: string data
geometry_msgs/msg/Vector3: float64 x, float64 y, float64 z
geometry_msgs/msg/Point: float64 x, float64 y, float64 z
geometry_msgs/msg/Quaternion: float64 x, float64 y, float64 z, float64 w
geometry_msgs/msg/PointStamped: std_msgs/msg/Header header, geometry_msgs/msg/Point point
sensor_msgs/msg/JointState: std_msgs/msg/Header header, string[] name, float64[] position, float64[] velocity, float64[] effort
sensor_msgs/msg/Imu: std_msgs/msg/Header header, geometry_msgs/msg/Quaternion orientation, float64[9] orientation_covariance, geometry_msgs/msg/Vector3 angular_velocity, float64[9] angular_velocity_covariance, geometry_msgs/msg/Vector3 linear_acceleration, float64[9] linear_acceleration_covariance
sensor_msgs/msg/Joy: std_msgs/msg/Header header, float32[] axes, int32[] buttons
diagnostic_msgs/msg/KeyValue: string key, string value
diagnostic_msgs/msg/DiagnosticStatus: byte level, string name, string message, string hardware_id, diagnostic_msgs/msg/KeyValue[] values
diagnostic_msgs/msg/DiagnosticArray: std_msgs/msg/Header header, diagnostic_msgs/msg/DiagnosticStatus[] status
rosgraph_msgs/msg/Clock: builtin_interfaces/msg/Time clock
rcl_interfaces/msg/Log: builtin_interfaces/msg/Time stamp, uint8 level, string name, string msg, string file, string function, uint32 line
rcl_interfaces/msg/FloatingPointRange: float64 from_value, float64 to_value, float64 step
rcl_interfaces/msg/IntegerRange: int64 from_value, int64 to_value, uint64 step
rcl_interfaces/msg/ListParametersResult: string[] names, string[] prefixes
rcl_interfaces/msg/ParameterValue: uint8 type, bool bool_value, int64 integer_value, float64 double_value, string string_value, byte[] byte_array_value, bool[] bool_array_value, int64[] integer_array_value, float64[] double_array_value, string[] string_array_value
rcl_interfaces/msg/Parameter: string name, rcl_interfaces/msg/ParameterValue value
rcl_interfaces/msg/ParameterDescriptor: string name, uint8 type, string description, string additional_constraints, bool read_only, bool dynamic_typing, rcl_interfaces/msg/FloatingPointRange[<=1] floating_point_range, rcl_interfaces/msg/IntegerRange[<=1] integer_range
rcl_interfaces/msg/SetParametersResult: bool successful, string reason
rmw_dds_common/msg/Gid: char[16] data
rmw_dds_common/msg/NodeEntitiesInfo: string<=256 node_namespace, string<=256 node_name, rmw_dds_common/msg/Gid[] reader_gid_seq, rmw_dds_common/msg/Gid[] writer_gid_seq
rmw_dds_common/msg/ParticipantEntitiesInfo: rmw_dds_common/msg/Gid gid, rmw_dds_common/msg/NodeEntitiesInfo[] node_entities_info_seq
std_srvs/srv/Trigger_Request: uint8 structure_needs_at_least_one_member
std_srvs/srv/Trigger_Response: bool success, string message
std_srvs/srv/SetBool_Request: bool data
std_srvs/srv/SetBool_Response: bool success, string message
rcl_interfaces/srv/ListParameters_Request: string[] prefixes, uint64 depth
rcl_interfaces/srv/ListParameters_Response: rcl_interfaces/msg/ListParametersResult result
rcl_interfaces/srv/GetParameters_Request: string[] names
rcl_interfaces/srv/GetParameters_Response: rcl_interfaces/msg/ParameterValue[] values
rcl_interfaces/srv/GetParameterTypes_Request: string[] names
rcl_interfaces/srv/GetParameterTypes_Response: uint8[] types
rcl_interfaces/srv/DescribeParameters_Request: string[] names
rcl_interfaces/srv/DescribeParameters_Response: rcl_interfaces/msg/ParameterDescriptor[] descriptors
rcl_interfaces/srv/SetParameters_Request: rcl_interfaces/msg/Parameter[] parameters
rcl_interfaces/srv/SetParameters_Response: rcl_interfaces/msg/SetParametersResult[] results
rcl_interfaces/srv/SetParametersAtomically_Request: rcl_interfaces/msg/Parameter[] parameters
rcl_interfaces/srv/SetParametersAtomically_Response: rcl_interfaces/msg/SetParametersResult result
"""  # noqa: E501
# Numbers of rcl_interfaces' TypeDescription: of a value; + 48 array, + 96 bounded sequence, + 144 sequence.
TYPE_IDS = {
    "int8": 2, "uint8": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8, "uint64": 9,
    "float32": 10, "float64": 11, "char": 13, "bool": 15, "byte": 16, "string": 17, "string<=256": 21,
}  # fmt: skip
NESTED, ARRAY, BOUNDED, SEQUENCE = 1, 48, 96, 144
IDL = {"float32": "float", "float64": "double", "bool": "boolean", "byte": "octet"}
FIELD = re.compile(r"([\w/]+(?:<=256)?)(\[(?:<=(\d+)|(\d*))\])?")
Fields = tuple[tuple[str, str], ...]  # name and type


@cache
def types() -> dict[str, Fields]:
    """Fields of every type by its name, PACKAGE/msg/NAME."""
    found: dict[str, Fields] = {}
    for line in STANDARD.strip().splitlines():
        name, fields = line.split(": ")
        pairs = (field.split(" ") for field in fields.split(", "))
        found[name] = tuple((field, kind) for kind, field in pairs)
    header = ("header", "std_msgs/msg/Header")
    values = [(s.name, "float64") for s in wired()]
    status = [(f"{s.name}_status", "uint8") for s in wired()]
    found[SIGNALS] = (header, ("tick", "int64"), *values, *status)
    found[TARGET] = (header, *((s.name, "bool" if s.values else "float64") for s in targets()))
    found[POLICY] = (header, *((s.name, "float64" if s.nominal else "uint8") for s in references()))
    return found


def wired() -> list[Signal]:
    """The signals that the messages hold."""
    return [s for s in definition().signals.values() if s.wired]


def targets() -> list[Signal]:
    """What a publisher of Target says; its messages themselves are the sign of life."""
    counted = ("planner_heartbeat", "target_number")
    return [s for s in definition().signals.values() if s.kind == "target" and s.name not in counted]


def references() -> list[Signal]:
    """What a policy outside says in each message; the one without a nominal size counts its messages."""
    return [s for s in definition().signals.values() if s.kind == "reference"]


def fields_of(name: str) -> Fields:
    """Fields of a type; raises InputError with the nearest names."""
    if name not in types():
        raise InputError(f"no ROS 2 type '{name}'; {nearest(name, types())}")
    return types()[name]


def split(kind: str) -> tuple[str, int | None]:
    """A field's type without its brackets, and their number: None: one value, 0: a sequence."""
    match = FIELD.fullmatch(kind)
    if not match:
        raise InputError(f"no ROS 2 type of a field: '{kind}'")
    return match[1], None if match[2] is None else int(match[4] or 0)


@cache
def type_hash(name: str) -> str:
    """RIHS01 of a type."""
    nested = sorted(_nested(name))
    told = {
        "type_description": _description(name),
        "referenced_type_descriptions": [_description(n) for n in nested],
    }
    return f"RIHS01_{sha256(json.dumps(told).encode()).hexdigest()}"


def _nested(name: str) -> set[str]:
    direct = {split(kind)[0] for _, kind in fields_of(name)} - TYPE_IDS.keys()
    return direct.union(*(_nested(n) for n in direct))


def _description(name: str) -> dict[str, object]:
    return {"type_name": name, "fields": [_field(*field) for field in fields_of(name)]}


def _field(name: str, kind: str) -> dict[str, object]:
    base, count = split(kind)
    match = FIELD.fullmatch(kind)
    most = int(match[3] or 0) if match else 0
    many = 0 if count is None else ARRAY if count else BOUNDED if most else SEQUENCE
    number = TYPE_IDS.get(base, NESTED) + many
    told = {
        "type_id": number,
        "capacity": count or most,
        "string_capacity": int(base.partition("<=")[2] or 0),
    }
    return {"name": name, "type": {**told, "nested_type_name": "" if base in TYPE_IDS else base}}


def dds_type(name: str) -> str:
    """A type's name on the wire."""
    package, folder, plain = name.split("/")
    return f"{package}::{folder}::dds_::{plain}_"


def files() -> dict[str, str]:
    """The package's files: `.msg` for people who build it, `.idl` for every other DDS."""
    found = {}
    for name in (SIGNALS, TARGET, POLICY):
        plain = name.rsplit("/", 1)[1]
        found[f"{PACKAGE}/msg/{plain}.msg"] = "\n".join(_msg(name)) + "\n"
        found[f"{PACKAGE}/msg/{plain}.idl"] = "\n".join(_idl(name)) + "\n"
    return found


def _msg(name: str) -> Iterator[str]:
    yield f"# {MADE}"
    yield f"# type hash {type_hash(name)}"
    about = {s.name: f"  # {s.description} [{s.unit}]" for s in wired()}
    for field, kind in fields_of(name):
        yield f"{kind.replace('/msg/', '/')} {field}{about.get(field, '')}"


def _idl(name: str) -> Iterator[str]:
    package, folder, plain = name.split("/")
    yield f"// {MADE}"
    yield f"// type hash {type_hash(name)}"
    nested = sorted({split(kind)[0] for _, kind in fields_of(name)} - TYPE_IDS.keys())
    yield from (f'#include "{n}.idl"' for n in nested)
    yield f"module {package} {{ module {folder} {{"
    yield f"  @final struct {plain} {{"
    for field, kind in fields_of(name):
        base, _ = split(kind)
        yield f"    {IDL.get(base, base.replace('/', '::'))} {field};"
    yield "  };"
    yield "}; };"
