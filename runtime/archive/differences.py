"""What a bundle changes against the one that is active, in words: for the one who has to accept it.

Each part of an archive is brought into one form, things with attributes as text, and two such forms are
compared.
"""

import csv
import json
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from runtime.archive import names as form
from runtime.bundle import MANIFEST, digest
from specs.errors import InputError

Things = Mapping[str, Mapping[str, str]]  # attributes, as text, by thing
PARAMETERS = form.BUNDLE + "parameters.json"
SOURCES, CORE = form.BUNDLE + "sources/", form.BUNDLE + "core-"
VALUE = ""  # the attribute that needs no name


@dataclass(frozen=True)
class Change:
    """One difference; `old` or `new` is None for what is added or removed."""

    section: str
    what: str
    old: str | None
    new: str | None

    def __str__(self) -> str:
        if self.old is None:
            return f"added {self.what}: {self.new}"
        if self.new is None:
            return f"removed {self.what} (was {self.old})"
        return f"{self.what}: {self.old} -> {self.new}"


def differences(old: Mapping[str, bytes], new: Mapping[str, bytes]) -> list[Change]:
    """What changes from the files of one archive to those of another.

    Raises InputError for a part of either that cannot be read.
    """
    found = [change for name in SECTIONS for change in part(name, old, new)]
    return [*found, *compare("files", _others(old), _others(new))]


def part(name: str, old: Mapping[str, bytes], new: Mapping[str, bytes]) -> list[Change]:
    """What changes in the file `name`, a key of SECTIONS; InputError if one of the two cannot be read."""
    section, things = SECTIONS[name]
    return compare(section, _read(things, name, old), _read(things, name, new))


def compare(section: str, old: Things, new: Things) -> list[Change]:
    """Differences of two sets of things, thing by thing."""
    found = []
    for thing in [*old, *(name for name in new if name not in old)]:
        if thing not in new:
            found.append(Change(section, thing, _summary(old[thing]), None))
        elif thing not in old:
            found.append(Change(section, thing, None, _summary(new[thing])))
        else:
            found += _attributes(section, thing, old[thing], new[thing])
    return found


def bundle(data: bytes) -> Things:
    """Controller, engine, versions and platforms of a bundle."""
    told = json.loads(data)
    names = ("controller", "engine", "slewright", "layout")
    whole = {name: {VALUE: str(told[name])} for name in names}
    whole["compiled code"] = {VALUE: str(told["identity"])[: form.SHOWN]}
    return {**whole, "platforms": {VALUE: ", ".join(told["platforms"])}}


def parameters(data: bytes) -> Things:
    """Every parameter with its unit."""
    return {name: {VALUE: _valued(p)} for name, p in sorted(json.loads(data).items())}


def messages(data: bytes) -> Things:
    """Messages and signals of a DBC."""
    import cantools

    database: Any = cantools.database.load_string(data.decode(), database_format="dbc")
    found: dict[str, Mapping[str, str]] = {}
    for message in database.messages:
        found[f"message {message.name}"] = _message(message)
    for message in database.messages:
        for s in message.signals:
            found[f"signal {s.name}"] = {"message": message.name, **_signal(s)}
    return found


def places(data: bytes) -> Things:
    """Registers of a map."""
    lines = [line for line in data.decode().splitlines() if line and not line.startswith("#")]
    return {
        f"register {row['table']} {row['name']}": {
            k: v for k, v in row.items() if k not in ("table", "name", "description")
        }
        for row in csv.DictReader(lines)
    }


def configuration(data: bytes) -> Things:
    """Every key of a configuration file."""
    return {key: {VALUE: value} for key, value in _flat("", tomllib.loads(data.decode()))}


def software(data: bytes) -> Things:
    """Versions of the software that the SBOM lists."""
    return {
        c["name"]: {VALUE: c["version"]}
        for c in json.loads(data)["components"]
        if c["type"] in ("library", "application")
    }


SECTIONS: Mapping[str, tuple[str, Callable[[bytes], Things]]] = {
    form.BUNDLE + MANIFEST: ("bundle", bundle),
    PARAMETERS: ("parameters", parameters),
    form.DBC: ("CAN", messages),
    form.MAP: ("Modbus", places),
    form.CONFIGURATION: ("configuration", configuration),
    form.SBOM: ("software", software),
}


def _read(things: Callable[[bytes], Things], name: str, files: Mapping[str, bytes]) -> Things:
    if name not in files:
        return {}
    try:
        return things(files[name])
    except Exception as error:  # noqa: BLE001 - several parsers' own kinds: whatever it is, it cannot be read
        raise InputError(f"{name} cannot be read ({type(error).__name__}: {error})") from None


def _others(files: Mapping[str, bytes]) -> Things:
    """Everything that is not taken to pieces; code is told by the bundle's identity."""
    return {
        name: {VALUE: digest(data)[: form.SHOWN]}
        for name, data in sorted(files.items())
        if name not in (*SECTIONS, form.MANIFEST, form.SIGNATURE) and not name.startswith((SOURCES, CORE))
    }


def _attributes(section: str, thing: str, old: Mapping[str, str], new: Mapping[str, str]) -> list[Change]:
    return [
        Change(section, f"{thing} {name}".rstrip(), old.get(name) or "none", new.get(name) or "none")
        for name in dict.fromkeys([*old, *new])
        if old.get(name, "") != new.get(name, "")
    ]


def _summary(attributes: Mapping[str, str]) -> str:
    return ", ".join(f"{name} {value}".lstrip() for name, value in attributes.items() if value)


def _valued(parameter: Mapping[str, Any]) -> str:
    return f"{parameter['value']!r} {parameter.get('unit', '')}".rstrip()


def _message(message: Any) -> dict[str, str]:
    attributes = message.dbc.attributes if message.dbc else {}
    return {
        "identifier": f"0x{message.frame_id:08X}",
        "length": f"{message.length} bytes",
        "cycle": f"{message.cycle_time} ms" if message.cycle_time else "",
        "sender": ", ".join(message.senders),
        "receivers": ", ".join(sorted(message.receivers)),
        **{name: str(a.value) for name, a in sorted(attributes.items()) if name.startswith("E2E")},
    }


def _signal(s: Any) -> dict[str, str]:
    attributes = s.dbc.attributes if s.dbc else {}
    order = "little-endian" if s.byte_order == "little_endian" else "big-endian"
    return {
        "place": f"bit {s.start}, {s.length} bits, {order}, {'signed' if s.is_signed else 'unsigned'}",
        "scale": f"{s.scale:g} and offset {s.offset:g}",
        "range": f"{s.minimum} to {s.maximum}",
        "unit": s.unit or "",
        "values": ", ".join(f"{k} {v}" for k, v in sorted((s.choices or {}).items())),
        **{name: str(a.value) for name, a in sorted(attributes.items()) if name.startswith("GenSig")},
    }


def _flat(head: str, value: Any) -> list[tuple[str, str]]:
    if isinstance(value, dict):
        return [pair for key, v in value.items() for pair in _flat(f"{head}.{key}".lstrip("."), v)]
    return [(head, json.dumps(value, default=str))]
