"""The content of a system structure description (SSD) as plain data, each part with its line."""

from dataclasses import dataclass

from orchestrator.units import Affine
from specs.units import Unit

SYSTEM = ""  # element name of the system itself in a connection


@dataclass(frozen=True)
class Connector:
    """A connector of the system or of a component; type and unit are empty where the SSD leaves them out."""

    name: str
    kind: str
    type: str
    unit_name: str
    unit: Unit | None
    line: int


@dataclass(frozen=True)
class ParameterValue:
    """A start value from a parameter set; `unit` None: given in the unit of the variable."""

    name: str
    value: float | str
    type: str
    unit: Unit | None
    where: str


@dataclass(frozen=True)
class Component:
    """An FMU in the system, its connectors by name and its parameter values in ascending precedence."""

    name: str
    source: str
    connectors: dict[str, Connector]
    parameters: tuple[ParameterValue, ...]
    line: int


@dataclass(frozen=True)
class Connection:
    """Two ends (element, connector) as written, either way round; element `SYSTEM`: the system itself."""

    start: tuple[str, str]
    end: tuple[str, str]
    transformation: Affine
    suppress_unit_conversion: bool
    line: int


@dataclass(frozen=True)
class Description:
    """One SSD: `step_s` and `algorithm` come from our annotation, None where it is absent."""

    name: str
    version: str
    connectors: dict[str, Connector]
    components: dict[str, Component]
    connections: tuple[Connection, ...]
    parameters: tuple[ParameterValue, ...]
    stop_s: float | None = None
    step_s: float | None = None
    algorithm: str | None = None
