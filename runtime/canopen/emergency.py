"""Emergencies in words: the classes of error codes and the bits of the error register (CiA 301, 7.2.7.1)."""

CLASSES = {
    0x00: "error reset, or no error", 0x10: "generic error", 0x20: "current", 0x21: "current at the input",
    0x22: "current inside", 0x23: "current at the output", 0x30: "voltage", 0x31: "supply voltage",
    0x32: "voltage inside", 0x33: "output voltage", 0x40: "temperature", 0x41: "ambient temperature",
    0x42: "device temperature", 0x50: "hardware", 0x60: "software", 0x61: "internal software",
    0x62: "user software", 0x63: "data set", 0x70: "additional modules", 0x80: "monitoring",
    0x81: "communication", 0x82: "protocol", 0x90: "external error", 0xF0: "additional functions",
    0xFF: "of the device's own kind",
}  # fmt: skip
REGISTER = ("generic", "current", "voltage", "temperature", "communication", "profile", "reserved", "maker's")
LENGTH = 8


def text(data: bytes) -> str:
    """What an emergency says."""
    if len(data) < 3:
        return f"an emergency of {len(data)} bytes, which says nothing"
    code, register = int.from_bytes(data[:2], "little"), data[2]
    if code == 0:
        return "emergency is over" if register == 0 else "an error is over, others are there"
    kind = CLASSES.get(code >> 8) or CLASSES.get(code >> 8 & 0xF0, "of an unknown class")
    bits = ", ".join(name for i, name in enumerate(REGISTER) if register >> i & 1) or "empty"
    own = data[3:LENGTH].hex(" ") if any(data[3:]) else ""
    return f"emergency 0x{code:04X} ({kind}), error register: {bits}" + (
        f", maker's bytes {own}" if own else ""
    )
