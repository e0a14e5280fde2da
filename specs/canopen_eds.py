"""EDS and DCF files of the CANopen devices (CiA 306), and what the controller writes to them at the start.

An EDS says what a kind of device has; a DCF also what one node of it is set to.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from specs.canopen import PDO_BYTES, RPDO1, TPDO1, TYPES, Device, Entry, Node, Place, definition

VARIABLE, ARRAY, RECORD = 7, 8, 9  # kinds of objects
NOT_VALID = 0x8000_0000  # in a PDO's identifier: it is switched off
EVERY_SYNC, AT_ONCE = 1, 255  # transmission types
DEVICE_TYPE, ERROR_REGISTER, IDENTITY, HEARTBEAT_TIME = 0x1000, 0x1001, 0x1018, 0x1017
TPDO_SET, TPDO_MAP, RPDO_SET, RPDO_MAP = 0x1800, 0x1A00, 0x1400, 0x1600
MAPPED = 4  # objects that a PDO of the simulated devices has room for
BIT_RATES = (10, 20, 50, 125, 250, 500, 800, 1000)
UNSIGNED8, UNSIGNED16, UNSIGNED32, TEXT = (
    *(TYPES[f"UNSIGNED{bits}"][0] for bits in (8, 16, 32)),
    9,
)
TEXTS = {
    DEVICE_TYPE: "Device type",
    ERROR_REGISTER: "Error register",
    0x1005: "COB-ID SYNC",
    0x1008: "Manufacturer device name",
    0x1014: "COB-ID EMCY",
    HEARTBEAT_TIME: "Producer heartbeat time",
    IDENTITY: "Identity object",
    RPDO_SET: "RPDO 1 communication parameter",
    RPDO_MAP: "RPDO 1 mapping parameter",
    TPDO_SET: "TPDO 1 communication parameter",
    TPDO_MAP: "TPDO 1 mapping parameter",
}


@dataclass(frozen=True)
class Row:
    """A variable of an object dictionary, as an EDS has it."""

    index: int
    sub: int
    name: str
    type: int
    access: str
    default: str
    pdo: bool = False


@dataclass(frozen=True)
class Download:
    """A number to be written to an object of `bits`."""

    index: int
    sub: int
    bits: int
    value: int

    @property
    def shown(self) -> str:
        """The object as people write it."""
        return f"0x{self.index:04X}:{self.sub}"

    @property
    def data(self) -> bytes:
        """As it goes over the wire."""
        return (self.value & ((1 << self.bits) - 1)).to_bytes(self.bits // 8, "little")


# ---- what is written ----


def downloads(node: Node, zeros: Mapping[str, float]) -> list[Download]:
    """All of it in its order: the device's own objects, then PDOs, switched off while they are changed."""
    bus = definition().bus
    found = [Download(e.index, e.sub, e.bits, value) for e, value in node.written(zeros)]
    if node.sends:
        found += _pdo(TPDO_SET, TPDO_MAP, TPDO1 + node.id, node.sends, [(2, 8, EVERY_SYNC)])
    if node.takes:
        times = [(2, 8, AT_ONCE), (5, 16, bus.stale_ms)]
        found += _pdo(RPDO_SET, RPDO_MAP, RPDO1 + node.id, node.takes, times)
    return [*found, Download(HEARTBEAT_TIME, 0, 16, bus.heartbeat_ms)]


def _pdo(
    parameters: int, mapping: int, cob: int, places: tuple[Place, ...], more: list[tuple[int, int, int]]
) -> list[Download]:
    objects = [p.entry.index << 16 | p.entry.sub << 8 | p.entry.bits for p in places]
    return [
        Download(parameters, 1, 32, cob | NOT_VALID),
        *(Download(parameters, sub, bits, value) for sub, bits, value in more),
        Download(mapping, 0, 8, 0),
        *(Download(mapping, i, 32, value) for i, value in enumerate(objects, 1)),
        Download(mapping, 0, 8, len(objects)),
        Download(parameters, 1, 32, cob),
    ]


# ---- files ----


def files() -> dict[str, str]:
    """The EDS of every kind of device, by its name in specs/generated."""
    return {f"canopen/{d.name}.eds": eds(d) for d in definition().devices.values()}


def eds(device: Device) -> str:
    """The EDS of a kind of device; deterministic to the byte."""
    return _file(device, f"{device.name}.eds", [], {})


def dcf(node: Node, zeros: Mapping[str, float]) -> str:
    """The DCF of a node: its EDS with what the controller writes to it."""
    values = {(d.index, d.sub): d.value for d in downloads(node, zeros)}
    rate = definition().bus.bit_rate // 1000
    head = ["[DeviceComissioning]", f"NodeID={node.id}", f"NodeName={node.name}", f"Baudrate={rate}"]
    return _file(node.device, f"{node.name}.dcf", [*head, "NetNumber=1", "CANopenManager=0", ""], values)


def rows(device: Device) -> list[Row]:
    """All variables of a kind of device, in the order of their indices."""
    found = [
        Row(DEVICE_TYPE, 0, TEXTS[DEVICE_TYPE], UNSIGNED32, "ro", f"0x{device.type:08X}"),
        Row(ERROR_REGISTER, 0, TEXTS[ERROR_REGISTER], UNSIGNED8, "ro", "0"),
        Row(0x1005, 0, TEXTS[0x1005], UNSIGNED32, "rw", f"0x{definition().bus.sync:08X}"),
        Row(0x1008, 0, TEXTS[0x1008], TEXT, "const", f"slewright {device.name}"),
        Row(0x1014, 0, TEXTS[0x1014], UNSIGNED32, "ro", "$NODEID+0x80"),
        Row(HEARTBEAT_TIME, 0, TEXTS[HEARTBEAT_TIME], UNSIGNED16, "rw", "0"),
        *_identity(device),
    ]
    nodes = [n for n in definition().nodes if n.device.name == device.name]
    if any(n.takes for n in nodes):
        found += [*_settings(RPDO_SET, "$NODEID+0x200"), *_mapping(RPDO_MAP)]
    if any(n.sends for n in nodes):
        found += [*_settings(TPDO_SET, "$NODEID+0x180"), *_mapping(TPDO_MAP)]
    return sorted([*found, *_own(device)], key=lambda row: (row.index, row.sub))


def _identity(device: Device) -> Iterator[Row]:
    yield Row(IDENTITY, 0, "Highest sub-index supported", UNSIGNED8, "const", "4")
    values = {"Vendor-ID": device.vendor, "Product code": device.product}
    values |= {"Revision number": device.revision, "Serial number": 1}
    for sub, (name, value) in enumerate(values.items(), 1):
        yield Row(IDENTITY, sub, name, UNSIGNED32, "ro", f"0x{value:08X}")


def _settings(index: int, cob: str) -> Iterator[Row]:
    yield Row(index, 0, "Highest sub-index supported", UNSIGNED8, "const", "5")
    yield Row(index, 1, "COB-ID", UNSIGNED32, "rw", f"{cob}")
    yield Row(index, 2, "Transmission type", UNSIGNED8, "rw", str(AT_ONCE))
    yield Row(index, 3, "Inhibit time", UNSIGNED16, "rw", "0")
    yield Row(index, 5, "Event timer", UNSIGNED16, "rw", "0")


def _mapping(index: int) -> Iterator[Row]:
    yield Row(index, 0, "Number of mapped objects", UNSIGNED8, "rw", "0")
    for sub in range(1, MAPPED + 1):
        yield Row(index, sub, f"Mapped object {sub}", UNSIGNED32, "rw", "0")


def _own(device: Device) -> Iterator[Row]:
    entries = device.object.values()
    for index in sorted({e.index for e in entries if e.sub}):
        highest = max(e.sub for e in entries if e.index == index)
        yield Row(index, 0, "Highest sub-index supported", UNSIGNED8, "const", str(highest))
    for e in entries:
        default = e.value if e.access == "ro" else None  # what can be written is written, so begins elsewhere
        yield Row(e.index, e.sub, e.name, TYPES[e.type][0], e.access, str(default or 0), e.pdo)


def _file(device: Device, name: str, more: list[str], values: Mapping[tuple[int, int], int]) -> str:
    found = rows(device)
    indices = sorted({r.index for r in found})
    mandatory = [i for i in indices if i in (DEVICE_TYPE, ERROR_REGISTER, IDENTITY)]
    own = [i for i in indices if 0x2000 <= i < 0x6000]
    lines = [*_head(device, name, found), *more, "[DummyUsage]"]
    lines += [*(f"Dummy000{i}=0" for i in range(1, 8)), "", "[Comments]", "Lines=1"]
    lines += ["Line1=Generated from specs/canopen.toml by slewright generate; do not edit.", ""]
    lines += _listed("MandatoryObjects", mandatory)
    lines += _listed("OptionalObjects", [i for i in indices if i not in (*mandatory, *own)])
    lines += _listed("ManufacturerObjects", own)
    for index in indices:
        lines += _object(index, [r for r in found if r.index == index], device, values)
    return "\n".join(lines)


def _head(device: Device, name: str, found: list[Row]) -> list[str]:
    rates = [f"BaudRate_{r}={int(r >= 125)}" for r in BIT_RATES]
    has = {r.index for r in found}
    return [
        "[FileInfo]", f"FileName={name}", "FileVersion=1", "FileRevision=0", "EDSVersion=4.0",
        f"Description={device.description}", "CreationTime=12:00AM", "CreationDate=01-01-2026",
        "CreatedBy=slewright", "ModificationTime=12:00AM", "ModificationDate=01-01-2026",
        "ModifiedBy=slewright", "", "[DeviceInfo]", "VendorName=slewright, simulated",
        f"VendorNumber=0x{device.vendor:08X}", f"ProductName={device.name}",
        f"ProductNumber=0x{device.product:08X}", f"RevisionNumber=0x{device.revision:08X}",
        f"OrderCode={device.name}", *rates, "SimpleBootUpMaster=0", "SimpleBootUpSlave=1",
        f"Granularity={PDO_BYTES}", "DynamicChannelsSupported=0", "GroupMessaging=0",
        f"NrOfRXPDO={int(RPDO_SET in has)}", f"NrOfTXPDO={int(TPDO_SET in has)}", "LSS_Supported=0", "",
    ]  # fmt: skip


def _listed(section: str, indices: list[int]) -> list[str]:
    entries = [f"{i}=0x{index:04X}" for i, index in enumerate(indices, 1)]
    return [f"[{section}]", f"SupportedObjects={len(indices)}", *entries, ""]


def _object(
    index: int, found: list[Row], device: Device, values: Mapping[tuple[int, int], int]
) -> Iterator[str]:
    plain = len(found) == 1 and found[0].sub == 0
    if not plain:
        kind = RECORD if index < 0x2000 else ARRAY
        name = TEXTS.get(index) or _name(index, device)
        yield from (f"[{index:04X}]", f"ParameterName={name}", f"ObjectType=0x{kind:X}")
        yield from (f"SubNumber={len(found)}", "")
    for row in found:
        yield f"[{index:04X}]" if plain else f"[{index:04X}sub{row.sub:X}]"
        yield from (f"ParameterName={row.name}", f"ObjectType=0x{VARIABLE:X}")
        yield from (f"DataType=0x{row.type:04X}", f"AccessType={row.access}")
        yield from (f"DefaultValue={row.default}", f"PDOMapping={int(row.pdo)}")
        if (index, row.sub) in values:
            yield f"ParameterValue={values[index, row.sub]}"
        yield ""


def _name(index: int, device: Device) -> str:
    entry: Entry = next(e for e in device.object.values() if e.index == index)
    return entry.name
