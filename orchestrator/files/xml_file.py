"""Reading XML that others wrote: no entities, no network, and errors that name the line."""

import math
import re
from pathlib import Path

from lxml import etree

from specs.errors import InputError

Element = etree._Element

MAX_BYTES = 64 * 1024**2  # of one XML file; ten thousand variables need 2 MB
# How XML schema writes numbers: no digits of other scripts, no underscores, no "infinity".
INTEGER = re.compile(r"[+-]?[0-9]{1,40}")
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
SPECIAL = {"INF": math.inf, "+INF": math.inf, "-INF": -math.inf, "NaN": math.nan}


def parse(content: bytes, shown: str) -> Element:
    """Return the root element; InputError names the file `shown` and the line of what is not XML."""
    if len(content) > MAX_BYTES:
        raise InputError(f"{shown} has {len(content)} bytes of XML; accepted: {MAX_BYTES}")
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=False,
        remove_comments=True,
        remove_pis=True,
    )
    try:
        root = etree.fromstring(content, parser)
    except etree.XMLSyntaxError as error:
        raise InputError(f"{shown} is not valid XML: {_one_line(error.msg)}") from None
    except (ValueError, LookupError) as error:
        raise InputError(f"{shown} is not valid XML: {_one_line(str(error))}") from None
    if root.getroottree().docinfo.internalDTD is not None:
        raise InputError(f"{shown} declares a document type; refused, as it could expand entities")
    return root


def read(path: Path, shown: str) -> Element:
    """Parse a file; InputError when it is missing or larger than MAX_BYTES."""
    try:
        with path.open("rb") as file:
            return parse(file.read(MAX_BYTES + 1), shown)
    except OSError as error:
        raise InputError(f"{shown} cannot be read: {error.strerror}") from None


def local(element: Element) -> str:
    """Name of an element without its namespace."""
    return etree.QName(element).localname


def number(element: Element, name: str, default: float, where: str) -> float:
    """A finite floating point attribute; InputError names `where`, the line and what stands there instead."""
    text = element.get(name)
    if text is None:
        return default
    value = as_number(text)
    if value is None or not math.isfinite(value):
        raise InputError(f"{where} line {element.sourceline}: {name}='{shortened(text)}' is not a number")
    return value


def integer(element: Element, name: str, default: int, where: str) -> int:
    """An integer attribute, as `number`."""
    text = element.get(name)
    if text is None:
        return default
    value = as_integer(text)
    if value is None:
        raise InputError(f"{where} line {element.sourceline}: {name}='{shortened(text)}' is not an integer")
    return value


def boolean(element: Element, name: str, default: bool, where: str) -> bool:
    """A Boolean attribute, as `number`."""
    text = element.get(name)
    if text is None:
        return default
    value = as_boolean(text)
    if value is None:
        raise InputError(
            f"{where} line {element.sourceline}: {name}='{shortened(text)}' is not true or false"
        )
    return value


def as_number(text: str) -> float | None:
    """The number that `text` is by XML schema (INF and NaN included), or None."""
    text = text.strip()
    if text in SPECIAL:
        return SPECIAL[text]
    return float(text) if NUMBER.fullmatch(text) else None


def as_integer(text: str) -> int | None:
    """The integer that `text` is by XML schema, or None."""
    return int(text) if INTEGER.fullmatch(text := text.strip()) else None


def as_boolean(text: str) -> bool | None:
    """The Boolean that `text` is by XML schema, or None."""
    return {"true": True, "1": True, "false": False, "0": False}.get(text.strip())


def as_bytes(text: str) -> bytes | None:
    """The bytes that `text` is in hexadecimal digits, or None."""
    try:
        return bytes.fromhex(text)
    except ValueError:
        return None


def required(element: Element, name: str, where: str) -> str:
    """An attribute that must be there; InputError names element and line."""
    text = element.get(name)
    if not text:
        raise InputError(f"{where} line {element.sourceline}: <{local(element)}> has no '{name}'")
    return text


def error(element: Element | None, message: str, where: str) -> InputError:
    """`message` with the line of `element`, and the name of the element or of the one around it."""
    if element is None:
        return InputError(f"{where}: {message}")
    holder = element if element.get("name") else element.getparent()
    name = None if holder is None else holder.get("name")
    of = f" {local(holder)} '{shortened(name)}':" if holder is not None and name else ""
    return InputError(f"{where} line {element.sourceline}:{of} {message}")


def shortened(text: str, limit: int = 60) -> str:
    """`text` as it fits into a message: one line, at most `limit` characters."""
    text = _one_line(text)
    return text if len(text) <= limit else text[: limit - 1] + "…"


def _one_line(text: str) -> str:
    return " ".join(text.split())
