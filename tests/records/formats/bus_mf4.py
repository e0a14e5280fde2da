"""An MDF4 file with frames of a CAN bus, block by block as the standard has it: no reader's own writer."""

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

NAME = "CAN_DataFrame"
SIZES = [*range(9), 12, 16, 20, 24, 32, 48, 64]
BYTES, UNSIGNED, FLOAT = 10, 0, 4  # types of data


@dataclass(frozen=True)
class Frame:
    """A frame as it was sent; `stated` bytes where the log states another length."""

    time: float
    identifier: int
    data: bytes
    long: bool = False
    bus: int = 1
    stated: int | None = None
    remote: bool = False
    invalid: bool = False


@dataclass(frozen=True)
class Layout:
    """How a group of frames is laid down."""

    name: str = "CAN"
    per_s: int = 0  # ticks of the clock, 0: seconds as floats
    unit: str = "s"  # of the clock
    width: int = 64  # bytes of a record for data; 0: data stand elsewhere
    parts: Sequence[str] = ("ID", "IDE", "BusChannel", "DLC", "EDL", "DataLength", "DataBytes")
    prefix: str = NAME
    compressed: bool = False
    whole: bool = True  # parts within a channel of the name of the frame
    shift: int = 0  # identifiers are written so much smaller, and a rule makes them whole
    counted: int | None = None  # samples that the file states


@dataclass
class Mf4:
    """The file as it grows."""

    data: bytearray = field(default_factory=lambda: bytearray(64))
    groups: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Put down the head; it starts at 1.7e9 s since 1970."""
        struct.pack_into("<8s8s8s4xH", self.data, 0, b"MDF     ", b"4.11    ", b"test    ", 411)
        self.head = self.block(
            "HD", [0] * 6, struct.pack("<QhhBBBBdd", 1_700_000_000 * 10**9, 0, 0, 2, 0, 0, 0, 0, 0)
        )

    def block(self, kind: str, links: Sequence[int], body: bytes) -> int:
        """Add a block; returns where it stands."""
        self.data += bytes(-len(self.data) % 8)
        at = len(self.data)
        self.data += struct.pack("<4s4xQQ", f"##{kind}".encode(), 24 + 8 * len(links) + len(body), len(links))
        self.data += struct.pack(f"<{len(links)}Q", *links) + body
        return at

    def link(self, at: int, number: int, to: int) -> None:
        """Let a link of a block point to another."""
        struct.pack_into("<Q", self.data, at + 24 + 8 * number, to)

    def text(self, text: str) -> int:
        """A text; 0 for an empty one."""
        return self.block("TX", [], text.encode() + b"\0") if text else 0

    def linear(self, offset: float, factor: float) -> int:
        """A rule for values."""
        return self.block("CC", [0] * 4, struct.pack("<BBHHHdddd", 1, 0, 0, 0, 2, 0, 0, offset, factor))

    def channel(
        self, name: str, byte: int, size: int, kind: int = UNSIGNED, *, unit: str = "", rule: int = 0,
        clock: bool = False, stored: int = 0, flags: int = 0, bit: int = 0,
    ) -> int:  # fmt: skip
        """A channel of `size` bytes; `stored` is where its samples stand if they are elsewhere."""
        links = [0, 0, self.text(name), 0, rule, stored, self.text(unit), 0]
        sort = (2, 1) if clock else (1, 0) if stored else (0, 0)
        body = struct.pack("<BBBBIIIIBBH6d", *sort, kind, 0, byte, 8 * size, flags, bit, 0, 0, 0, *[0.0] * 6)
        return self.block("CN", links, body)

    def group(
        self,
        channels: Sequence[int],
        records: bytes,
        count: int,
        size: int,
        name: str,
        *,
        compressed: bool = False,
        invalid: int = 0,
    ) -> None:
        """A data group of one channel group and its records."""
        for one, after in pairwise(channels):
            self.link(one, 0, after)
        source = self.block("SI", [self.text(name), 0, 0], struct.pack("<BBB5x", 2, 2, 0))
        body = struct.pack("<QQHH4xII", 0, count, 6, 0, size, invalid)
        block = self.block("CG", [0, channels[0], self.text(name), source, 0, 0], body)
        self.groups.append(self.block("DG", [0, block, self.put("DT", records, compressed), 0], bytes(8)))

    def put(self, kind: str, data: bytes, compressed: bool) -> int:
        """Data, deflated or as they are."""
        if not compressed:
            return self.block(kind, [], data)
        small = zlib.compress(data)
        return self.block(
            "DZ", [], struct.pack("<2sBBIQQ", kind.encode(), 0, 0, 0, len(data), len(small)) + small
        )

    def frames(self, frames: Sequence[Frame], how: Layout) -> None:
        """A channel group of frames."""
        width, stored, records = how.width or 8, b"", b""
        for f in frames:
            stated = len(f.data) if f.stated is None else f.stated
            code = next(k for k, n in enumerate(SIZES) if n >= len(f.data))
            number = f.identifier - how.shift | (0 if "IDE" in how.parts else f.long << 31)
            data = f.data.ljust(width, b"\xaa") if how.width else struct.pack("<Q", len(stored))
            stored += struct.pack("<I", len(f.data)) + f.data
            clock = struct.pack("<Q", round(f.time * how.per_s)) if how.per_s else struct.pack("<d", f.time)
            records += clock + struct.pack(
                "<IBBBBBB", number, f.long, f.bus, code, len(f.data) > 8, stated, f.remote
            )
            records += data + bytes([f.invalid])
        at = {"ID": (8, 4), "IDE": (12, 1), "BusChannel": (13, 1), "DLC": (14, 1), "EDL": (15, 1)}
        at |= {"DataLength": (16, 1), "RTR": (17, 1), "DataBytes": (18, width)}
        elsewhere = 0 if how.width else self.put("SD", stored, how.compressed)
        rule = self.linear(how.shift, 1) if how.shift else 0
        parts = [
            self.channel(
                f"{how.prefix}.{part}", *at[part], kind=BYTES if part == "DataBytes" else UNSIGNED,
                rule=rule if part == "ID" else 0, stored=elsewhere if part == "DataBytes" else 0,
                flags=2 if part == "ID" else 0,
            )
            for part in how.parts
        ]  # fmt: skip
        clock = self.channel("Timestamp", 0, 8, UNSIGNED if how.per_s else FLOAT, unit=how.unit, clock=True)
        if how.whole:
            whole = self.channel(how.prefix, 8, 10 + width, BYTES)
            for one, after in pairwise(parts):
                self.link(one, 0, after)
            self.link(whole, 1, parts[0])
            parts = [whole]
        count = len(frames) if how.counted is None else how.counted
        self.group(
            [clock, *parts], records, count, 18 + width, how.name, compressed=how.compressed, invalid=1
        )

    def save(self, path: Path) -> Path:
        """Write the file."""
        for at, to in zip([self.head, *self.groups], self.groups, strict=False):
            self.link(at, 0, to)
        path.write_bytes(self.data)
        return path
