"""Frames of a CAN bus in an MDF4 file (ASAM bus logging), decoded by a DBC."""

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from records.formats.can_frames import Frames, decoded
from records.formats.dbc import Dbc
from records.formats.raw import Raw
from specs.errors import InputError

FRAME = "CAN_DataFrame"


def read_frames(
    file: Any, path: Path, dbc: Path, protocol: str | None, start: datetime | None, notes: list[str]
) -> Raw:
    """The channels of all data frames; raises InputError where there is none."""
    found: dict[tuple, Frames] = {}
    for number, group in enumerate(file.groups):
        names = {c.name: k for k, c in enumerate(group.channels)}
        if FRAME not in names:
            label = getattr(group.channel_group, "acq_name", "") or f"group{number + 1}"
            if group.channel_group.cycles_nr:
                kind = next(
                    (n for n in names if n in ("CAN_ErrorFrame", "CAN_RemoteFrame")),
                    "channels without frames",
                )
                notes.append(f"{label}: left out, {kind}: {group.channel_group.cycles_nr}")
            continue
        if group.channel_group.cycles_nr:
            _collect(file, number, names, found)
    if not found:
        raise InputError(f"{path} holds no frames of a CAN bus, which a DBC could decode; leave --dbc out")
    return decoded(found, Dbc(dbc, protocol), path, start, notes)


def _collect(file: Any, number: int, names: Mapping[str, int], found: dict[tuple, Frames]) -> None:
    def of(part: str) -> np.ndarray:
        index = names[f"{FRAME}.{part}"]
        return np.asarray(
            file.select([(None, number, index)], raw=True, copy_master=False, validate=False)[0].samples
        )

    time = np.asarray(file.get_master(number), dtype=np.float64)
    identifiers, data, length = of("ID"), of("DataBytes"), of("DataLength")
    extended = of("IDE") if f"{FRAME}.IDE" in names else np.zeros(len(time))
    bus = of("BusChannel") if f"{FRAME}.BusChannel" in names else np.ones(len(time))
    for t, b, i, e, d, n in zip(
        time.tolist(),
        bus.tolist(),
        identifiers.tolist(),
        extended.tolist(),
        data,
        length.tolist(),
        strict=True,
    ):
        key = (int(b), int(i) & 0x1FFF_FFFF, bool(e) or int(i) > 0x7FF)
        found.setdefault(key, Frames()).add(t, bytes(np.asarray(d, dtype=np.uint8).ravel()[:n]))
