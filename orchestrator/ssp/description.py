"""The content of a system structure description (SSD) as plain data, each part with its place in the file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.ssp.bindings import Binding
from orchestrator.ssp.conversion import Transformation
from orchestrator.ssp.ssc import Typed
from orchestrator.ssp.text import Place
from specs.faults import Fault

__all__ = (
    "ALGORITHMS",
    "SYSTEM",
    "ComponentElement",
    "Connection",
    "Connector",
    "Description",
    "Dictionary",
    "Element",
    "Port",
    "Reference",
    "Settings",
    "Simulation",
    "SystemElement",
    "TerminalConnection",
    "Typed",
)

SYSTEM = ""  # owner of a port of the system itself

# Sides of a port: of a system or FMU; of the component that stands for a system of another file; of a signal
# in a dictionary; of a dictionary reference where signals go in.
INNER, OUTER, SIGNAL, INTO = "", "outer", "signal", "into"


@dataclass(frozen=True)
class Port:
    """A point that a signal passes: connector `name` of the element `owner`.

    In a description the owner is an element of the same system, in a `Graph` the element's path.
    """

    owner: str
    name: str
    side: str = INNER

    def __str__(self) -> str:
        return f"{self.owner}.{self.name}" if self.owner else f"system connector {self.name}"


@dataclass(frozen=True)
class Connector:
    """A connector of a system, a component or a signal dictionary reference."""

    name: str
    kind: str
    typed: Typed
    place: Place


@dataclass(frozen=True)
class Connection:
    """From one port to another: in a description either way round, in a `Graph` as the signal goes."""

    start: Port
    end: Port
    place: Place
    transformation: Transformation | None = None
    suppress: bool = False


@dataclass(frozen=True)
class Element:
    """What systems and their elements have in common; bindings stand in ascending precedence."""

    name: str
    connectors: Mapping[str, Connector]
    bindings: tuple[Binding, ...]
    place: Place


@dataclass(frozen=True)
class ComponentElement(Element):
    """An FMU, or another system description, by its source; None: there is no implementation."""

    source: str | None = None
    type: str = ""
    implementation: str = "any"


@dataclass(frozen=True)
class Reference(Element):
    """The place of a signal dictionary in a system; its connectors are signals of the dictionary."""

    dictionary: str = ""


@dataclass(frozen=True)
class Dictionary:
    """A signal dictionary: its signals by name."""

    name: str
    entries: Mapping[str, Typed]
    place: Place


@dataclass(frozen=True)
class SystemElement(Element):
    """A system with its elements by name."""

    elements: Mapping[str, Element] = field(default_factory=dict)
    connections: tuple[Connection, ...] = ()
    dictionaries: Mapping[str, Dictionary] = field(default_factory=dict)


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
class TerminalConnection:
    """Two terminals of FMUs, each (path of the component, name of the terminal)."""

    start: tuple[str, str]
    end: tuple[str, str]
    place: Place

    @property
    def ends(self) -> tuple[tuple[str, str], tuple[str, str]]:
        """Start and end."""
        return self.start, self.end


@dataclass(frozen=True)
class Simulation:
    """Our annotation: step and settings, None where it does not state them; steps of components by path."""

    step_s: float | None = None
    settings: Settings = field(default_factory=Settings)
    steps: Mapping[str, tuple[float, Place]] = field(default_factory=dict)
    faults: tuple[tuple[Fault, Place], ...] = ()
    terminals: tuple[TerminalConnection, ...] = ()
    place: Place | None = None


@dataclass(frozen=True)
class Description:
    """One SSD file: `ids` are its systems by their id, for components that refer to them."""

    path: Path
    name: str
    version: str
    system: SystemElement
    ids: Mapping[str, SystemElement]
    start_s: float
    stop_s: float | None
    simulation: Simulation
    experiment: Place | None = None  # of its default experiment
