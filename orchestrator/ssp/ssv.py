"""Reads a parameter set (SSV), inline or a file of its own: names, typed values, units (SSP 2.0, 6)."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import prod

from orchestrator.files import xml_file
from orchestrator.files.xml_file import Element
from orchestrator.fmi.variable import RANGES, REALS, Scalar, Value
from orchestrator.ssp.conversion import Transformation
from orchestrator.ssp.element_forms import VALUE_TYPES
from orchestrator.ssp.ssc import Definitions, read_definitions, read_type_dimensions
from orchestrator.ssp.text import Place, Text
from specs.errors import InputError
from specs.units import Unit


@dataclass(frozen=True)
class ParameterValue:
    """A value for the parameter, or other variable, `name` of the element that a binding belongs to.

    value           in `unit` (None: in that of the variable); enumerations by item name; arrays flat
    dimensions      () for a scalar
    items           of the enumeration that the set names, if it does
    transformation  of a parameter mapping, applied after the conversion of units, unless `suppress`
    shared          from a file, which may hold more than one element needs (SSP 2.0, 6.2)
    """

    name: str
    value: Value
    type: str
    unit: Unit | None
    unit_name: str
    place: Place
    dimensions: tuple[int, ...] = ()
    items: Mapping[str, int] = field(default_factory=dict)
    transformation: Transformation | None = None
    suppress: bool = False
    shared: bool = False


def read_parameter_set(
    root: Element, shown: str, warnings: list[str], shared: bool, outer: Definitions
) -> list[ParameterValue]:
    """All values of a <ParameterSet>; InputError, naming `shown` and line, for what is wrong or twice.

    `outer`: definitions of the file around an inline set, which count where it has none of its own.
    """
    if xml_file.local(root) != "ParameterSet":
        raise InputError(f"{shown} line {root.sourceline}: <{xml_file.local(root)}> is not a ParameterSet")
    text = Text(shown, root.get("version", "1.0"), warnings)
    groups = text.children(root, "ssv:ParameterSet")
    own = read_definitions(text, groups)
    definitions = Definitions(outer.units | own.units, outer.enumerations | own.enumerations)
    found: dict[str, ParameterValue] = {}
    for parameter in text.items(groups.get("Parameters", []), "ssv:Parameters", "Parameter"):
        value = _parameter(text, parameter, definitions, shared)
        if value.name in found:
            raise text.error(parameter, f"second parameter '{value.name}' in the set")
        found[value.name] = value
    return list(found.values())


def _parameter(text: Text, element: Element, definitions: Definitions, shared: bool) -> ParameterValue:
    name = text.name(element)
    groups = text.children(element, "ssv:Parameter")
    typed = [e for kind in VALUE_TYPES.split() for e in groups.get(kind, [])]
    if len(typed) != 1:
        raise text.error(element, f"parameter '{name}' has {len(typed)} values; a parameter has exactly one")
    given = typed[0]
    values = text.children(given, f"ssv:{xml_file.local(given)}").get("Value", [])
    unit_name = definitions.unit_name(text, given, f"parameter '{name}'")
    dimensions = read_type_dimensions(text, groups, f"parameter '{name}'")
    return ParameterValue(
        name,
        _value(text, given, values, dimensions, name),
        xml_file.local(given),
        definitions.units.get(unit_name),
        unit_name,
        text.place(given),
        dimensions,
        _items(text, given, definitions),
        shared=shared,
    )


def _items(text: Text, given: Element, definitions: Definitions) -> Mapping[str, int]:
    name = given.get("name") if xml_file.local(given) == "Enumeration" else None
    return {} if name is None else definitions.items(text, given, name)


def _value(
    text: Text, given: Element, values: list[Element], dimensions: tuple[int, ...], name: str
) -> Value:
    texts = list(_texts(text, given, values, bool(dimensions)))
    size = prod(dimensions)
    if len(texts) != size:
        raise text.error(given, f"parameter '{name}' has {len(texts)} values for {size} elements")
    scalars = tuple(_scalar(text, given, t) for t in texts)
    return scalars if dimensions else scalars[0]


def _texts(text: Text, given: Element, values: list[Element], array: bool) -> Iterator[str]:
    """The values as written: one attribute, a list of numbers in one, or <Value> elements."""
    whole = given.get("value")
    if whole is not None and values:
        raise text.error(given, "'value' and <Value> exclude each other")
    if whole is None and not values:
        raise text.error(given, f"<{xml_file.local(given)}> has no 'value'")
    if whole is None:
        for element in values:
            text.children(element, "ssv:Value")
            yield element.get("value", element.text or "")
    elif array and xml_file.local(given) not in ("String", "Enumeration", "Binary"):
        yield from whole.split()
    else:
        yield whole


def _scalar(text: Text, given: Element, written: str) -> Scalar:
    kind, value = xml_file.local(given), None
    if kind in ("String", "Enumeration"):
        return written
    if kind in REALS:
        value, wanted = xml_file.as_number(written), "a number"
    elif kind == "Boolean":
        value, wanted = xml_file.as_boolean(written), "true or false"
    elif kind == "Binary":
        value, wanted = xml_file.as_bytes(written), "a hexadecimal number of whole bytes"
    else:
        low, high = RANGES[kind]
        value, wanted = xml_file.as_integer(written), f"an integer from {low} to {high}"
        value = value if value is not None and low <= value <= high else None
    if value is None:
        raise text.error(given, f"value='{xml_file.shortened(written)}' is not {wanted}")
    return value
