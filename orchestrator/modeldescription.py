"""What an FMU says of itself: `modelDescription.xml` of FMI 2.0 and 3.0, co-simulation."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from orchestrator import xmlfile
from orchestrator.units import parse_units
from orchestrator.xmlfile import Element
from specs.errors import InputError, nearest
from specs.units import Unit

Causality = Literal[
    "input", "output", "parameter", "calculatedParameter", "local", "independent", "structuralParameter"
]

# FMI type -> type under which FMI 3 exchanges it; FMI 2 has the first four only.
FMI2_TYPES = {"Real", "Integer", "Boolean", "Enumeration", "String"}
FMI3_TYPES = {
    "Float64",
    "Float32",
    "Int8",
    "UInt8",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
    "Boolean",
    "Enumeration",
    "String",
    "Binary",
    "Clock",
}
REALS = {"Real", "Float64", "Float32"}
NOT_NUMBERS = {"String", "Binary", "Clock"}


@dataclass(frozen=True)
class Variable:
    """A scalar variable of an FMU; `unit` None: dimension unknown; `array`: it has dimensions."""

    name: str
    vr: int
    type: str
    causality: str
    variability: str
    unit_name: str
    unit: Unit | None
    start: float | None
    min: float | None
    max: float | None
    description: str
    array: bool


@dataclass(frozen=True)
class ModelDescription:
    """FMI version (2 or 3), identifiers, variables by name and what the FMU is capable of."""

    fmi_version: int
    model_name: str
    model_identifier: str
    token: str
    variables: dict[str, Variable]
    can_get_set_state: bool
    can_serialize_state: bool
    provides_directional: bool

    def variable(self, name: str, shown: str) -> Variable:
        """The variable `name`; InputError with the nearest names, starting with `shown`."""
        if name not in self.variables:
            raise InputError(f"{shown}: no variable '{name}'; {nearest(name, self.variables)}")
        return self.variables[name]


def parse(content: bytes, shown: str) -> ModelDescription:
    """Parse modelDescription.xml; `shown` names the FMU in messages (InputError)."""
    root = xmlfile.parse(content, shown)
    version = _version(root, shown)
    interface = root.find("CoSimulation")
    if interface is None:
        raise InputError(f"{shown} offers no co-simulation")
    if interface.get("needsExecutionTool") == "true":
        raise InputError(f"{shown} needs an execution tool; only self-contained FMUs are accepted")
    units = parse_units(root.find("UnitDefinitions"), shown)
    state = "canGetAndSetFMU" + ("state" if version == 2 else "State")
    serialize = "canSerializeFMU" + ("state" if version == 2 else "State")
    directional = "providesDirectionalDerivative" + ("" if version == 2 else "s")
    return ModelDescription(
        version,
        root.get("modelName", ""),
        xmlfile.required(interface, "modelIdentifier", shown),
        xmlfile.required(root, "guid" if version == 2 else "instantiationToken", shown),
        _variables(root, version, units, shown),
        interface.get(state) == "true",
        interface.get(serialize) == "true",
        interface.get(directional) == "true",
    )


def _version(root: Element, shown: str) -> int:
    text = root.get("fmiVersion", "")
    if xmlfile.local(root) != "fmiModelDescription" or text.split(".")[0] not in ("2", "3"):
        raise InputError(f"{shown} has FMI version '{text}'; valid: 2.0, 3.0")
    return int(text.split(".")[0])


def _variables(root: Element, version: int, units: dict[str, Unit | None], shown: str) -> dict[str, Variable]:
    holder = root.find("ModelVariables")
    types = _declared_types(root)
    found: dict[str, Variable] = {}
    for variable in (_variables2 if version == 2 else _variables3)(holder, types, units, shown):
        if variable.name in found:
            raise InputError(f"{shown} has two variables '{variable.name}'")
        found[variable.name] = variable
    return found


def _declared_types(root: Element) -> dict[str, Element]:
    """Type definitions by name: their unit, min and max are defaults of the variables that refer to them."""
    holder = root.find("TypeDefinitions")
    types: dict[str, Element] = {}
    for element in () if holder is None else holder:
        inner = element[0] if xmlfile.local(element) == "SimpleType" else element
        types[element.get("name", "")] = inner
    return types


def _variables2(
    holder: Element | None, types: dict[str, Element], units: dict[str, Unit | None], shown: str
) -> Iterator[Variable]:
    for scalar in () if holder is None else holder:
        typed = next((child for child in scalar if xmlfile.local(child) in FMI2_TYPES), None)
        if typed is None:
            raise InputError(f"{shown} line {scalar.sourceline}: variable without a known type")
        yield _variable(scalar, typed, types, units, shown)


def _variables3(
    holder: Element | None, types: dict[str, Element], units: dict[str, Unit | None], shown: str
) -> Iterator[Variable]:
    for element in () if holder is None else holder:
        if xmlfile.local(element) not in FMI3_TYPES:
            raise InputError(
                f"{shown} line {element.sourceline}: unknown variable type <{xmlfile.local(element)}>"
            )
        yield _variable(element, element, types, units, shown)


def _variable(
    outer: Element, typed: Element, types: dict[str, Element], units: dict[str, Unit | None], shown: str
) -> Variable:
    """`outer` carries name and causality, `typed` start, unit and bounds (the same element in FMI 3)."""
    declared = types.get(typed.get("declaredType", ""), typed)
    unit_name = typed.get("unit", declared.get("unit", ""))
    type_name = xmlfile.local(typed)
    array = outer.find("Dimension") is not None
    bounds = [_number(typed, key, declared, shown) for key in ("min", "max")]
    return Variable(
        xmlfile.required(outer, "name", shown),
        xmlfile.integer(outer, "valueReference", 0, shown),
        type_name,
        outer.get("causality", "local"),
        outer.get("variability", "continuous" if type_name in REALS else "discrete"),
        unit_name,
        units.get(unit_name),
        None if array or type_name in NOT_NUMBERS else _number(typed, "start", typed, shown),
        bounds[0],
        bounds[1],
        outer.get("description", ""),
        array,
    )


def _number(element: Element, name: str, fallback: Element, shown: str) -> float | None:
    text = element.get(name, fallback.get(name))
    if text in (None, "true", "false"):
        return None if text is None else float(text == "true")
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{shown} line {element.sourceline}: {name}='{text}' is not a number") from None
