"""Clocks of FMI 3 that are connected: whose tick activates which clock of another FMU, checked.

A source is a triggered output clock, or a time-based input clock that the run ticks (a connection by terminal
allows that); a target is a triggered input clock.  What they clock moves when they tick (core/clocks.c).
Source: FMI 3.0.2, 2.2.8 and 4.2.2; FMI-LS-BUS 1.0.0, Tx and Rx clocks.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from orchestrator.fmi.component import Component
from orchestrator.fmi.variable import ClockInfo, Variable
from orchestrator.ssp.description import Port
from orchestrator.ssp.text import Place
from orchestrator.system.graph import Graph
from specs.errors import InputError

TRIGGERED = "triggered"
IN_STEPS = ("jacobi", "gauss-seidel")  # algorithms that take no step back
DIVIDING = "jacobi"  # the one whose steps clocks of connected components may divide


@dataclass(frozen=True)
class ClockLink:
    """When `source` ticks, so does `target`; `place`: of the connection into the target."""

    source: Port
    target: Port
    place: Place


def clock_links(graph: Graph) -> tuple[ClockLink, ...]:
    """All connections between clocks; InputError for ends that cannot be connected, and for a circle."""
    found = []
    for port, connection in graph.incoming.items():
        target = graph.nodes[port].variable
        if target is None or target.type != "Clock":
            continue
        root = graph.chain(port)[0].start
        source = graph.nodes[root].variable
        shown = f"{connection.place}: {root} and {port}"
        if source is None or source.type != "Clock":
            raise InputError(f"{shown}: {port} is a clock, {root} is none of an FMU")
        _check_ends(source, target, shown)
        found.append(ClockLink(root, port, connection.place))
    _check_circles(found, graph.components)
    return tuple(found)


def check_components(links: Sequence[ClockLink], components: Mapping[str, Component], algorithm: str) -> None:
    """InputError for FMUs and algorithms that connected clocks cannot tick in."""
    for link in links:
        for port in (link.source, link.target):
            component = components[port.owner]
            if not component.model.has_event_mode:
                raise InputError(
                    f"{component}: clock {port.name} is connected, but its FMU has no event mode"
                )
            if component.multiple != 1:
                raise InputError(
                    f"{component}: clock {port.name} is connected, but the component does not step with the "
                    "system; connected clocks need the system's step"
                )
            if component.timed and algorithm in IN_STEPS and algorithm != DIVIDING:
                raise InputError(
                    f"{component}: clock {next(iter(component.timed))} ticks inside steps beside connected "
                    f"clocks, which algorithm '{algorithm}' cannot divide; valid: {DIVIDING}"
                )
        if algorithm not in IN_STEPS:
            raise InputError(
                f"{link.place}: {link.source} and {link.target} are clocks, and algorithm '{algorithm}' "
                f"takes steps back; valid: {', '.join(IN_STEPS)}"
            )


def sources(links: Sequence[ClockLink], component: str) -> list[str]:
    """Clocks of a component that tick others."""
    return list(dict.fromkeys(link.source.name for link in links if link.source.owner == component))


def targets(links: Sequence[ClockLink], component: str) -> list[str]:
    """Clocks of a component that are ticked by others."""
    return [link.target.name for link in links if link.target.owner == component]


def moving_with(links: Sequence[ClockLink], component: Component, variable: Variable) -> tuple[str, ...]:
    """The clocks that a variable moves with: the connected one, time-based ones; (): with every step."""
    connected = clock_of(links, component, variable)
    own = [name for name in variable.clocks if name in component.clocks or name in component.timed]
    return tuple(dict.fromkeys([connected, *own] if connected else own))


def clock_of(links: Sequence[ClockLink], component: Component, variable: Variable) -> str:
    """The connected clock that a variable moves with: a source of outputs, a target of inputs; "": none."""
    known = (sources if variable.causality != "input" else targets)(links, component.name)
    return next((name for name in variable.clocks if name in known), "")


def in_events(links: Sequence[ClockLink], component: Component, variable: Variable) -> bool:
    """Whether a variable is an input that is set in event mode only: discrete, with event mode (FMI 3.0).

    Components with connected clocks have the events of their clocks only: inputs are set with every step.
    """
    model = component.model
    if not model.has_event_mode or model.scheduled or variable.clocks or variable.causality != "input":
        return False
    owners = {end.owner for link in links for end in (link.source, link.target)}
    return variable.variability == "discrete" and component.name not in owners


def _check_ends(source: Variable, target: Variable, shown: str) -> None:
    gives, takes = _kind(source), _kind(target)
    if not (takes == TRIGGERED and target.causality == "input"):
        raise InputError(
            f"{shown}: {target.name} is a {takes} {target.causality} clock; valid: a triggered input"
        )
    timed = source.clock is not None and source.clock.time_based
    triggered = gives == TRIGGERED and source.causality == "output"
    if not triggered and not (source.causality == "input" and timed):
        raise InputError(
            f"{shown}: {source.name} is a {gives} {source.causality} clock; valid: a triggered output, or a "
            "time-based input"
        )


def _kind(variable: Variable) -> str:
    return (variable.clock or ClockInfo("")).interval_variability


def _check_circles(links: Sequence[ClockLink], components: Mapping[str, Component]) -> None:
    """A clock that ticks itself: by connections, and output clocks that say that input clocks tick them."""
    for link in links:
        circle = _circle(links, components, link)
        if circle:
            text = " → ".join(f"{a.source} → {a.target}" for a in circle)
            raise InputError(f"{link.place}: clock circle: {text} → {link.source}")


def _circle(
    links: Sequence[ClockLink], components: Mapping[str, Component], first: ClockLink
) -> list[ClockLink]:
    ways, reached = [[first]], {first.target}
    while ways:
        way = ways.pop()
        for link in _ticked_by(links, components, way[-1].target):
            if link == first:
                return way
            if link.target not in reached:
                reached.add(link.target)
                ways.append([*way, link])
    return []


def _ticked_by(
    links: Sequence[ClockLink], components: Mapping[str, Component], port: Port
) -> Iterator[ClockLink]:
    """Links of output clocks of the same FMU that this input clock ticks at once, as far as listed."""
    known = components[port.owner].model.dependencies
    for link in links:
        if link.source.owner == port.owner and port.name in (known.get(link.source.name) or ()):
            yield link
