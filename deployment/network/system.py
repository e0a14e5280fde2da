"""The reference machine under the virtual controller: over the bus FMU, or by plain signals, as an SSP."""

import tempfile
from pathlib import Path
from typing import Any

from lxml import etree

from deployment.network import nodes, tables
from fmus.network import bus
from fmus.toolchain.build import build_fmu as build_model
from orchestrator.system.pack import pack
from runtime.bundle import Bundle
from specs import systems
from specs.schema import ROOT, read_toml
from specs.ssd import SIMULATION, render

STEP_S = 0.001  # of nodes and bus: when frames that have arrived are handed over
FMI = 3
CONTROLLER, BUS, IO, MACHINE = "controller", "bus", "io", "machine"
ENDS: tuple[str, ...] = ("startElement", "startTerminal", "endElement", "endTerminal")
REPLACED = ("pi", "arm_velocity")  # components of the reference system whose place the core takes
TERMINALS = {CONTROLLER: "Node1", IO: "Node2"}  # component -> the bus's terminal


def over_the_bus(bundle: Bundle, path: Path) -> Path:
    """Pack `path`: controller — bus — machine's end = machine; the machine steps 20 ms, the others 1 ms.

    Raises InputError for a bundle whose policy is evaluated outside of its core, RunError if C fails.
    """
    machine = _machine()
    sensors, about = _sensors(machine), "Virtual controller, CAN bus, and the reference machine on it"
    components = {
        CONTROLLER: {"fmu": nodes.CONTROLLER},
        BUS: {"fmu": bus.NAME},
        IO: {"fmu": nodes.MACHINE_IO, "inputs": {systems.SYSTEM: list(tables.TARGETS), MACHINE: sensors}},
        MACHINE: _fed(machine, IO),
    }
    spec = _spec(about, components, IO, machine)
    connections = [(component, nodes.PORT, BUS, node) for component, node in TERMINALS.items()]
    return _packed(bundle, spec, connections, path)


def by_plain_signals(bundle: Bundle | Path, path: Path) -> Path:
    """The same without a bus: `controller.plain` must be set, and then its frames pass inside of it.

    `bundle`: or the controller's FMU.
    """
    machine = _machine()
    inputs = {systems.SYSTEM: list(tables.TARGETS), MACHINE: _sensors(machine)}
    components = {
        CONTROLLER: {"fmu": nodes.CONTROLLER, "inputs": inputs},
        MACHINE: _fed(machine, CONTROLLER),
    }
    about = "Virtual controller with plain signals, and the reference machine"
    return _packed(bundle, _spec(about, components, CONTROLLER, machine), [], path)


def _machine() -> dict[str, Any]:
    """What specs/systems/reference.toml says of the machine and its outputs."""
    data = read_toml(ROOT / "systems" / "reference.toml")
    return {**data["components"]["machine"], "outputs": data["outputs"]["machine"], "stop_s": data["stop_s"]}


def _sensors(machine: dict[str, Any]) -> list[str]:
    return [v.name for v in tables.inputs() if v.name in machine["outputs"]]


def _fed(machine: dict[str, Any], source: str) -> dict[str, Any]:
    """The machine with its commands from `source`."""
    inputs = {name: signals for name, signals in machine["inputs"].items() if name not in REPLACED}
    return {"fmu": machine["fmu"], "inputs": {**inputs, source: list(tables.COMMANDS)}}


def _spec(about: str, components: dict[str, Any], shown: str, machine: dict[str, Any]) -> systems.SystemSpec:
    outputs = {shown: list(tables.SHOWN), MACHINE: machine["outputs"]}
    data = {"description": about, "step_s": STEP_S, "stop_s": machine["stop_s"]}
    return systems.parse("virtual", {**data, "components": components, "outputs": outputs})


def _packed(
    bundle: Bundle | Path, spec: systems.SystemSpec, connections: list[tuple[str, str, str, str]], path: Path
) -> Path:
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        there = isinstance(bundle, Path)
        built = bundle if there else nodes.build_controller(bundle, folder / "controller.fmu")
        fmus = {f"{nodes.CONTROLLER}.fmu": built}
        if connections:
            fmus[f"{bus.NAME}.fmu"] = bus.build_bus(folder / "bus.fmu", len(TERMINALS))
            fmus[f"{nodes.MACHINE_IO}.fmu"] = nodes.build_machine_io(folder / "io.fmu")
        fmus["machine.fmu"] = build_model("machine", FMI)
        return pack(_annotated(render(spec, FMI), connections), fmus, path)


def _annotated(ssd: str, connections: list[tuple[str, str, str, str]]) -> str:
    """The description with the machine's step and the connections by terminal in our annotation."""
    root = etree.fromstring(ssd.encode())
    (simulation,) = root.iter(f"{{{SIMULATION}}}Simulation")
    etree.SubElement(simulation, f"{{{SIMULATION}}}Component", name=MACHINE, stepSize="0.02")
    for ends in connections:
        about = dict(zip(ENDS, ends, strict=True))
        etree.SubElement(simulation, f"{{{SIMULATION}}}TerminalConnection", about)
    etree.indent(root)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8").decode() + "\n"
