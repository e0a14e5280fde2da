"""terminalsAndIcons of an FMU of ours: signals of one kind and direction as a terminal, and a plain icon.

FMI 2.0.4 takes the file as FMI 3.0 defines it.  Two FMUs connect what they have in common: rule `bus`.
"""

import struct
import zlib
from collections.abc import Sequence
from xml.sax.saxutils import escape

from lxml import etree

from fmus.definition import Model, Variable
from specs.signals import definition

FOLDER = "terminalsAndIcons/"
KIND = "org.slewright."  # and the kind of signal: a terminal's kind
SIZE = 64  # of the icon, in pixels: a frame on white
SVG = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100"><rect x="2" y="2" width="96" height="96" '
    'fill="#fff" stroke="#000" stroke-width="2"/><text x="50" y="55" font-family="sans-serif" font-size="14" '
    'text-anchor="middle">{name}</text></svg>\n'
)


def files(model: Model) -> dict[str, bytes]:
    """The files by their place in the archive."""
    return {
        FOLDER + "terminalsAndIcons.xml": _description(model),
        FOLDER + "icon.png": _png(),
        FOLDER + "icon.svg": SVG.format(name=escape(model.name)).encode(),
    }


def of(model: Model) -> dict[str, list[str]]:
    """Terminals by name, `<kind>_in` or `<kind>_out`: names of their signals; other variables are in none."""
    found: dict[str, list[str]] = {}
    for way, variables in (("in", model.inputs), ("out", model.outputs)):
        for name, kind in _signals(variables):
            found.setdefault(f"{kind}_{way}", []).append(name)
    return found


def _signals(variables: Sequence[Variable]) -> list[tuple[str, str]]:
    """(Name, kind) of the variables that are signals of specs/signals.toml."""
    known = definition().signals
    return [(v.name, known[v.name].kind) for v in variables if v.name in known and known[v.name].vr == v.vr]


def _description(model: Model) -> bytes:
    root = etree.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    picture = etree.SubElement(root, "GraphicalRepresentation")
    corners = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    etree.SubElement(picture, "CoordinateSystem", corners, suggestedScalingFactorTo_mm="0.1")
    etree.SubElement(picture, "Icon", corners)
    terminals = of(model)
    holder = etree.SubElement(root, "Terminals") if terminals else root
    for name, signals in terminals.items():
        kind = KIND + name.rpartition("_")[0]
        terminal = etree.SubElement(holder, "Terminal", name=name, matchingRule="bus", terminalKind=kind)
        for signal in signals:
            member = {"variableName": signal, "memberName": signal, "variableKind": "signal"}
            etree.SubElement(terminal, "TerminalMemberVariable", member)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


def _png() -> bytes:
    """The frame in black on white, one bit a pixel; stored, so that it is the same bytes with every zlib."""
    edge, inside = b"\0" * (SIZE // 8), b"\x3f" + b"\xff" * (SIZE // 8 - 2) + b"\xfc"
    rows = b"".join(b"\0" + (edge if y in (0, 1, SIZE - 2, SIZE - 1) else inside) for y in range(SIZE))
    head = struct.pack(">IIBBBBB", SIZE, SIZE, 1, 0, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(rows, 0)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
