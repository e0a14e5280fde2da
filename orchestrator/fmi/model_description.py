"""What an FMU says of itself: `modelDescription.xml` of FMI 2.0 and 3.0, co-simulation, model exchange and
scheduled execution.

variable_reader.py reads the variables and value_texts.py their values, checks.py judges them, and
model_structure.py reads the dependencies.
Source: FMI 2.0.4, chapters 2.2 and 4.3; FMI 3.0.2, 2.4 and 4.4, Modelica Association.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from orchestrator.files import xml_file
from orchestrator.files.xml_file import Element, local
from orchestrator.fmi import checks
from orchestrator.fmi.model_structure import Dependencies, StructureReader
from orchestrator.fmi.states import check_states
from orchestrator.fmi.units import parse_units
from orchestrator.fmi.variable import FMI2_TYPES, FMI3_TYPES, NOT_NUMBERS, REALS, ClockInfo, Variable, size_of
from orchestrator.fmi.variable_reader import VariableReader
from specs.errors import InputError, nearest

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

VERSION = re.compile(r"(2)\.0(\.[0-9]+)?|(3)\.([0-9]+)(\.[0-9]+)?")
# The library's file name; a C identifier by the standard, but nothing that leaves the folder.
IDENTIFIER = re.compile(r"[\w][\w.\- +]{0,199}", re.ASCII)
CO_SIMULATION, MODEL_EXCHANGE, SCHEDULED = KINDS = ("CoSimulation", "ModelExchange", "ScheduledExecution")
ANY = "any"
# Parts that are read, or that say nothing about a run.
PARTS = (
    "CoSimulation",
    "UnitDefinitions",
    "TypeDefinitions",
    "DefaultExperiment",
    "ModelVariables",
    "ModelStructure",
    "ModelExchange",
    "ScheduledExecution",
    "LogCategories",
    "VendorAnnotations",
    "Annotations",
)


@dataclass(frozen=True)
class Exchange:
    """Model exchange: derivatives and (FMI 3) event indicators by name, each perhaps an array.

    n_indicators     FMI 2: their number
    wants_steps      the FMU is to be told of each step of the integrator
    """

    derivatives: tuple[str, ...]
    indicators: tuple[str, ...] = ()
    n_indicators: int = 0
    wants_steps: bool = True


@dataclass(frozen=True)
class ModelDescription:
    """FMI version (2 or 3), identifiers, variables by name and what the FMU is capable of.

    can_get_set_state, can_serialize_state, provides_directional  as the standard's flags
    has_event_mode         FMI 3: it can be instantiated with event mode
    can_return_early       FMI 3: a step may end before its communication point
    variable_step          canHandleVariableCommunicationStepSize
    fixed_internal_step_s  FMI 3: steps must be a multiple of it; None: not stated
    only_once_per_process  a second instance needs a process of its own
    default_*              DefaultExperiment, None where it says nothing
    dependencies           output to the inputs on which it depends directly at a communication point;
                           None: not stated, it may be all
    initial_dependencies   the same during initialisation
    warnings               sentences on what is not honoured or not as it should be
    exchange               how its states are integrated; None: another kind
    scheduled              scheduled execution: it computes where its clocks tick; it passes for one with
                           event mode that takes any step
    log_categories         what it can be told to log: descriptions by name
    """

    fmi_version: int
    model_name: str
    model_identifier: str
    token: str
    variables: dict[str, Variable]
    can_get_set_state: bool
    can_serialize_state: bool
    provides_directional: bool
    has_event_mode: bool = False
    can_return_early: bool = False
    variable_step: bool = False
    fixed_internal_step_s: float | None = None
    only_once_per_process: bool = False
    default_start_s: float | None = None
    default_stop_s: float | None = None
    default_step_s: float | None = None
    default_tolerance: float | None = None
    dependencies: Dependencies = field(default_factory=dict)
    initial_dependencies: Dependencies = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    version_text: str = ""
    generation_tool: str = ""
    exchange: Exchange | None = None
    scheduled: bool = False
    log_categories: Mapping[str, str] = field(default_factory=dict)

    def variable(self, name: str, shown: str) -> Variable:
        """The variable `name`; InputError with the nearest names, starting with `shown`."""
        if name not in self.variables:
            raise InputError(f"{shown}: no variable '{name}'; {nearest(name, self.variables)}")
        return self.variables[name]

    def structural(self) -> dict[str, int]:
        """Default values of the structural parameters that are whole numbers, for `size_of`."""
        return {
            v.name: v.start
            for v in self.variables.values()
            if v.causality == "structuralParameter" and isinstance(v.start, int)
        }


def parse(content: bytes, shown: str, kind: str = ANY) -> ModelDescription:
    """Parse and check modelDescription.xml; `shown` names the FMU in messages (InputError, with the line).

    `kind`: one of KINDS; ANY: the first of them that the FMU offers.
    """
    root = xml_file.parse(content, shown)
    version = _version(root, shown)
    interface = _interface(root, kind, shown)
    where = f"{shown}, modelDescription.xml"
    if xml_file.boolean(interface, "needsExecutionTool", False, where):
        raise InputError(f"{shown} needs an execution tool; only self-contained FMUs are accepted")
    _check_parts(root, where)
    reader = VariableReader(root, version, parse_units(root.find("UnitDefinitions"), where), where)
    variables = checks.check(reader.variables(), version, where)
    structure = StructureReader(root, version, variables, where)
    exchange = _exchange(root, interface, version, structure, shown)
    _check_scheduled(interface, variables, shown)
    experiment = _experiment(root.find("DefaultExperiment"), where)
    warnings = [
        *_version_warnings(root),
        *checks.unknown_attributes(root, version),
        *checks.warnings(variables.values(), reader.undefined_units),
        *structure.warnings(),
        *(check_states(root, version, structure, where) if exchange else ()),
    ]
    return ModelDescription(
        fmi_version=version,
        model_name=root.get("modelName", ""),
        model_identifier=_identifier(interface, where),
        token=xml_file.required(root, "guid" if version == 2 else "instantiationToken", where),
        variables=variables,
        dependencies=structure.outputs,
        initial_dependencies=structure.initial,
        warnings=tuple(f"{shown}: {warning}" for warning in warnings),
        version_text=root.get("fmiVersion", "").strip(),
        generation_tool=root.get("generationTool", ""),
        fixed_internal_step_s=_positive(interface, "fixedInternalStepSize", where) if version == 3 else None,
        **_capabilities(interface, version, where),
        exchange=exchange,
        scheduled=local(interface) == SCHEDULED,
        log_categories=_log_categories(root, where),
        default_start_s=experiment[0],
        default_stop_s=experiment[1],
        default_step_s=experiment[2],
        default_tolerance=experiment[3],
    )


def _version(root: Element, shown: str) -> int:
    text = root.get("fmiVersion", "").strip()
    found = VERSION.fullmatch(text)
    if root.tag != "fmiModelDescription" or found is None:
        raise InputError(f"{shown} has FMI version '{xml_file.shortened(text)}'; valid: 2.0, 3.0")
    return int(found[1] or found[3])


def _interface(root: Element, kind: str, shown: str) -> Element:
    """The element of the kind that is asked for."""
    offered = [name for name in KINDS if root.find(name) is not None]
    wanted = [name for name in offered if kind in (ANY, name)]
    if not wanted:
        asked = f"none of {', '.join(KINDS)}" if kind == ANY else f"no {kind}"
        raise InputError(f"{shown} offers {asked}; it offers: {', '.join(offered) or 'nothing'}")
    interface = root.find(wanted[0])
    assert interface is not None  # noqa: S101  # `offered` has found it
    return interface


def _exchange(
    root: Element, interface: Element, version: int, structure: StructureReader, shown: str
) -> Exchange | None:
    if local(interface) != MODEL_EXCHANGE:
        return None
    where = f"{shown}, modelDescription.xml"
    if any(v.type == "Clock" and v.causality == "input" for v in structure.variables.values()):
        raise InputError(f"{shown}: input clocks are not supported in model exchange")
    if version == 3:
        told = xml_file.boolean(interface, "needsCompletedIntegratorStep", True, where)
        return Exchange(tuple(structure.derivatives), tuple(structure.indicators), 0, told)
    count = xml_file.as_integer(root.get("numberOfEventIndicators", "0"))
    if count is None or count < 0:
        raise InputError(f"{where}: numberOfEventIndicators is no whole number of 0 or more")
    told = not xml_file.boolean(interface, "completedIntegratorStepNotNeeded", False, where)
    return Exchange(tuple(structure.derivatives), (), count, told)


def _check_scheduled(interface: Element, variables: Mapping[str, Variable], shown: str) -> None:
    clocks = [v for v in variables.values() if v.type == "Clock" and v.causality == "input"]
    if local(interface) == SCHEDULED and not clocks:
        raise InputError(
            f"{shown} offers scheduled execution, but has no input clock: nothing of it would run"
        )


def _version_warnings(root: Element) -> Iterator[str]:
    """A minor version may only add what an importer can do without (FMI 3.0.2, 2.6)."""
    text = root.get("fmiVersion", "").strip()
    if not text.startswith(("2.0", "3.0")):
        yield f"FMI version {text} is read as 3.0; what it adds is not used"


def _check_parts(root: Element, where: str) -> None:
    for element in root:
        name = local(element)
        if element.tag not in PARTS:
            raise InputError(
                f"{where} line {element.sourceline}: unknown element <{name}>; {nearest(name, PARTS)}"
            )
        if sum(other.tag == element.tag for other in root) > 1:
            raise InputError(f"{where} line {element.sourceline}: second element <{name}>")


def _identifier(interface: Element, where: str) -> str:
    name = xml_file.required(interface, "modelIdentifier", where)
    if not IDENTIFIER.fullmatch(name):
        raise InputError(
            f"{where} line {interface.sourceline}: '{xml_file.shortened(name)}' is no modelIdentifier"
        )
    return name


def _log_categories(root: Element, where: str) -> dict[str, str]:
    found = [e for holder in root.iterfind("LogCategories") for e in holder.iterfind("Category")]
    return {xml_file.required(e, "name", where): e.get("description", "") for e in found}


def _capabilities(interface: Element, version: int, where: str) -> Mapping[str, bool]:
    """The flags that an importer must or may follow; those it needs not know are passed over.

    Passed over: interpolation of inputs, output derivatives, asynchronous runs, memory callbacks,
    intermediate update, adjoint derivatives, dependencies per element, evaluation of discrete states.
    """
    state, plural = ("state", "") if version == 2 else ("State", "s")
    names = {
        "can_get_set_state": f"canGetAndSetFMU{state}",
        "can_serialize_state": f"canSerializeFMU{state}",
        "provides_directional": f"providesDirectionalDerivative{plural}",
        "variable_step": "canHandleVariableCommunicationStepSize",
        "only_once_per_process": "canBeInstantiatedOnlyOncePerProcess",
    }
    if version == 3:
        names |= {"has_event_mode": "hasEventMode", "can_return_early": "mightReturnEarlyFromDoStep"}
    found = {key: xml_file.boolean(interface, name, False, where) for key, name in names.items()}
    if local(interface) == MODEL_EXCHANGE:  # its steps and events are the master's
        found |= {"variable_step": True, "has_event_mode": False, "can_return_early": False}
    if local(interface) == SCHEDULED:
        found |= {"variable_step": True, "has_event_mode": True, "can_return_early": False}
    return found


def _experiment(element: Element | None, where: str) -> tuple[float | None, ...]:
    """(start, stop, step, tolerance), None where it is not stated."""
    if element is None:
        return (None,) * 4
    start, stop = (
        None if element.get(name) is None else xml_file.number(element, name, 0.0, where)
        for name in ("startTime", "stopTime")
    )
    if stop is not None and stop < (start or 0.0):
        raise InputError(f"{where} line {element.sourceline}: stopTime {stop} s is before the start time")
    return start, stop, *(_positive(element, name, where) for name in ("stepSize", "tolerance"))


def _positive(element: Element, name: str, where: str) -> float | None:
    if element.get(name) is None:
        return None
    value = xml_file.number(element, name, 0.0, where)
    if not value > 0.0:
        raise InputError(f"{where} line {element.sourceline}: {name}={value} must be positive")
    return value
