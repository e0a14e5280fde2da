"""Systems: which components there are and which signal goes where; `<name>.toml` is the one definition.

    [components.slew]
    fmu = "slew"                              # folder and file name of the model
    inputs.system = ["disturbance_torque_slew"]   # system-level inputs of the same name
    inputs.arm = ["inertia", "inertia_rate"]      # outputs of the component `arm`

    offered.slew = ["p_slew_a"]               # not connected unless a model in its place wants them

    [outputs]
    slew = ["q_slew", "q_slew as true_q_slew"]    # system-level outputs, renamed with `as`

Every connector is a signal of `specs/signals.toml`, which has its unit.  The SSDs are generated from here.
"""

import tomllib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from specs.errors import InputError, nearest
from specs.signals import signal

FOLDER = Path(__file__).parent
SYSTEM = "system"  # how a definition names the system itself as a source


@dataclass(frozen=True)
class Connector:
    """One end of a connection; `component` is empty for a connector of the system itself."""

    component: str
    name: str


@dataclass(frozen=True)
class Connection:
    """A signal goes from an output (or a system input) to an input (or a system output)."""

    source: Connector
    target: Connector


@dataclass(frozen=True)
class Component:
    """An instance of the model in the folder `fmu`."""

    name: str
    fmu: str
    description: str


@dataclass(frozen=True)
class SystemSpec:
    """One system: components in declared order, its inputs and outputs, all connections, step in s.

    `offered` are connections that a component does without, and a model in its place may take.
    """

    name: str
    description: str
    step_s: float
    stop_s: float
    components: tuple[Component, ...]
    connections: tuple[Connection, ...]
    offered: tuple[Connection, ...] = ()

    @property
    def inputs(self) -> tuple[str, ...]:
        """System-level inputs, in order of first use."""
        return tuple(dict.fromkeys(c.source.name for c in self.connections if not c.source.component))

    @property
    def outputs(self) -> tuple[str, ...]:
        """System-level outputs, in declared order."""
        return tuple(c.target.name for c in self.connections if not c.target.component)

    def connectors(self, component: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """(inputs, outputs) of a component that take part in a connection."""
        inputs = [c.target.name for c in self.connections if c.target.component == component]
        outputs = [c.source.name for c in self.connections if c.source.component == component]
        return tuple(dict.fromkeys(inputs)), tuple(dict.fromkeys(outputs))

    def fitted(self, component: str, inputs: Collection[str]) -> "SystemSpec":
        """The system with a model in the place of `component` that has these `inputs`: offers it takes."""
        wanted = [c for c in self.offered if c.target.component == component and c.target.name in inputs]
        return replace(self, connections=(*self.connections, *wanted)) if wanted else self

    def without(self, component: str) -> "SystemSpec":
        """The system with `component` taken out: it is to be driven from outside.

        The component's outputs become inputs of the system, and what it reads or may read outputs.
        """
        kept = [
            replace(c, source=Connector("", c.source.name)) if c.source.component == component else c
            for c in self.connections
            if c.target.component != component
        ]
        inner = [c for c in kept if c.source.component or c.target.component]
        shown = {c.target.name for c in inner if not c.target.component}
        read = [c for c in (*self.connections, *self.offered) if c.target.component == component]
        more = [
            Connection(c.source, Connector("", c.target.name))
            for c in read
            if c.source.component and c.target.name not in shown
        ]
        return replace(
            self,
            components=tuple(c for c in self.components if c.name != component),
            connections=(*inner, *more),
            offered=(),
        )

    def opened(self, component: str, inputs: Mapping[str, str]) -> "SystemSpec":
        """The system with `inputs` of `component` taken off their sources: system inputs of these names."""
        return replace(
            self,
            connections=tuple(
                replace(c, source=Connector("", inputs[c.target.name]))
                if c.target.component == component and c.target.name in inputs
                else c
                for c in self.connections
            ),
        )


def names() -> tuple[str, ...]:
    """Names of all defined systems."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def load(name: str) -> SystemSpec:
    """Read and check the definition of the system `name`; InputError names what is wrong with it."""
    if name not in names():
        raise InputError(f"no system '{name}'; {nearest(name, names())}")
    with (FOLDER / f"{name}.toml").open("rb") as file:
        return parse(name, tomllib.load(file))


def parse(name: str, data: Mapping[str, Any]) -> SystemSpec:
    """Turn the content of a system file into a SystemSpec."""
    components = tuple(
        Component(key, value["fmu"], value.get("description", ""))
        for key, value in data["components"].items()
    )
    spec = SystemSpec(
        name,
        data["description"],
        data["step_s"],
        data["stop_s"],
        components,
        tuple(_connections(data)),
        tuple(_offers(data)),
    )
    _check(replace(spec, connections=(*spec.connections, *spec.offered)))
    return spec


def _connections(data: Mapping[str, Any]) -> Iterator[Connection]:
    for name, component in data["components"].items():
        for source, signals in component.get("inputs", {}).items():
            yield from _from_source(source, signals, name)
    for source, signals in data["outputs"].items():
        yield from _from_source(source, signals, "")


def _offers(data: Mapping[str, Any]) -> Iterator[Connection]:
    for name, component in data["components"].items():
        for source, signals in component.get("offered", {}).items():
            yield from _from_source(source, signals, name)


def _from_source(source: str, signals: list[str], target: str) -> Iterator[Connection]:
    component = "" if source == SYSTEM else source
    for entry in signals:
        name, _, renamed = entry.partition(" as ")
        yield Connection(Connector(component, name), Connector(target, renamed or name))


def _check(spec: SystemSpec) -> None:
    """Components exist, every end is a known signal of the same unit, no input has two sources."""
    known = [c.name for c in spec.components]
    targets: set[Connector] = set()
    for connection in spec.connections:
        source, target = connection.source, connection.target
        if source.component and source.component not in known:
            raise InputError(
                f"system {spec.name}: no component '{source.component}'; {nearest(source.component, known)}"
            )
        if signal(source.name).unit != signal(target.name).unit:
            raise InputError(
                f"system {spec.name}: {source.name} [{signal(source.name).unit}] does not fit "
                f"{target.name} [{signal(target.name).unit}]"
            )
        if target in targets:
            raise InputError(f"system {spec.name}: {target.component}.{target.name} has two sources")
        targets.add(target)
