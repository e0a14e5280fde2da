"""What a scenario does to a running system: faults and parameter changes, checked against the system."""

from collections.abc import Mapping, Sequence

from orchestrator.fmi.model_description import NOT_NUMBERS, REALS
from orchestrator.fmi.variable import Scalar, Value, checked_value
from orchestrator.ssp.description import Port
from orchestrator.system.clock_links import clock_of
from orchestrator.system.system import System
from specs.errors import InputError, nearest
from specs.faults import FAIL, Fault

Changes = Mapping[int, Mapping[str, Value]]


def resolve(system: System, name: str, what: str) -> tuple[str, str]:
    """Component and variable of "component.variable"; InputError, naming `what`, when there is none."""
    component, variable_name = system.split(name)
    variable = component.model.variable(variable_name, f"{what} {name}")
    return component.name, variable.name


def check_faults(system: System, faults: Sequence[Fault]) -> None:
    """InputError for a fault on what is not there, not connected or no real number, or at no whole tick."""
    for fault in faults:
        where = f"fault '{fault.kind}' on {fault.target}"
        try:
            fault.ticks(system.step_s)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        if fault.kind == FAIL:
            if fault.target not in system.components:
                raise InputError(f"{where}: no such component; {nearest(fault.target, system.components)}")
        elif fault.target in system.inputs or fault.target in system.outputs:
            connector = {**system.inputs, **system.outputs}[fault.target]
            _check_real(connector.type, connector.size, where)
            _check_unconverted(system, fault, where)
        else:
            _check_input(system, fault, where)


def _check_input(system: System, fault: Fault, where: str) -> None:
    linked = [str(link.target) for link in system.links]
    if fault.target not in linked:
        choices = [*linked, *system.inputs, *system.outputs]
        raise InputError(f"{where}: no connected input and no connector; {nearest(fault.target, choices)}")
    owner, name = resolve(system, fault.target, "fault on")
    component = system.components[owner]
    variable = component.model.variables[name]
    _check_real(variable.type, component.size(variable), where)
    _check_unclocked(system, Port(owner, name), where)


def _check_unclocked(system: System, target: Port, where: str) -> None:
    """Faults act at the begin of a step, and what connected clocks tick moves at other times."""
    component = system.components[target.owner]
    clock = clock_of(system.clock_links, component, component.model.variables[target.name])
    if clock:
        raise InputError(f"{where}: {target} moves with the clock {clock}, and has no faults")


def _check_unconverted(system: System, fault: Fault, where: str) -> None:
    """A fault on a system input acts where it arrives, so it must arrive in the input's own unit."""
    for link in system.links:
        if link.source == Port("", fault.target):
            _check_unclocked(system, link.target, where)
        if link.source == Port("", fault.target) and not link.conversion.is_identity:
            raise InputError(
                f"{where}: it is converted on its way to {link.target}; state the fault on {link.target}"
            )


def _check_real(kind: str, size: int, where: str) -> None:
    if kind not in REALS or size != 1:
        raise InputError(f"{where}: faults act on single real values, this is {kind}{' array' * (size > 1)}")


def check_changes(system: System, changes: Changes) -> dict[int, dict[str, dict[str, Scalar]]]:
    """Parameter changes by tick, component and variable; InputError for what cannot change in a run."""
    found: dict[int, dict[str, dict[str, Scalar]]] = {}
    for tick, values in changes.items():
        if not isinstance(tick, int) or tick < 0:
            raise InputError(f"parameters change at whole ticks from 0 on, not at {tick!r}")
        for name, value in values.items():
            owner, variable_name = resolve(system, name, "parameter change")
            variable = system.components[owner].model.variables[variable_name]
            if variable.causality != "parameter" or variable.variability != "tunable":
                variables = system.components[owner].model.variables.values()
                tunable = [
                    v.name for v in variables if v.causality == "parameter" and v.variability == "tunable"
                ]
                raise InputError(
                    f"{name} cannot change during a run: it is {variable.variability} {variable.causality}; "
                    f"{nearest(variable_name, tunable) if tunable else f'{owner} has no tunable parameter'}"
                )
            checked = checked_value(variable, value, f"parameter {name}")
            if variable.type in NOT_NUMBERS or variable.array or isinstance(checked, tuple):
                raise InputError(f"{name} cannot change during a run: only single numbers do")
            found.setdefault(tick, {}).setdefault(owner, {})[variable_name] = checked
    return found
