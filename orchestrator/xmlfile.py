"""Reading XML that others wrote: no entities, no network, and errors that name the line."""

from pathlib import Path

from lxml import etree

from specs.errors import InputError

Element = etree._Element


def parse(content: bytes, shown: str) -> Element:
    """Return the root element; InputError names the file `shown` and the line of what is not XML."""
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
        raise InputError(f"{shown} is not valid XML: {error.msg}") from None
    if root.getroottree().docinfo.internalDTD is not None:
        raise InputError(f"{shown} declares a document type; refused, as it could expand entities")
    return root


def read(path: Path, shown: str) -> Element:
    """Parse a file; InputError when it is missing."""
    try:
        return parse(path.read_bytes(), shown)
    except OSError as error:
        raise InputError(f"{shown} cannot be read: {error.strerror}") from None


def local(element: Element) -> str:
    """Name of an element without its namespace."""
    return etree.QName(element).localname


def number(element: Element, name: str, default: float, where: str) -> float:
    """A floating point attribute; InputError names `where`, the line and what stands there instead."""
    text = element.get(name)
    try:
        return default if text is None else float(text)
    except ValueError:
        raise InputError(f"{where} line {element.sourceline}: {name}='{text}' is not a number") from None


def integer(element: Element, name: str, default: int, where: str) -> int:
    """An integer attribute, as `number`."""
    text = element.get(name)
    try:
        return default if text is None else int(text)
    except ValueError:
        raise InputError(f"{where} line {element.sourceline}: {name}='{text}' is not an integer") from None


def required(element: Element, name: str, where: str) -> str:
    """An attribute that must be there; InputError names element and line."""
    text = element.get(name)
    if not text:
        raise InputError(f"{where} line {element.sourceline}: <{local(element)}> has no '{name}'")
    return text
