"""Reads what all SSP files share: units, enumerations, types, transformations (SSP 2.0, chapter 4)."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from orchestrator.files import xml_file
from orchestrator.files.xml_file import Element
from orchestrator.fmi.units import Affine, parse_units
from orchestrator.fmi.variable_reader import MAX_ELEMENTS
from orchestrator.ssp.conversion import ENUMERATION, INTEGER, LINEAR, Transformation
from orchestrator.ssp.element_forms import TRANSFORMATIONS, TYPES
from orchestrator.ssp.text import Text
from specs.errors import nearest
from specs.units import Unit

NO_UNIT = "None"


@dataclass(frozen=True)
class Typed:
    """Type of a connector or dictionary entry, as far as it is stated.

    type         name of FMI or SSP; "": not stated
    items        of an enumeration, from the file's definitions
    dimensions   sizes, names of the connectors that give them, or None where the file leaves a size open
    """

    type: str = ""
    unit_name: str = ""
    unit: Unit | None = None
    items: Mapping[str, int] = field(default_factory=dict)
    dimensions: tuple[int | str | None, ...] = ()
    mime_type: str = ""
    interval_variability: str = ""


@dataclass
class Definitions:
    """Units and enumerations of one file; a file's definitions hold in it alone (SSP 2.0, 4.4)."""

    units: dict[str, Unit | None] = field(default_factory=dict)
    enumerations: dict[str, Mapping[str, int]] = field(default_factory=dict)

    def items(self, text: Text, element: Element, name: str) -> Mapping[str, int]:
        """Items of the enumeration `name` that `element` is of; InputError where it is not defined."""
        if name not in self.enumerations:
            raise text.error(
                element, f"the enumeration '{name}' is not defined; {nearest(name, self.enumerations)}"
            )
        return self.enumerations[name]

    def unit_name(self, text: Text, element: Element, owner: str) -> str:
        """The unit that `element` is in, "" for none; InputError for one that is not defined.

        OMSimulator writes "None" where there is none.
        """
        name = element.get("unit", "")
        if not name or name in self.units:
            return name
        if name == NO_UNIT:
            text.warn(element, f"{owner}: the unit '{name}' is not defined; it is read as none")
            return ""
        choices = nearest(name, self.units) if self.units else "the file defines no unit"
        raise text.error(element, f"{owner} has the undefined unit '{name}'; {choices}")


def read_definitions(text: Text, groups: Mapping[str, list[Element]]) -> Definitions:
    """From the children `Units` and `Enumerations` of a root element; InputError for a name defined twice."""
    found = Definitions()
    for unit in text.items(groups.get("Units", []), "ssc:Units", "Unit"):
        for base in text.children(unit, "ssc:Unit").get("BaseUnit", []):
            text.children(base, "ssc:BaseUnit")
            if xml_file.number(base, "factor", 1.0, text.shown) == 0.0:
                raise text.error(base, f"unit '{text.name(unit)}' has factor 0")
        if text.name(unit) in found.units:
            raise text.error(unit, f"second unit '{text.name(unit)}'")
        found.units[text.name(unit)] = None
    for holder in groups.get("Units", []):
        found.units |= parse_units(holder, text.shown)
    for enumeration in text.items(groups.get("Enumerations", []), "ssc:Enumerations", "Enumeration"):
        if text.name(enumeration) in found.enumerations:
            raise text.error(enumeration, f"second enumeration '{text.name(enumeration)}'")
        found.enumerations[text.name(enumeration)] = _items(text, enumeration)
    return found


def read_type(text: Text, groups: Mapping[str, list[Element]], definitions: Definitions, owner: str) -> Typed:
    """Type and dimensions among the children of a connector or dictionary entry; `owner` names it."""
    typed = [element for name in TYPES.split() for element in groups.get(name, [])]
    dimensions = tuple(_dimension(text, element) for element in groups.get("Dimension", []))
    clocks = [e for e in typed if xml_file.local(e) == "Clock"]
    if len(typed) > 1 and clocks:  # SSP after 2.0: beside a type, <Clock> is what the connector belongs to
        raise text.error(clocks[0], f"{owner}: a connector that belongs to a clock is not supported")
    if len(typed) > 1:
        raise text.error(typed[1], f"{owner} has a second type")
    if not typed:
        return Typed(dimensions=dimensions)
    element, name = typed[0], xml_file.local(typed[0])
    text.children(element, "ssc:Enumeration type" if name == "Enumeration" else f"ssc:{name}")
    unit_name = definitions.unit_name(text, element, owner)
    return Typed(
        name,
        unit_name,
        definitions.units.get(unit_name),
        definitions.items(text, element, text.name(element)) if name == "Enumeration" else {},
        dimensions,
        element.get("mime-type", ""),
        element.get("intervalVariability", ""),
    )


def read_type_dimensions(text: Text, groups: Mapping[str, list[Element]], owner: str) -> tuple[int, ...]:
    """Fixed dimensions, as parameter values have them."""
    found = tuple(_dimension(text, element) for element in groups.get("Dimension", []))
    for element, dimension in zip(groups.get("Dimension", []), found, strict=True):
        if not isinstance(dimension, int):
            raise text.error(element, f"{owner} has a dimension without 'size'")
    return tuple(d for d in found if isinstance(d, int))


def read_transformation(text: Text, groups: Mapping[str, list[Element]]) -> Transformation | None:
    """The one transformation among the children of a connection or mapping entry; factor 0 is refused."""
    found = [element for name in TRANSFORMATIONS.split() for element in groups.get(name, [])]
    if not found:
        return None
    if len(found) > 1:
        raise text.error(found[1], "second transformation")
    element, name = found[0], xml_file.local(found[0])
    entries = text.children(element, f"ssc:{name}").get("MapEntry", [])
    place = text.place(element)
    if name != LINEAR:
        if not entries:
            raise text.error(element, f"{name} has no <MapEntry>")
        return Transformation(name, place, entries=tuple(_entry(text, e, name) for e in entries))
    factor = xml_file.number(element, "factor", 1.0, text.shown)
    if factor == 0.0:
        raise text.error(element, "LinearTransformation with factor 0 would drop the signal")
    return Transformation(name, place, Affine(factor, xml_file.number(element, "offset", 0.0, text.shown)))


def _entry(text: Text, element: Element, name: str) -> tuple[int | str, int | str]:
    text.children(element, "ssc:MapEntry")
    if name == ENUMERATION:
        return element.get("source", ""), element.get("target", "")
    if name == INTEGER:
        source, target = (xml_file.integer(element, key, 0, text.shown) for key in ("source", "target"))
    else:
        source, target = (
            int(xml_file.boolean(element, key, False, text.shown)) for key in ("source", "target")
        )
    return source, target


def _items(text: Text, enumeration: Element) -> dict[str, int]:
    items: dict[str, int] = {}
    for item in text.children(enumeration, "ssc:Enumeration").get("Item", []):
        text.children(item, "ssc:Item")
        if (name := text.name(item)) in items:
            raise text.error(item, f"second item '{name}'")
        items[name] = xml_file.integer(item, "value", 0, text.shown)
    return items


def _dimension(text: Text, element: Element) -> int | str | None:
    text.children(element, "ssc:Dimension")
    if element.get("size") is None:
        return element.get("sizeConnector")
    if element.get("sizeConnector") is not None:
        raise text.error(element, "<Dimension> has both 'size' and 'sizeConnector'")
    size = xml_file.integer(element, "size", 0, text.shown)
    if not 0 < size <= MAX_ELEMENTS:
        raise text.error(element, f"dimension of size {size}; valid: 1 … {MAX_ELEMENTS}")
    return size
