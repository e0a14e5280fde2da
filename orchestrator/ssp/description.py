"""The content of a system structure description (SSD) as plain data, each part with its place in the file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.ssp.bindings import Binding
from orchestrator.ssp.conversion import Transformation
from orchestrator.ssp.settings import Settings
from orchestrator.ssp.ssc import Typed
from orchestrator.ssp.text import Place
from specs.faults import Fault

__all__ = (
    "SYSTEM",
    "ComponentElement",
    "Connection",
    "Connector",
    "Description",
    "Dictionary",
    "Element",
    "Reference",
    "Simulation",
    "SystemElement",
    "Typed",
)

SYSTEM = ""  # element name of the system itself in a connection


@dataclass(frozen=True)
class Connector:
    """A connector of a system, a component or a signal dictionary reference."""

    name: str
    kind: str
    typed: Typed
    place: Place


@dataclass(frozen=True)
class Connection:
    """Two ends (element, connector) as written, either way round; element `SYSTEM`: the system itself."""

    start: tuple[str, str]
    end: tuple[str, str]
    transformation: Transformation | None
    suppress: bool
    place: Place


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


@dataclass(frozen=True)
class Simulation:
    """Our annotation: step and settings, None where it does not state them; steps of components by path."""

    step_s: float | None = None
    settings: Settings = field(default_factory=Settings)
    steps: Mapping[str, tuple[float, Place]] = field(default_factory=dict)
    faults: tuple[tuple[Fault, Place], ...] = ()
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
