"""Whether a DBC or a register map from elsewhere says the same as the specs."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from specs.dbc import render
from specs.errors import InputError
from specs.tables import modbus_csv

FREE = "description"  # the only column of a register map that may read differently
ATTRIBUTES = {"profile": "E2EProfile", "data_id": "E2EDataID"}  # of a message


def check_dbc(path: Path) -> None:
    """Raise InputError if the DBC says anything else about messages of the specs: the first difference.

    Other messages, other receivers and comments are nobody's business: more nodes may be on the bus.
    """
    import cantools

    try:
        database: Any = cantools.database.load_file(path, database_format="dbc", strict=True)
    except (OSError, ValueError, cantools.Error) as error:
        raise InputError(f"{path}: cannot be read as a DBC: {str(error).splitlines()[0]}") from None
    theirs = {m.frame_id: m for m in database.messages}
    for ours in cantools.database.load_string(render(), "dbc").messages:  # type: ignore[union-attr]
        if ours.frame_id not in theirs:
            raise _differs(path, f"no message {ours.name} ({ours.frame_id:08X})")
        found = theirs[ours.frame_id]
        _compare(path, ours.name, _of_message(found), _of_message(ours))
        _check_signals(path, ours, found)


def check_map(path: Path) -> None:
    """Raise InputError if the register map says anything else than the specs, naming the first difference."""
    try:
        theirs = _rows(path.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    ours = _rows(modbus_csv())
    for key, row in ours.items():
        if key not in theirs:
            raise _differs(path, f"no register {key[1]} in table {key[0]}")
        wanted = {column: value for column, value in row.items() if column != FREE}
        _compare(path, key[1], {column: theirs[key].get(column) for column in wanted}, wanted)
    if more := [key for key in theirs if key not in ours]:
        raise _differs(path, f"register {more[0][1]} in table {more[0][0]} is unknown")


def _differs(path: Path, what: str) -> InputError:
    return InputError(f"{path} does not match the specs: {what}")


def _compare(path: Path, name: str, theirs: Mapping[str, Any], ours: Mapping[str, Any]) -> None:
    for key, wanted in ours.items():
        if theirs[key] != wanted:
            raise _differs(path, f"{name} has {key} {theirs[key]}, not {wanted}")


def _of_message(message: Any) -> dict[str, Any]:
    attributes = message.dbc.attributes if message.dbc else {}
    told = {key: attributes[name].value if name in attributes else None for key, name in ATTRIBUTES.items()}
    sender = message.senders[0] if message.senders else None
    return {"length": message.length, "cycle_ms": message.cycle_time, "sender": sender, **told}


def _check_signals(path: Path, ours: Any, theirs: Any) -> None:
    found, wanted = ({s.name: s for s in message.signals} for message in (theirs, ours))
    for name, signal in wanted.items():
        if name not in found:
            raise _differs(path, f"message {ours.name} has no signal {name}")
        if _place(found[name]) != _place(signal):
            raise _differs(path, f"{name} is at {_place(found[name])}, not {_place(signal)}")
        _compare(path, name, _of_signal(found[name]), _of_signal(signal))
    if more := [name for name in found if name not in wanted]:
        raise _differs(path, f"signal {more[0]} of message {ours.name} is unknown")


def _place(signal: Any) -> tuple[Any, ...]:
    return (signal.start, signal.length, float(signal.scale), float(signal.offset), signal.byte_order)


def _of_signal(signal: Any) -> dict[str, Any]:
    return {
        "signed": signal.is_signed,
        "float": signal.is_float,
        "unit": signal.unit or "",
        "min": signal.minimum,
        "max": signal.maximum,
        "values": {int(number): str(text) for number, text in (signal.choices or {}).items()},
    }


def _rows(text: str) -> dict[tuple[str, str], dict[str, str]]:
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return {(row.get("table") or "", row.get("name") or ""): row for row in csv.DictReader(lines)}
