"""Which signal is where: its place on every bus, in recordings and in FMUs, as one table.

`places.csv` is for programs and for grep; docs/reference/places.md is for people.
"""

import csv
import io
from collections.abc import Callable

from specs import canopen, markdown, opcua, ros2
from specs.markdown import number
from specs.signals import Signal, definition

MADE = "Generated from specs/signals.toml and specs/canopen.toml by slewright generate; do not edit."
TEXT = """Where each signal is. [Signals](signals.md) has units, ranges, rates and meanings.

- **CAN**: message, identifier, first bit + number of bits ([DBC](../../specs/generated/slewright.dbc)).
- **CANopen**: device, object, identifier of the PDO, first bit + number of bits ([how-to](../how-to/canopen.md)). A signal
  that is for several devices is named with all of them.
- **Modbus**: table and address, from 0 ([map](../../specs/generated/modbus_map.csv)).
- **OPC UA**: node in the namespace `urn:slewright:machine` ([how-to](../how-to/opcua.md)); targets are set by methods.
- **ROS 2**: every signal is a field of `/slewright/signals`; what is in a standard message, too, is named here
  ([how-to](../how-to/ros2.md)).
- **MCAP, Foxglove**: field of `/tick`, live and recorded, and its number in the Protocol Buffers message.
- **FMI**: value reference, causality in an FMU of the machine and of a controller.

The same table as a file: [places.csv](../../specs/generated/places.csv)."""  # noqa: E501
AXES = ("slew", "boom", "stick")


def standard() -> dict[str, str]:
    """Signals that are in a message of ROS 2's standard packages: topic and field."""
    found: dict[str, str] = {}
    for i, joint in enumerate(AXES):
        found[f"q_{joint}"] = f"/joint_states.position[{i}]"
        found[f"qd_{joint}"] = f"/joint_states.velocity[{i}]"
        found[f"u_{joint}"] = f"/commands.axes[{i}]"
        found[f"joystick_{joint}"] = f"/operator.axes[{i}]"
    found["imu_tool_roll"], found["imu_tool_pitch"] = (f"/joint_states.position[{i}]" for i in (3, 4))
    for i, joint in enumerate(AXES[1:]):
        found[f"qd_{joint}_ref"] = f"/arm_references.velocity[{i}]"
    for axis in "xyz":
        found[f"target_{axis}"] = f"/target.point.{axis}"
        for imu in ("cabin", "tool"):
            found[f"imu_{imu}_rate_{axis}"] = f"/imu/{imu}.angular_velocity.{axis}"
            found[f"imu_{imu}_acc_{axis}"] = f"/imu/{imu}.linear_acceleration.{axis}"
    return found


def _can(s: Signal) -> str:
    if s.can is None:
        return ""
    frame = definition().bus.messages[s.can.message].frame_id
    return f"{s.can.message} 0x{frame:08X} {s.can.start}+{s.can.length}"


def _canopen(s: Signal) -> str:
    sent = [canopen.sent()[s.name]] if s.name in canopen.sent() else []
    found = [(canopen.TPDO1, *place) for place in sent]
    found += [(canopen.RPDO1, *place) for place in canopen.taken().get(s.name, [])]
    return ", ".join(
        f"{n.name} {p.entry.shown} 0x{pdo + n.id:03X} {p.start}+{p.entry.bits}" for pdo, n, p in found
    )


def _modbus(s: Signal) -> str:
    return f"{s.modbus.table} {s.modbus.address}" if s.modbus else ""


def _opcua(s: Signal) -> str:
    return f"s={opcua.node(s)}" if s.wired else ""


def _method(s: Signal) -> str:
    return next((m.name for m in opcua.METHODS if s.name in m.arguments), "")


def _ros2(s: Signal) -> str:
    return standard().get(s.name, "/slewright/signals" if s.wired else "")


def _command(s: Signal) -> str:
    return f"/slewright/target.{s.name}" if s in ros2.targets() else ""


def _mcap(s: Signal) -> str:
    return f"/tick.{s.name} ({10 * s.vr})" if s.wired else ""


def _fmi(s: Signal) -> str:
    sides = (s.causality("machine") or "–", s.causality("controller") or "–")
    return f"{s.vr} {sides[0]}/{sides[1]}"


COLUMNS: dict[str, Callable[[Signal], object]] = {
    "signal": lambda s: s.name,
    "unit": lambda s: s.unit,
    "CAN": _can,
    "CANopen": _canopen,
    "Modbus": _modbus,
    "OPC UA": _opcua,
    "OPC UA method": _method,
    "ROS 2": _ros2,
    "ROS 2 command": _command,
    "MCAP, Foxglove": _mcap,
    "FMI": _fmi,
}
MORE: dict[str, Callable[[Signal], object]] = {
    "kind": lambda s: s.kind,
    "min": lambda s: number(s.min),
    "max": lambda s: number(s.max),
    "description": lambda s: s.description,
}


def table() -> str:
    """`places.csv`."""
    text = io.StringIO()
    text.write(f"# {MADE}\n")
    columns = {**COLUMNS, **MORE}
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([of(s) for of in columns.values()] for s in definition().signals.values())
    return text.getvalue()


def page() -> str:
    """docs/reference/places.md."""
    rows = [[_shown(name, of(s)) for name, of in COLUMNS.items()] for s in definition().signals.values()]
    head = markdown.head("Which signal is where", "specs/signals.toml", TEXT)
    return f"{head}\n{markdown.table(list(COLUMNS), rows)}"


def _shown(column: str, value: object) -> object:
    return f"`{value}`" if value and column != "unit" else value
