"""A checked system: all that the stepping needs, and nothing that could still be wrong with it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from orchestrator.files.scratch import Scratch
from orchestrator.fmi.component import Component
from orchestrator.fmi.model_description import Variable
from orchestrator.fmi.variable import Value, checked_value
from orchestrator.ssp.conversion import apply
from orchestrator.ssp.description import ALGORITHMS, Settings, TerminalConnection
from orchestrator.system.clock_links import ClockLink, check_components
from orchestrator.system.link import Link
from orchestrator.system.terminals import check_bit_rate
from specs.errors import InputError, nearest
from specs.faults import Fault
from specs.units import Unit

SLACK = 1e-9  # relative, of step sizes
ROLLING_BACK = ("iterate", "adaptive")  # they take FMUs back to an earlier state


@dataclass(frozen=True)
class SystemInput:
    """A connector that the scenario drives, in its own unit."""

    name: str
    unit_name: str
    unit: Unit | None
    start: Value
    type: str = "Real"
    size: int = 1
    items: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class SystemParameter:
    """A parameter connector of the system: setting it sets the variables that `links` lead to.

    `start`: the value bound to it, in its own unit, already in the components' start values; None: none.
    """

    name: str
    unit_name: str
    start: Value | None
    type: str
    links: tuple[Link, ...]


@dataclass(frozen=True)
class SystemOutput:
    """A connector that shows what `link` leads to it, in its own unit."""

    name: str
    unit_name: str
    link: Link
    type: str = "Real"
    size: int = 1


@dataclass(frozen=True)
class System:
    """A checked system: components in declared order, links to their inputs, its own inputs and outputs.

    `start_s`, `stop_s`: of its default experiment; `states_step`: it says itself how long its step is.
    `clock_links`: connections between clocks; `terminals`: those by terminal.
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
    clock_links: tuple[ClockLink, ...] = ()
    terminals: tuple[TerminalConnection, ...] = ()
    parameters: Mapping[str, SystemParameter] = field(default_factory=dict)
    start_s: float = 0.0
    states_step: bool = True
    files: Scratch | None = field(default=None, repr=False, compare=False)

    def component(self, name: str) -> Component:
        """The component `name`; InputError with the nearest names."""
        if name not in self.components:
            raise InputError(
                f"system {self.name} has no component '{name}'; {nearest(name, self.components)}"
            )
        return self.components[name]

    def split(self, name: str) -> tuple[Component, str]:
        """Component and variable name of "component.variable"; of component names the longest counts.

        Raises InputError for a name that begins with no component.
        """
        fitting = [owner for owner in self.components if name.startswith(f"{owner}.")]
        if fitting:
            owner = max(fitting, key=len)
            return self.components[owner], name[len(owner) + 1 :]
        owner, dot, _ = name.partition(".")
        if not dot:
            raise InputError(
                f"'{name}' is not of the form component.variable; {nearest(owner, self.components)}"
            )
        raise InputError(
            f"'{name}': system {self.name} has no component '{owner}'; {nearest(owner, self.components)}"
        )

    def start_values(self, parameters: Mapping[str, Value]) -> dict[str, dict[str, Value]]:
        """Start values of every component, `parameters` included: "component.parameter", or a system's own.

        Raises InputError for an unknown name, or a value that does not suit type, bounds or size.
        """
        values = {name: dict(component.start) for name, component in self.components.items()}
        for key, value in parameters.items():
            if key in self.parameters:
                self._set_system_parameter(values, self.parameters[key], value)
                continue
            if "." not in key:
                raise InputError(
                    f"parameter '{key}' is not of the form component.parameter; "
                    f"components: {', '.join(self.components)}"
                    + (f"; parameters of the system: {', '.join(self.parameters)}" if self.parameters else "")
                )
            component, name = self.split(key)
            variable = parameter(component, name)
            size = component.size(variable)
            values[component.name][name] = checked_value(variable, value, f"parameter {key}", size)
        for wanted in self.terminals:
            check_bit_rate(wanted, self.components, values)
        return values

    def _set_system_parameter(
        self, values: Mapping[str, dict[str, Value]], own: SystemParameter, value: Value
    ) -> None:
        for link in own.links:
            component, name = self.components[link.target.owner], link.target.name
            variable = parameter(component, name, ("input",))
            shown = f"parameter {own.name} for {link.target}"
            converted = apply(value, link.conversion)
            values[component.name][name] = checked_value(variable, converted, shown, component.size(variable))

    def check_algorithm(self, algorithm: str) -> None:
        """InputError for an unknown algorithm, and one that a component is not able to take part in."""
        if algorithm not in ALGORITHMS:
            raise InputError(f"unknown algorithm '{algorithm}'; {nearest(algorithm, ALGORITHMS)}")
        check_components(self.clock_links, self.components, algorithm)
        for component in self.components.values():
            if algorithm in ROLLING_BACK and not component.model.can_get_set_state:
                raise InputError(
                    f"{component}: algorithm '{algorithm}' takes steps back, but its FMU cannot get and set "
                    f"its state; valid: {', '.join(a for a in ALGORITHMS if a not in ROLLING_BACK)}"
                )
            if algorithm == "adaptive" and not component.model.variable_step:
                raise InputError(
                    f"{component}: algorithm 'adaptive' changes the step, but its FMU cannot handle that "
                    "(canHandleVariableCommunicationStepSize)"
                )
            if algorithm == "adaptive" and self._halvings(component, 0) < 0:
                raise InputError(
                    f"{component}: algorithm 'adaptive' halves the step of {self.step_s:g} s, but its FMU "
                    f"steps whole multiples of {component.model.fixed_internal_step_s:g} s "
                    "(fixedInternalStepSize)"
                )

    def halvings(self, asked: int) -> int:
        """How often `adaptive` may halve the step: half of the smallest one suits fixed internal steps."""
        return max(0, min((self._halvings(c, asked) for c in self.components.values()), default=asked))

    def _halvings(self, component: Component, asked: int) -> int:
        internal, found = component.model.fixed_internal_step_s, -1
        if not internal or component.multiple != 1:
            return asked
        multiple = self.step_s / internal
        while (
            found < asked and round(multiple) % 2 == 0 and abs(multiple - round(multiple)) < SLACK * multiple
        ):
            multiple, found = multiple / 2.0, found + 1
        return found


def parameter(component: Component, name: str, also: Iterable[str] = ()) -> Variable:
    """The parameter `name` of a component; InputError with the nearest parameters.

    Outputs and local variables that have a start value, such as states, pass for parameters.  `also`: further
    causalities that are accepted.  Structural parameters that give arrays their size are refused: the sizes
    of what is connected were checked with the values of the description.
    """
    variables = component.model.variables
    found = variables.get(name)
    if found is None:
        valid = [v.name for v in variables.values() if v.causality == "parameter"]
        raise InputError(f"component {component.name} has no parameter '{name}'; {nearest(name, valid)}")
    state = found.causality in ("output", "local") and found.start_settable
    if not state and found.causality not in ("parameter", "structuralParameter", *also):
        why = "" if found.causality == "input" else ", and has no start value that can be set"
        raise InputError(f"{component.name}.{name} is of causality {found.causality}, not a parameter{why}")
    if any(name in v.dimensions for v in variables.values()):
        raise InputError(
            f"{component.name}.{name} gives arrays their size; it can only be set in the system description"
        )
    return found
