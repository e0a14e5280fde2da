"""Reads our annotation of a system description: what SSP leaves to importers, or does not know.

<ssc:Annotation type="slewright.simulation">
  <slw:Simulation xmlns:slw="urn:slewright:simulation" stepSize="0.02" algorithm="iterate"
                      tolerance="1e-6"
                  maxIterations="50" maxHalvings="16">
    <slw:Component name="plant.valve" stepSize="0.1"/>
    <slw:Fault target="pi.q_slew" kind="bias" start_s="10" value="0.05"/>
    <slw:TerminalConnection startElement="pi" startTerminal="command_out"
                            endElement="plant.valve" endTerminal="command_in"/>
  </slw:Simulation>
</ssc:Annotation>
"""

from collections.abc import Iterator

from orchestrator.files import xml_file
from orchestrator.files.xml_file import Element
from orchestrator.ssp.description import ALGORITHMS, Settings, Simulation, TerminalConnection
from orchestrator.ssp.text import Place, Text
from specs.errors import nearest
from specs.faults import Fault, from_attributes
from specs.ssd import ANNOTATION, SIMULATION

ATTRIBUTES = ("stepSize", "algorithm", "tolerance", "maxIterations", "maxHalvings")
CHILDREN = ("Component", "Fault", "TerminalConnection")
ENDS = ("startElement", "startTerminal", "endElement", "endTerminal")
MAX_ITERATIONS, MAX_HALVINGS = 100_000, 40


def read_simulation(text: Text, root: Element) -> Simulation:
    """Our annotation of the root element; elsewhere it is warned about.

    Raises InputError, naming the line, for an unknown name and a value that cannot be.
    """
    found = [a for a in root.iter("{*}Annotation") if a.get("type") == ANNOTATION]
    simulation = Simulation()
    for annotation in found:
        holder = annotation.getparent()
        if holder is None or holder.getparent() is not root:
            text.warn(annotation, f"annotation {ANNOTATION} is read on <SystemStructureDescription> only")
            continue
        for child in annotation:
            if child.tag != f"{{{SIMULATION}}}Simulation":
                raise text.error(child, f"<{xml_file.local(child)}> in our annotation; valid: Simulation")
            if simulation.place is not None:
                raise text.error(child, "second <Simulation>")
            simulation = _simulation(text, child)
    return simulation


def _simulation(text: Text, element: Element) -> Simulation:
    _check_names(text, element, ATTRIBUTES)
    for child in element:
        name = xml_file.local(child)
        if name not in CHILDREN or not child.tag.startswith(f"{{{SIMULATION}}}"):
            raise text.error(child, f"<{name}> inside <Simulation>; {nearest(name, CHILDREN)}")
    return Simulation(
        _positive(text, element, "stepSize") if element.get("stepSize") is not None else None,
        _settings(text, element),
        _steps(text, element),
        tuple(_faults(text, element)),
        tuple(_terminal_connections(text, element)),
        text.place(element),
    )


def _settings(text: Text, element: Element) -> Settings:
    default = Settings()
    algorithm = element.get("algorithm", default.algorithm)
    if algorithm not in ALGORITHMS:
        raise text.error(element, f"unknown algorithm '{algorithm}'; {nearest(algorithm, ALGORITHMS)}")
    return Settings(
        algorithm,
        _positive(text, element, "tolerance", default.tolerance),
        _count(text, element, "maxIterations", default.max_iterations, 1, MAX_ITERATIONS),
        _count(text, element, "maxHalvings", default.max_halvings, 0, MAX_HALVINGS),
    )


def _steps(text: Text, element: Element) -> dict[str, tuple[float, Place]]:
    steps: dict[str, tuple[float, Place]] = {}
    for child in element.iterfind(f"{{{SIMULATION}}}Component"):
        _check_names(text, child, ("name", "stepSize"))
        name = text.name(child)
        text.name(child, "stepSize")
        if name in steps:
            raise text.error(child, f"second <Component> named '{name}'")
        steps[name] = _positive(text, child, "stepSize"), text.place(child)
    return steps


def _faults(text: Text, element: Element) -> list[tuple[Fault, Place]]:
    return [
        (from_attributes({str(k): str(v) for k, v in child.attrib.items()}, f"{place}: <Fault>"), place)
        for child in element.iterfind(f"{{{SIMULATION}}}Fault")
        for place in [text.place(child)]
    ]


def _terminal_connections(text: Text, element: Element) -> Iterator[TerminalConnection]:
    for child in element.iterfind(f"{{{SIMULATION}}}TerminalConnection"):
        _check_names(text, child, ENDS)
        start, terminal, end, other = (text.name(child, key) for key in ENDS)
        yield TerminalConnection((start, terminal), (end, other), text.place(child))


def _check_names(text: Text, element: Element, valid: tuple[str, ...]) -> None:
    for name in element.attrib:
        if name not in valid:
            raise text.error(
                element, f"attribute '{name}' of <{xml_file.local(element)}>; {nearest(str(name), valid)}"
            )


def _positive(text: Text, element: Element, name: str, default: float = 0.0) -> float:
    value = xml_file.number(element, name, default, text.shown)
    if not value > 0.0:
        raise text.error(element, f"{name} must be positive, not {element.get(name)}")
    return value


def _count(text: Text, element: Element, name: str, default: int, low: int, high: int) -> int:
    value = xml_file.integer(element, name, default, text.shown)
    if not low <= value <= high:
        raise text.error(element, f"{name} = {value}; valid: {low} … {high}")
    return value
