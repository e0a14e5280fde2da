"""Operations of FMI-LS-BUS on CAN, written and read in Python: a second opinion on operations.c.

Source: fmi3LsBus.h and fmi3LsBusCan.h of FMI-LS-BUS 1.0.0, Modelica Association.
"""

import struct
from collections.abc import Iterator

TRANSMIT, CONFIRM, LOST, BUS_ERROR, CONFIGURATION, STATUS, WAKEUP = 0x10, 0x20, 0x30, 0x31, 0x40, 0x41, 0x42
FORMAT_ERROR = 0x01
BUFFER, DISCARD = 1, 2


def operation(code: int, arguments: bytes = b"") -> bytes:
    """Code, whole length, arguments."""
    return struct.pack("<II", code, 8 + len(arguments)) + arguments


def transmit(identifier: int, data: bytes, extended: bool = True) -> bytes:
    """A frame of classical CAN."""
    return operation(TRANSMIT, struct.pack("<IBBH", identifier, extended, 0, len(data)) + data)


def baudrate(bits_per_s: int) -> bytes:
    """The configuration of the bit rate."""
    return operation(CONFIGURATION, struct.pack("<BI", 1, bits_per_s))


def behaviour(kind: int) -> bytes:
    """What is to become of frames that lose arbitration."""
    return operation(CONFIGURATION, struct.pack("<BB", 4, kind))


def read(content: bytes) -> Iterator[tuple[int, bytes]]:
    """(code, arguments) of each operation."""
    while content:
        code, length = struct.unpack_from("<II", content)
        yield code, content[8:length]
        content = content[length:]


def frames(content: bytes) -> list[tuple[int, bytes]]:
    """(identifier, data) of the frames among them."""
    return [
        (struct.unpack_from("<I", arguments)[0], arguments[8:])
        for code, arguments in read(content)
        if code == TRANSMIT
    ]


def identifiers(content: bytes, wanted: int) -> list[int]:
    """Identifiers of the operations of one code."""
    return [struct.unpack_from("<I", a)[0] for code, a in read(content) if code == wanted]


def bits(identifier: int, data: bytes) -> int:
    """Bits of an extended frame from its start to its end, stuff bits included, by strings of bits."""
    head = f"{identifier:029b}"
    text = f"0{head[:11]}11{head[11:]}000{len(data):04b}" + "".join(f"{b:08b}" for b in data)
    crc = 0
    for bit in text:
        crc = ((crc << 1) & 0x7FFF) ^ (0x4599 if (crc >> 14) ^ int(bit) else 0)
    stuffed = ""
    for bit in text + f"{crc:015b}":
        stuffed += bit
        if len(stuffed) >= 5 and len(set(stuffed[-5:])) == 1:
            stuffed += "1" if bit == "0" else "0"
    return len(stuffed) + 10
