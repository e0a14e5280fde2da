"""EDS and DCF files of makers: what a device of theirs has, and where that is not what the specs ask for."""

import configparser
import io
import logging
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.canopen.eds_numbers import broken
from runtime.interfaces.beside import library
from specs.canopen import TYPES, Device, Node
from specs.canopen_eds import DEVICE_TYPE, IDENTITY, NOT_VALID, downloads
from specs.errors import InputError

BROKEN = (
    OSError,
    ValueError,
    LookupError,
    configparser.Error,
    AttributeError,
    TypeError,
    NotImplementedError,
)
NO_NUMBER = re.compile(r"^invalid literal for int.*(['\"])(.*)\1$")  # what Python says of one
NAMES = {number: name for name, (number, _, _) in TYPES.items()}


@dataclass(frozen=True)
class Identity:
    """What a device says of itself (object 0x1018); None: anything will do."""

    vendor: int | None
    product: int | None
    revision: int | None

    @classmethod
    def of(cls, device: Device) -> "Identity":
        """That of the specs."""
        return cls(device.vendor, device.product, device.revision)

    def named(self) -> dict[str, int | None]:
        """By what people call it, in the order of its sub-indices."""
        return {"vendor": self.vendor, "product": self.product, "revision": self.revision}

    def differs(self, found: "Identity") -> list[str]:
        """Where another one is not this."""
        pairs = zip(self.named().items(), found.named().values(), strict=True)
        return [
            f"{name} 0x{is_:08X}, not 0x{wanted:08X}"
            for (name, wanted), is_ in pairs
            if None not in (wanted, is_) and wanted != is_
        ]


def read(path: Path, node_id: int | None = None) -> Any:
    """The object dictionary of an EDS or DCF; raises InputError for a file that is none."""
    canopen = library("canopen", "canopen", "canopen")
    logging.getLogger("canopen").setLevel(logging.CRITICAL)
    if path.suffix.lower() not in (".eds", ".dcf"):
        raise InputError(f"{path}: its name ends neither in .eds nor in .dcf")
    try:
        found = canopen.import_od(_text(path), node_id)
    except FileNotFoundError:
        raise InputError(f"{path} does not exist") from None
    except BROKEN as error:
        reason = str(error).splitlines()[0] if str(error) else "broken"
        raise InputError(f"{path}: no EDS: {_placed(path, reason)}") from None
    if not len(found):
        raise InputError(f"{path}: no EDS: it has no objects")
    for wrong in broken(_text(path).read().splitlines(), found):
        raise InputError(f"{path}: {wrong}")
    return found


def _placed(path: Path, reason: str) -> str:
    """A broken number with line, section and name of its entry; another reason as it is."""
    quoted, section = NO_NUMBER.search(reason), ""
    if quoted is None:
        return reason
    for number, line in enumerate(_text(path), 1):
        name, _, value = (part.strip() for part in line.partition("="))
        if name.startswith("["):
            section = name
        elif value == quoted[2]:
            return f"line {number}, {section}: {name}={value} is no number"
    return reason


def _text(path: Path) -> io.StringIO:
    """A file's text: UTF-8, with or without a mark, else as Windows tools of makers write it."""
    data = path.read_bytes()
    try:
        text = io.StringIO(data.decode("utf-8-sig"), newline=None)
    except UnicodeDecodeError:
        text = io.StringIO(data.decode("latin-1"), newline=None)
    text.name = str(path)  # the library asks for it
    return text


def identity(od: Any) -> Identity:
    """What an EDS says a device says of itself."""
    about = od.device_information
    texts = (about.vendor_number, about.product_number, about.revision_number)
    found = [_default(_variable(od, IDENTITY, sub)) for sub in (1, 2, 3)]
    return Identity(*(text if said is None else said for said, text in zip(found, texts, strict=True)))


def mismatches(od: Any, node: Node) -> list[str]:
    """What of `node` an EDS cannot fulfil, in words; empty: it fits."""
    said = _default(_variable(od, DEVICE_TYPE, 0))
    found = []
    if said is not None and said & 0xFFFF != node.device.profile:
        found.append(f"device profile {said & 0xFFFF}, not {node.device.profile}")
    return [*found, *_of_writes(od, node), *_of_places(od, node), *_of_constants(od, node)]


def _of_writes(od: Any, node: Node) -> Iterator[str]:
    """What is written at the start must be there and be so long; what is read-only must say it already."""
    last = {d.shown: d for d in downloads(node, {})}
    for shown, wanted in last.items():
        variable = _variable(od, wanted.index, wanted.sub)
        if variable is None:
            yield f"no object {shown}"
        elif variable.data_type not in NAMES:
            yield f"object {shown} is no number of 8, 16 or 32 bits"
        elif TYPES[NAMES[variable.data_type]][1] != wanted.bits:
            yield f"object {shown} is {NAMES[variable.data_type]}, not of {wanted.bits} bits"
        elif not variable.writable and _default(variable) != wanted.value & ~NOT_VALID:
            yield f"object {shown} is read-only and says {_default(variable)}, not {wanted.value}"


def _of_places(od: Any, node: Node) -> Iterator[str]:
    for place in (*node.sends, *node.takes):
        entry = place.entry
        variable = _variable(od, entry.index, entry.sub)
        if variable is None:
            yield f"no object {entry.shown} for {place.signal.name}"
        elif variable.data_type != TYPES[entry.type][0]:
            said = NAMES.get(variable.data_type, f"type 0x{variable.data_type or 0:02X}")
            yield f"object {entry.shown} for {place.signal.name} is {said}, not {entry.type}"
        elif not variable.pdo_mappable:
            yield f"object {entry.shown} for {place.signal.name} cannot be in a PDO"


def _of_constants(od: Any, node: Node) -> Iterator[str]:
    """What the specs count on and cannot write, such as an encoder's resolution."""
    for entry in node.device.object.values():
        variable = _variable(od, entry.index, entry.sub)
        if entry.access != "ro" or entry.value is None:
            continue
        if variable is None:
            yield f"no object {entry.shown} ({entry.name})"
        elif _default(variable) not in (None, entry.value):
            yield f"object {entry.shown} ({entry.name}) says {_default(variable)}, not {entry.value}"


def _variable(od: Any, index: int, sub: int) -> Any:
    """A variable of a dictionary; None if it has none there."""
    if index not in od:
        return None
    found = od[index]
    if hasattr(found, "data_type"):
        return found if sub == 0 else None
    return found.get(sub)


def _default(variable: Any) -> int | None:
    if variable is None:
        return None
    said = variable.value if getattr(variable, "value", None) is not None else variable.default
    return said if isinstance(said, int) else None
