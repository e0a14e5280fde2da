"""The CAN database (DBC) of `specs/signals.toml`: J1939 identifiers, cycle times, values, receivers."""

from collections.abc import Iterable, Iterator

from specs.e2e import COUNTER_BITS, CRC_BITS, LAST_COUNT
from specs.signals import Definition, Signal, definition
from specs.wire import CanPlace, Message, bus_load

EXTENDED = 1 << 31  # a DBC marks a 29-bit identifier by this bit

# Kinds of signals as the tools' J1939 databases list them; the last two are what protects a message.
SIGNAL_TYPES = (
    *("Default", "Range", "RangeSigned", "ASCII", "Discrete", "Control", "ReferencePGN", "DTC"),
    *("StringDelimiter", "StringLength", "StringLengthControl", "MessageCounter", "MessageChecksum"),
)
PROFILE = "AUTOSAR profile 1A"

HEADER = """VERSION "1"

NS_ :
\tNS_DESC_
\tCM_
\tBA_DEF_
\tBA_
\tVAL_
\tBA_DEF_DEF_

BS_:
"""

ATTRIBUTES = """BA_DEF_ "BusType" STRING ;
BA_DEF_ "ProtocolType" STRING ;
BA_DEF_ "Baudrate" INT 0 1000000;
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_ BO_ "GenMsgSendType" ENUM "Cyclic","Event";
BA_DEF_ BO_ "E2EProfile" STRING ;
BA_DEF_ BO_ "E2EDataID" INT -1 65535;
BA_DEF_ SG_ "SigType" ENUM {kinds};
BA_DEF_ SG_ "GenSigStartValue" FLOAT 0 4294967295;
BA_DEF_ SG_ "GenSigTimeoutTime" INT 0 65535;
BA_DEF_DEF_ "BusType" "CAN";
BA_DEF_DEF_ "ProtocolType" "";
BA_DEF_DEF_ "Baudrate" 250000;
BA_DEF_DEF_ "VFrameFormat" "J1939PG";
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_DEF_DEF_ "GenMsgSendType" "Cyclic";
BA_DEF_DEF_ "E2EProfile" "";
BA_DEF_DEF_ "E2EDataID" -1;
BA_DEF_DEF_ "SigType" "Default";
BA_DEF_DEF_ "GenSigStartValue" 0;
BA_DEF_DEF_ "GenSigTimeoutTime" 0;
""".format(kinds=",".join(f'"{kind}"' for kind in SIGNAL_TYPES))


def render() -> str:
    """Return the DBC as text (ASCII, so that every tool reads it)."""
    spec = definition()
    parts = [HEADER, f"BU_: {' '.join(spec.bus.nodes)}\n"]
    parts += [_message(message, _of(message, spec)) for message in spec.bus.messages.values()]
    parts += [_lines(_comments(spec)), ATTRIBUTES + _lines(_values_of_attributes(spec))]
    parts += [_lines(_enumerations(spec))]
    return "\n".join(parts)


def _of(message: Message, spec: Definition) -> list[tuple[Signal, CanPlace]]:
    """The signals of one message by their place in it."""
    found = [(s, s.can) for s in spec.signals.values() if s.can and s.can.message == message.name]
    return sorted(found, key=lambda pair: pair[1].start)


def _message(message: Message, signals: list[tuple[Signal, CanPlace]]) -> str:
    head = f"BO_ {message.frame_id | EXTENDED} {message.name}: {message.length} {message.sender}"
    protection = (_protection(field, bits, message) for field, bits, _ in _protections(message))
    return _lines([head, *protection, *(_signal(s, can, message.receivers) for s, can in signals)])


def _protections(message: Message) -> list[tuple[str, range, str]]:
    """Name, bits and kind of the fields that protect a message."""
    if message.data_id is None:
        return []
    fields = (("crc", CRC_BITS, "MessageChecksum"), ("counter", COUNTER_BITS, "MessageCounter"))
    return [(f"{message.name}_{field}", bits, kind) for field, bits, kind in fields]


def _protection(name: str, bits: range, message: Message) -> str:
    top = LAST_COUNT if bits == COUNTER_BITS else 255
    return f' SG_ {name} : {bits.start}|{len(bits)}@1+ (1,0) [0|{top}] "" {",".join(message.receivers)}'


def _signal(s: Signal, can: CanPlace, receivers: Iterable[str]) -> str:
    order, sign = int(can.byte_order == "little_endian"), "-" if can.signed else "+"
    unit = "" if s.unit == "1" else s.unit
    return (
        f" SG_ {s.name} : {can.start}|{can.length}@{order}{sign} ({_number(can.scale)},{_number(can.offset)})"
        f' [{_number(s.min or 0)}|{_number(s.max or 0)}] "{unit}" {",".join(receivers)}'
    )


def _comments(spec: Definition) -> Iterator[str]:
    load = f"bus load at most {100 * bus_load(spec.bus):.0f} % of {spec.bus.bit_rate // 1000} kbit/s"
    yield f'CM_ "Generated from specs/signals.toml by slewright generate, do not edit; SI units; {load}";'
    for message in spec.bus.messages.values():
        yield f'CM_ BO_ {message.frame_id | EXTENDED} "{message.description}";'
        for s, _ in _of(message, spec):
            yield f'CM_ SG_ {message.frame_id | EXTENDED} {s.name} "{s.description}";'


def _values_of_attributes(spec: Definition) -> Iterator[str]:
    yield 'BA_ "ProtocolType" "J1939";'
    yield f'BA_ "Baudrate" {spec.bus.bit_rate};'
    for message in spec.bus.messages.values():
        frame = message.frame_id | EXTENDED
        yield f'BA_ "VFrameFormat" BO_ {frame} 3;'
        yield f'BA_ "GenMsgCycleTime" BO_ {frame} {message.cycle_ms};'
        if message.data_id is not None:
            yield f'BA_ "E2EProfile" BO_ {frame} "{PROFILE}";'
            yield f'BA_ "E2EDataID" BO_ {frame} {message.data_id};'
        for name, _, kind in _protections(message):
            yield f'BA_ "SigType" SG_ {frame} {name} {SIGNAL_TYPES.index(kind)};'
        for s, can in _of(message, spec):
            yield f'BA_ "GenSigStartValue" SG_ {frame} {s.name} {round((s.start - can.offset) / can.scale)};'
            yield f'BA_ "GenSigTimeoutTime" SG_ {frame} {s.name} {round(1000 * (s.timeout_s or 0))};'


def _enumerations(spec: Definition) -> Iterator[str]:
    """Flags and enumerations, with J1939's two reserved numbers at the top of the field."""
    for s in spec.signals.values():
        if s.can and s.values:
            top = (1 << s.can.length) - 1
            values = {**s.values, top - 1: "error", top: "not_available"}
            entries = " ".join(f'{number} "{text}"' for number, text in sorted(values.items()))
            yield f"VAL_ {spec.bus.messages[s.can.message].frame_id | EXTENDED} {s.name} {entries} ;"


def _number(value: float) -> str:
    return str(int(value)) if value == int(value) else repr(value)


def _lines(lines: Iterable[str]) -> str:
    return "".join(f"{line}\n" for line in lines)
