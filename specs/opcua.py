"""Where each signal is in the OPC UA server: its node, data type, unit and the method that sets it.

Units are those of UNECE Recommendation 20, whose three-letter code makes the number of an EUInformation (OPC
10000-8, 5.6.4): each letter a byte, the first one highest.
"""

from dataclasses import dataclass

from specs.errors import InputError, nearest
from specs.signals import Signal

NAMESPACE = "urn:slewright:machine"
UNECE_URI = "http://www.opcfoundation.org/UA/units/un/cefact"
UNECE = {  # unit of specs/units.py -> common code, symbol, name
    "1": ("C62", "1", "one"),
    "rad": ("C81", "rad", "radian"),
    "rad/s": ("2A", "rad/s", "radian per second"),
    "m": ("MTR", "m", "metre"),
    "m/s2": ("MSK", "m/s²", "metre per second squared"),
    "Pa": ("PAL", "Pa", "pascal"),
    "kg": ("KGM", "kg", "kilogram"),
    "K": ("KEL", "K", "kelvin"),
    "V": ("VLT", "V", "volt"),
}
FOLDERS = {
    "command": "Commands", "target": "Targets", "reference": "References", "sensor": "Sensors",
    "status": "Status",
}  # fmt: skip


@dataclass(frozen=True)
class Method:
    """A method of the machine's object; its arguments are signals, in their order."""

    name: str
    description: str
    arguments: tuple[str, ...] = ()


METHODS = (
    Method(
        "SetTarget",
        "Where the grab is to go, how fast, with which load; claims the right to command where nobody has it",
        ("target_x", "target_y", "target_z", "pace", "load_told"),
    ),
    Method("Follow", "Whether the target is to be followed: 1 or 0", ("target_valid",)),
    Method("Heartbeat", "A sign of life, at least twice a second; without it the right to command ends"),
    Method("Release", "Gives the right to command back"),
)


def node(s: Signal) -> str:
    """Identifier of a signal's node, a text in NAMESPACE."""
    return f"{FOLDERS[s.kind]}.{s.name}"


def unit_id(unit: str) -> int:
    """Number of a unit in an EUInformation; raises InputError for a unit without a UNECE code."""
    if unit not in UNECE:
        raise InputError(f"unit '{unit}' has no UNECE code in specs/opcua.py; {nearest(unit, UNECE)}")
    return int.from_bytes(UNECE[unit][0].encode("ascii"), "big")


def is_whole(s: Signal) -> bool:
    """Whether a signal's values are whole numbers (UInt16); the others are Double."""
    return s.modbus is not None and s.modbus.type == "uint16"
