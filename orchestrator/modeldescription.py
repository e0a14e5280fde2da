"""What an FMU says of itself: `modelDescription.xml` of FMI 2.0 and 3.0, co-simulation."""

from dataclasses import dataclass

from orchestrator import xmlfile
from orchestrator.modelvariables import VariableReader
from orchestrator.units import parse_units
from orchestrator.variable import FMI2_TYPES, FMI3_TYPES, NOT_NUMBERS, REALS, ClockInfo, Variable, size_of
from orchestrator.xmlfile import Element
from specs.errors import InputError, nearest
from specs.units import Unit

__all__ = (
    "FMI2_TYPES",
    "FMI3_TYPES",
    "NOT_NUMBERS",
    "REALS",
    "ClockInfo",
    "ModelDescription",
    "Variable",
    "parse",
    "size_of",
)


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
    found: dict[str, Variable] = {}
    for variable in VariableReader(root, version, units, shown).variables():
        if variable.name in found:
            raise InputError(f"{shown} line {variable.line}: has two variables '{variable.name}'")
        found[variable.name] = variable
    return found
