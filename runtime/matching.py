"""Whether a DBC or a register map from elsewhere says the same as the specs."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from specs.errors import InputError
from specs.signals import definition
from specs.wire import Message

PLACES = ("table", "address", "type", "word_order", "scale")  # of a register: what must agree


def check_dbc(path: Path) -> None:
    """Raise InputError if a message or signal of the specs is elsewhere in the DBC, or not there."""
    import cantools

    try:
        database: Any = cantools.database.load_file(path, database_format="dbc", strict=True)
    except (OSError, ValueError, cantools.Error) as error:
        raise InputError(f"{path}: cannot be read as a DBC: {str(error).splitlines()[0]}") from None
    spec = definition()
    messages = {m.frame_id: m for m in database.messages}
    for name, message in spec.bus.messages.items():
        if message.frame_id not in messages:
            raise InputError(f"{path} does not match the specs: no message {name} ({message.frame_id:08X})")
        _check_message(path, message, messages[message.frame_id])
        _check_signals(path, name, {s.name: s for s in messages[message.frame_id].signals})


def check_map(path: Path) -> None:
    """Raise InputError if a register of the specs is elsewhere in the map, or not there."""
    from specs.tables import modbus_csv

    try:
        theirs = _rows(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    for key, ours in _rows(modbus_csv()).items():
        if key not in theirs:
            raise InputError(f"{path} does not match the specs: no register {key[1]} in table {key[0]}")
        for column in PLACES:
            if theirs[key].get(column) != ours[column]:
                raise InputError(
                    f"{path} does not match the specs: {key[1]} has {column} {theirs[key].get(column)}, "
                    f"not {ours[column]}"
                )


def _check_message(path: Path, message: Message, found: Any) -> None:
    attributes = found.dbc.attributes if found.dbc else {}
    data_id = attributes["E2EDataID"].value if "E2EDataID" in attributes else None
    theirs = {"length": found.length, "cycle_ms": found.cycle_time, "data_id": data_id}
    for key, value in theirs.items():
        if value != getattr(message, key):
            wanted = f"{message.name} has {key} {value}, not {getattr(message, key)}"
            raise InputError(f"{path} does not match the specs: {wanted}")


def _check_signals(path: Path, message: str, there: Mapping[str, Any]) -> None:
    for s in definition().signals.values():
        if s.can is None or s.can.message != message:
            continue
        if s.name not in there:
            raise InputError(f"{path} does not match the specs: message {message} has no signal {s.name}")
        found = there[s.name]
        place = (found.start, found.length, float(found.scale), float(found.offset), found.byte_order)
        wanted = (s.can.start, s.can.length, s.can.scale, s.can.offset, s.can.byte_order)
        if place != wanted:
            raise InputError(f"{path} does not match the specs: {s.name} is at {place}, not {wanted}")


def _rows(text: str) -> dict[tuple[str, str], dict[str, str]]:
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return {(row.get("table") or "", row.get("name") or ""): row for row in csv.DictReader(lines)}
