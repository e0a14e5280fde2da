"""From a file to a checked System: what could be wrong with the description is found before the run."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from orchestrator.files import archive
from orchestrator.files.scratch import Scratch
from orchestrator.fmi.model_description import ANY, KINDS
from orchestrator.ssp.description import Description
from orchestrator.ssp.ssd import read_ssd
from orchestrator.system.clock_links import clock_links
from orchestrator.system.clocks import check_step, default_step, with_steps_and_clocks
from orchestrator.system.connections import Connections
from orchestrator.system.flatten import SSD_NAME, Flattener
from orchestrator.system.graph import Graph
from orchestrator.system.interventions import check_faults
from orchestrator.system.order import algebraic_loops
from orchestrator.system.parameters import Parameters
from orchestrator.system.single_fmu import system_of_fmu
from orchestrator.system.sizes import check_total
from orchestrator.system.system import System
from orchestrator.system.terminals import check_bit_rate
from specs.errors import InputError, nearest
from specs.signals import signals

IN_OUT = ("input", "output")


def load_system(path: Path | str, step_s: float | None = None, kind: str = ANY) -> System:
    """Read and check a system: `.ssp`, `.ssd` with its FMUs beside it, or a bare `.fmu`.

    step_s  of a system that states none, or of a bare FMU; None: one that suits the FMUs
    kind    of a bare FMU: one of KINDS of model_description.py, or any (a system says it of each component)

    Raises InputError, naming element and line, for whatever could not be simulated as described.
    """
    path = Path(path)
    check_step(step_s, f"system {path}")
    if path.suffix.lower() == ".fmu":
        return system_of_fmu(path, step_s, kind)
    if kind != ANY:
        raise InputError(
            f"system {path} says of each component whether it is {' or '.join(KINDS)} (implementation=…)"
        )
    files, warnings = Scratch(), []
    ssd = path
    if path.suffix.lower() != ".ssd":
        ssd = files.path / "ssp" / SSD_NAME
        archive.unpack(path, ssd.parent, f"system {path}")
        if not ssd.is_file():
            raise InputError(f"system {path} holds no {SSD_NAME}")
        if others := sorted(p.name for p in ssd.parent.glob("*.ssd") if p.name != SSD_NAME):  # SSP 2.0, 3
            warnings.append(f"the package also holds {', '.join(others)}; {SSD_NAME} is used")
    root = ssd.resolve().parent
    text = read_ssd(root / ssd.name, root, ssd.name, warnings)
    return _checked(text, root, files, warnings, step_s)


def _checked(
    text: Description, root: Path, files: Scratch, warnings: list[str], given_s: float | None
) -> System:
    graph = Flattener(root, files.path, warnings).flatten(text)
    if not graph.components:
        raise InputError(f"system {text.name} has no component")
    parameters = Parameters(graph)
    step_s = _step(text, graph, given_s)
    start = parameters.by_component()
    started = {n: replace(c, start=start[n]) for n, c in graph.components.items()}
    check_total(started.values())
    for wanted in text.simulation.terminals:
        check_bit_rate(wanted, started, start)
    ticking = clock_links(graph)
    components = with_steps_and_clocks(graph, started, text.simulation, step_s, ticking)
    connections = Connections(graph, parameters, components)
    system = System(
        name=text.name,
        step_s=step_s,
        start_s=text.start_s,
        stop_s=text.stop_s,
        settings=text.simulation.settings,
        components=components,
        links=connections.links,
        clock_links=ticking,
        terminals=text.simulation.terminals,
        inputs=connections.inputs,
        outputs=connections.outputs,
        warnings=(
            *_step_warning(text, given_s, step_s),
            *_warnings(text, graph, connections),
            *graph.warnings,
            *dict.fromkeys(w for c in components.values() for w in c.model.warnings),
        ),
        parameters=connections.settable,
        faults=tuple(fault for fault, _ in text.simulation.faults),
        files=files,
    )
    system.check_algorithm(system.settings.algorithm)
    for fault, place in text.simulation.faults:
        try:
            check_faults(system, [fault])
        except InputError as error:
            raise InputError(f"{place}: {error}") from None
    return replace(system, warnings=(*system.warnings, *_loops(system)))


def _step(text: Description, graph: Graph, given_s: float | None) -> float:
    """The step that the description states, else the one given, else one that suits its FMUs."""
    own = text.simulation.step_s
    if own is not None and given_s is not None and own != given_s:
        raise InputError(
            f"{text.simulation.place}: system {text.name} states its step itself, {own:g} s; "
            f"it cannot be run with {given_s:g} s"
        )
    if own or given_s:
        return own or given_s or 0.0
    chosen = {path for path, _ in text.simulation.steps.items()}
    components = [c for path, c in graph.components.items() if path not in chosen]
    return default_step(c.model.fixed_internal_step_s for c in components)


def _step_warning(text: Description, given_s: float | None, step_s: float) -> Iterator[str]:
    if text.simulation.step_s is None and given_s is None:
        yield f"system {text.name} states no step size; {step_s:g} s is used (--step S chooses another)"


def _loops(system: System) -> Iterator[str]:
    """Algebraic loops, with their members: solved at the start, and what becomes of them in steps."""
    algorithm = system.settings.algorithm
    in_steps = {
        "iterate": "and in every step",
        "adaptive": "opened in steps, which are halved until that does no harm",
    }.get(algorithm, f"opened in steps, in which {algorithm} takes values of the last one")
    for members in algebraic_loops(system):
        yield f"algebraic loop of {', '.join(members)}: solved at the start, {in_steps}"


def _warnings(text: Description, graph: Graph, connections: Connections) -> Iterator[str]:
    """What is accepted, but may not be meant."""
    yield from _unknown_signals([c.name for c in text.system.connectors.values() if c.kind in IN_OUT])
    for node in graph.nodes.values():
        own = not node.port.owner and node.port.side == ""
        if own and node.port not in graph.outgoing and node.port not in graph.incoming:
            yield f"system {node.kind} {node.port.name} is not connected"
    yield from connections.loose_ends()
    yield from _unconnected(connections)


def _unknown_signals(names: list[str]) -> Iterator[str]:
    """Slips in a system of the handler; a system without any of its signals is another machine's."""
    known = signals()
    if any(name in known for name in names):
        for name in (n for n in names if n not in known):
            yield f"system connector {name} is no signal of specs/signals.toml; {nearest(name, known)}"


def _unconnected(connections: Connections) -> Iterator[str]:
    """Inputs of FMUs that keep their start value; an alias of one that is driven is driven too."""
    targets = [link.target for link in connections.driving]
    for component in connections.components.values():
        variables = component.model.variables
        driven = {variables[target.name].vr for target in targets if target.owner == component.name}
        for variable in variables.values():
            if variable.causality != "input" or variable.type == "Clock" or variable.vr in driven:
                continue
            value = component.start.get(variable.name, variable.start)
            name = f"{component.name}.{variable.name}"
            yield f"input {name} is not connected and keeps its start value {value}"
