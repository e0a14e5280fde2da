"""A checked system: all that the stepping needs, and nothing that could still be wrong with it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.archive import Scratch
from orchestrator.conversion import Conversion
from orchestrator.modeldescription import NOT_NUMBERS, REALS, ModelDescription, Variable
from orchestrator.variable import Value, size_of
from specs.errors import InputError, nearest
from specs.faults import Fault
from specs.units import Unit

ALGORITHMS = ("jacobi", "gauss-seidel", "iterate", "adaptive")


@dataclass(frozen=True)
class Settings:
    """How a system is stepped; a system description states it in our annotation.

    algorithm       one of ALGORITHMS
    tolerance       relative, of "iterate" (change between sweeps) and "adaptive" (local error of a step);
                    also that with which algebraic loops are solved at the start
    max_iterations  sweeps of "iterate" and of algebraic loops before a run fails
    max_halvings    how often "adaptive" may halve the system's step: the smallest is step_s / 2**max_halvings
    """

    algorithm: str = "jacobi"
    tolerance: float = 1e-6
    max_iterations: int = 50
    max_halvings: int = 16


@dataclass(frozen=True)
class Component:
    """An FMU unpacked in `folder`, with the binary for this platform and its start values by variable.

    The name of a component in a nested system is its path, `outer.inner`.
    """

    name: str
    model: ModelDescription
    folder: Path
    library: Path
    sha256: str
    start: Mapping[str, Value]
    multiple: int = 1  # it steps once in so many steps of the system
    line: int = 0  # in the SSD; 0: there is none

    def size(self, variable: Variable) -> int:
        """Number of elements of one of its variables, with the structural parameters it starts with."""
        model = self.model.structural()
        return size_of(variable, {name: int(self.start.get(name, model[name])) for name in model})  # type: ignore[arg-type]


@dataclass(frozen=True)
class Source:
    """Where a value comes from: an FMU variable, or a system input where `component` is empty."""

    component: str
    name: str


@dataclass(frozen=True)
class Link:
    """target = conversion(source): unit conversion and transformation of a connection in one map.

    Arrays are connected whole, element by element.
    """

    source: Source
    component: str
    name: str
    conversion: Conversion
    line: int = 0


@dataclass(frozen=True)
class SystemInput:
    """A connector that the scenario drives, in its own unit."""

    name: str
    unit_name: str
    unit: Unit | None
    start: Value
    type: str = "Real"
    size: int = 1


@dataclass(frozen=True)
class SystemOutput:
    """A connector that shows conversion(source) in its own unit."""

    name: str
    unit_name: str
    source: Source
    conversion: Conversion
    type: str = "Real"
    size: int = 1
    line: int = 0


@dataclass(frozen=True)
class System:
    """A checked system: components in declared order, links to their inputs, its own inputs and outputs.

    `warnings` are full sentences for the user.  The unpacked FMUs live as long as this object.
    """

    name: str
    step_s: float
    stop_s: float | None
    settings: Settings
    components: Mapping[str, Component]
    links: tuple[Link, ...]
    inputs: Mapping[str, SystemInput]
    outputs: Mapping[str, SystemOutput]
    warnings: tuple[str, ...]
    faults: tuple[Fault, ...] = ()
    files: Scratch | None = field(default=None, repr=False, compare=False)

    def component(self, name: str) -> Component:
        """The component `name`; InputError with the nearest names."""
        if name not in self.components:
            raise InputError(
                f"system {self.name} has no component '{name}'; {nearest(name, self.components)}"
            )
        return self.components[name]

    def start_values(self, parameters: Mapping[str, Value]) -> dict[str, dict[str, Value]]:
        """Start values of every component, `parameters` ("component.parameter": value) included.

        Raises InputError for an unknown name or a value out of bounds.
        """
        values = {name: dict(component.start) for name, component in self.components.items()}
        for key, value in parameters.items():
            owner, dot, name = key.partition(".")
            if not dot:
                raise InputError(
                    f"parameter '{key}' is not of the form component.parameter; "
                    f"components: {', '.join(self.components)}"
                )
            variable = parameter(self.component(owner), name)
            values[owner][name] = checked_value(variable, value, f"parameter {key}")
        return values


def parameter(component: Component, name: str) -> Variable:
    """The parameter `name` of a component; InputError with the nearest parameters."""
    found = component.model.variables.get(name)
    if found is not None and found.causality != "parameter":
        raise InputError(f"{component.name}.{name} is of causality {found.causality}, not a parameter")
    if found is None:
        valid = [v.name for v in component.model.variables.values() if v.causality == "parameter"]
        raise InputError(f"component {component.name} has no parameter '{name}'; {nearest(name, valid)}")
    return found


def checked_value(variable: Variable, value: Value, where: str) -> float:
    """`value` if it suits the variable's type and bounds; InputError, starting with `where`, if not."""
    if variable.array or variable.type in NOT_NUMBERS:
        raise InputError(
            f"{where}: variables of type {variable.type}{' array' * variable.array} cannot be set"
        )
    number = float(value)  # type: ignore[arg-type]
    unit = f" {variable.unit_name}" if variable.unit_name else ""
    low = float("-inf") if variable.min is None else variable.min
    high = float("inf") if variable.max is None else variable.max
    if not low <= number <= high or number in (float("inf"), float("-inf")):
        raise InputError(f"{where} = {number:g}{unit} is out of bounds; valid: {low:g} … {high:g}{unit}")
    if variable.type not in REALS and number != int(number):
        raise InputError(f"{where} = {number:g}, but its type is {variable.type}")
    return number
