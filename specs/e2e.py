"""End-to-end protection of CAN messages: AUTOSAR's E2E profile 1, variant 1A, with both bytes of the data ID.

Byte 0 holds a CRC-8 (SAE J1850: x^8 + x^4 + x^3 + x^2 + 1; in this profile start value and final XOR are 0)
over the data ID, low byte first, and all other bytes.  Bits 8 to 11 count the messages, 0 to 14 and round;
15 is no count.  Source: AUTOSAR FO R22-11, PRS E2E Protocol Specification, 6.3 (profile 1).
"""

CRC_BITS = range(8)
COUNTER_BITS = range(8, 12)
LAST_COUNT = 14
POLYNOMIAL = 0x1D


def _shifted(byte: int) -> int:
    """The CRC register after one byte."""
    for _ in range(8):
        byte = (byte << 1 ^ POLYNOMIAL) & 0xFF if byte & 0x80 else byte << 1
    return byte


TABLE = tuple(_shifted(byte) for byte in range(256))


def start(data_id: int) -> int:
    """The CRC over a data ID, with which every message of it begins."""
    return TABLE[TABLE[data_id & 0xFF] ^ data_id >> 8]


def crc(begun: int, data: bytes | bytearray) -> int:
    """The CRC-8 of a message's data, its byte 0 left out; `begun` is `start(data_id)`."""
    value = begun
    for byte in data[1:]:
        value = TABLE[value ^ byte]
    return value


def protect(data: bytearray, data_id: int, count: int) -> None:
    """Set counter and CRC of a message."""
    data[1] = data[1] & 0xF0 | count
    data[0] = crc(start(data_id), data)
