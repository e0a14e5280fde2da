"""Channel groups of an MDF file: their names, their clocks, and whether all their samples are there."""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from records.formats.units import seconds

TIME = 1  # MDF4's synchronisation type; MDF3 knows no other
KINDS = (
    r"CAN_[A-Z][a-z]+Frame|LIN_(?:Frame|WakeUp|\w+Error)|FLX_(?:Frame|NullFrame|ErrorFrame|Pdu|Symbol)"
    r"|ETH_(?:Frame|\w+Error)|MOST_(?:Message|Packet|EthernetPacket)"
)
EVENT = re.compile(rf"^(?:\w+\.)?(?P<kind>{KINDS})(?:\.(?P<part>[A-Za-z]+))?$")  # a channel of bus logging
FRAME = "CAN_DataFrame"
STORED = 1  # MDF4's type of a channel whose samples stand elsewhere, each behind its length
LENGTH = 4  # bytes of that
HEAD = struct.Struct("<4s4xQQ")  # of a block: its kind, its length, how many links it has


def label_of(group: Any, number: int) -> str:
    """What the file calls a group, else its number."""
    return str(getattr(group.channel_group, "acq_name", "") or f"group{number + 1}")


def bus_event(group: Any) -> str:
    """What a group holds of a bus, such as CAN_DataFrame; "" where it holds other channels."""
    found = (EVENT.match(c.name) for c in group.channels)
    return next((match["kind"] for match in found if match), "")


def clock_of(file: Any, number: int) -> int | None:
    """The channel that is the group's time; None where its samples are over something else."""
    master = file.masters_db.get(number)
    channels = file.groups[number].channels
    return None if master is None or getattr(channels[master], "sync_type", TIME) != TIME else master


def check_places(group: Any, label: str) -> None:
    """Raise ValueError where a channel is not within its record, or a record not in the file: asammdf would
    read beyond it.
    """
    block = group.channel_group
    size = _record_size(block)
    for channel in group.channels:
        if hasattr(channel, "byte_offset"):
            first = 8 * channel.byte_offset + channel.bit_offset
        else:
            first = channel.start_offset + 8 * channel.additional_byte_offset
        if first + channel.bit_count > 8 * size:
            raise ValueError(f"{channel.name} of {label} is beyond its record")
    if group.channels and not getattr(group, "uses_ld", False):
        there = sum(b.original_size for b in group.get_data_blocks())
        if there < block.cycles_nr * size:
            raise ValueError(f"{label} states {block.cycles_nr} samples, of which {there // size} are there")


def _record_size(block: Any) -> int:
    """Bytes of one sample of all channels of a group."""
    return block.samples_byte_nr + getattr(block, "invalidation_bytes_nr", 0)


def uncounted(path: Path, group: Any, label: str) -> list[str]:
    """What to say of samples that stand in the file behind those that it counts."""
    head, block = group.data_group, group.channel_group
    size = _record_size(block)
    if head.id != b"##DG" or head.record_id_len or not size or not head.data_block_addr:
        return []  # MDF3, or records of several groups in turn
    with path.open("rb") as stream:
        more = sum(_sizes(stream, head.data_block_addr, set())) // size - block.cycles_nr
    return [f"{label}: {more} samples behind the {block.cycles_nr} that it states are not read"] * (more > 0)


def _sizes(stream: BinaryIO, address: int, seen: set[int]) -> Iterator[int]:
    """The bytes of data in each block from an address on, before they were compressed; each block once."""
    while address and address not in seen:
        seen.add(address)
        stream.seek(address)
        kind, length, links = HEAD.unpack(stream.read(HEAD.size))
        to = struct.unpack(f"<{links}Q", stream.read(8 * links))
        address = to[0] if kind in (b"##HL", b"##DL") and to else 0
        if kind == b"##DT":
            yield length - HEAD.size
        elif kind == b"##DZ":
            yield struct.unpack("<8xQ", stream.read(16))[0]
        elif kind == b"##DL":
            for part in to[1:]:
                yield from _sizes(stream, part, seen)


def in_seconds(file: Any, number: int, master: int, label: str, time: np.ndarray) -> np.ndarray:
    """The group's times in s: MDF has s, but a unit that says otherwise is believed."""
    channel = file.groups[number].channels[master]
    unit = getattr(channel, "unit", "") or getattr(channel.conversion, "unit", "") or "s"
    unit = unit.decode("latin-1").strip("\0 ") if isinstance(unit, bytes) else unit
    return seconds(time, unit or "s", f"the time of {label}")


@dataclass(frozen=True)
class Stored:
    """Samples [n] of a channel that stand elsewhere: where each begins in `data`, its bytes, whether it is
    invalid.
    """

    starts: np.ndarray
    sizes: np.ndarray
    data: np.ndarray
    invalid: np.ndarray | None

    def bytes(self, most: int) -> np.ndarray:
        """The bytes of each [n, width, uint8], at most so many of them, with zeros behind shorter ones."""
        width = np.arange(min(int(self.sizes.max(initial=0)), most))
        there = width < self.sizes[:, None]
        return np.where(there, self.data[np.where(there, self.starts[:, None] + width, 0)], 0).astype(
            np.uint8
        )


def stands_elsewhere(channel: Any) -> bool:
    """Whether its samples are of several lengths and not in the records; MDF3 knows no such channel."""
    return channel.id == b"##CN" and channel.channel_type == STORED


def stored(file: Any, number: int, index: int, label: str) -> Stored:
    """Where the samples of such a channel stand; raises ValueError where that is not in the file.

    asammdf's own way believes the file, and would read beyond its memory.
    """
    of, group = file._mdf, file.groups[number]
    channel = group.channels[index]
    starts, _, invalid, _ = of._get_scalar(
        channel, group, number, index, group.channel_dependencies[index], raster=None, data=None,
        ignore_invalidation_bits=False, record_offset=0, record_count=None, master_is_required=False,
        skip_vlsd=True,
    )  # fmt: skip
    data = np.frombuffer(of._load_signal_data(group, index), np.uint8)
    starts = np.asarray(starts).astype(np.uint64)
    if (starts + np.uint64(LENGTH) > len(data)).any() or (starts > len(data)).any():
        raise ValueError(f"a sample of {channel.name} of {label} stands beyond its data")
    starts = starts.astype(np.int64)
    sizes = data[starts[:, None] + np.arange(LENGTH)].astype(np.int64) @ (1 << 8 * np.arange(LENGTH))
    starts += LENGTH
    if (starts + sizes > len(data)).any():
        raise ValueError(f"a sample of {channel.name} of {label} ends beyond its data")
    return Stored(starts, sizes, data, None if invalid is None else np.asarray(invalid, dtype=bool))


def check_stored(file: Any, number: int, label: str) -> None:
    """Raise ValueError where asammdf would read beyond the samples that stand elsewhere."""
    for index, channel in enumerate(file.groups[number].channels):
        if not stands_elsewhere(channel):
            continue
        starts = stored(file, number, index, label).starts
        if (starts[1:] < starts[:-1]).any():
            raise ValueError(f"samples of {channel.name} of {label} do not stand in their order")
