"""A closed FMU with effects at its ports as one system: an SSP 1.0 that the orchestrator imports.

The effects of each side are a small FMU of their own: in front of the inputs, behind the outputs, and on a
disturbance input, fed back from the outputs.  The system steps them in the order of the signals
(gauss-seidel), so that they add no delay; a force that is fed back is one step late.
"""

import hashlib
import shutil
import tempfile
from pathlib import Path

from lxml import etree

from fmus.definition import Variable
from fmus.paths import BUILD
from fmus.toolchain.build import build_fmu
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack
from orchestrator.system.system import System
from reconcile.closed.fitted import ClosedFit
from reconcile.closed.port import LATE, Port, Side
from reconcile.closed.problem import ClosedProblem
from reconcile.closed.simulation import FORCE_STEP, Simulation
from specs.ssd import ANNOTATION, SIMULATION, SSC, SSD
from specs.units import UNITS

SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
FINE = 0.25  # of a sample period: the step of the system
STEP_S = 0.01  # at most


def write(problem: ClosedProblem, fitted: ClosedFit, folder: Path) -> Path:
    """Write `folder`: the effects as model folders, the FMU beside them, and the SSP, which is returned."""
    box = problem.box
    pushed = any(a.effect.place == "force" for a in fitted.effects)
    wanted = min(STEP_S, FINE * min(r.period_s for r in problem.runs))
    step = box.at_step(FORCE_STEP * problem.step_s if pushed else wanted).step_s
    folder.mkdir(parents=True)
    ports = _ports(problem, fitted, step)
    resources = {f"{box.model.name}.fmu": _copied(box.path, folder / f"{box.model.name}.fmu")}
    for name, port in ports.items():
        resources[f"{name}.fmu"] = _built(port, folder / name)
    moved = {f.name: fitted.values[f.name] for f in problem.base}
    text = _Ssd(problem, ports, step, moved).text()
    ssp = pack(text, resources, folder / f"{box.model.name}.ssp")
    (folder / "README.md").write_text(_readme(problem, fitted, ports), encoding="utf-8")
    return ssp


def system(problem: Simulation, ports: dict[str, Port], step: float) -> System:
    """The FMU with these ports as a checked system, for fits; what is built is kept by its content."""
    resources = {f"{problem.box.model.name}.fmu": problem.box.path}
    for name, port in ports.items():
        source = _source(port)
        folder = BUILD / "reconcile" / "ports" / hashlib.sha256(source.encode()).hexdigest()[:32] / name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "model.py").write_text(source, encoding="utf-8")
        resources[f"{name}.fmu"] = build_fmu(folder, 2, out=folder)
    text = _Ssd(problem, ports, step, {}).text()
    with tempfile.TemporaryDirectory() as scratch:
        return load_system(pack(text, resources, Path(scratch) / "fit.ssp"))


def _ports(problem: ClosedProblem, fitted: ClosedFit, step: float) -> dict[str, Port]:
    """Ports with effects at them, by the name of their component."""
    found = {}
    for side in ("input", "output"):
        own = tuple(a for a in fitted.effects if a.effect.place == side)
        if own:
            found[f"{side}_effects"] = problem.port(side, own, fitted.values, step)
    for f in problem.box.ports.feedbacks:
        own = tuple(a for a in fitted.effects if a.effect.place == "force" and a.port == f.input)
        if own:
            found[f"force_effects_{f.input}"] = problem.port("force", own, fitted.values, step)
    return found


def _copied(source: Path, target: Path) -> Path:
    shutil.copyfile(source, target)
    return target


def _built(port: Port, folder: Path) -> Path:
    """The port as a model folder with its FMU."""
    folder.mkdir()
    (folder / "model.py").write_text(_source(port), encoding="utf-8")
    return build_fmu(folder, 2, out=folder)


def _source(port: Port) -> str:
    signals = [(v.name, v.unit, v.start, v.max or v.nominal) for v in port.signals]
    effects = []
    for a in port.effects:
        names = [q.name for q in a.effect.parameters] + (["width"] if a.effect.width else [])
        effects.append((a.effect.key, a.port, a.other, {n: port.values[a.name(n)] for n in names}))
    motion = {role: (v.name, v.unit) for role, v in port.motion.items()}
    listed = "".join(f"    {e!r},\n" for e in effects)
    return (
        f'"""Effects at the {port.side} side of a closed FMU, found by `slewright reconcile`."""\n\n'
        "from reconcile.closed.port import port_model\n\n"
        f"SIGNALS = {signals!r}  # name, unit, start, largest\nEFFECTS = [\n{listed}]\n"
        f"MOTION = {motion!r}\n\n"
        f"MODEL = port_model({port.side!r}, {port.step_s!r}, SIGNALS, EFFECTS, MOTION)\n"
    )


def _readme(problem: ClosedProblem, fitted: ClosedFit, ports: dict[str, Port]) -> str:
    name = problem.box.model.name
    holds = (
        "holds the FMU as it came and:"
        if ports
        else "holds the FMU as it came: no effect was found at its ports."
    )
    lines = [f"# {name} with effects at its ports", "", f"`{name}.ssp` {holds}", ""]
    for component, port in ports.items():
        for a in port.effects:
            numbers = ", ".join(
                f"{q.name} = {fitted.values[a.name(q.name)]:.5g}" for q in a.effect.parameters
            )
            lines.append(
                f"- **{a.effect.name}** at `{a.port}` (`{component}/`): {a.effect.equation}; {numbers}"
            )
    lines += ["", f"`slewright simulate {name}.ssp --stop 10` runs it for 10 s.", ""]
    return "\n".join(lines)


class _Ssd:
    """The text of the system structure description."""

    def __init__(self, problem: Simulation, ports: dict[str, Port], step: float, moved: dict[str, float]):
        self.box, self.ports, self.step, self.moved = problem.box, ports, step, moved
        self.name = self.box.model.name

    def text(self) -> str:
        root = etree.Element(
            _tag(SSD, "SystemStructureDescription"),
            nsmap={"ssd": SSD, "ssc": SSC, "ssv": SSV},
            version="1.0",
            name=f"{self.name} with effects",
        )
        system = etree.SubElement(root, _tag(SSD, "System"), name="system")
        model = self.box.model
        self._connectors(system, [(v, v.name) for v in model.inputs], [(v, v.name) for v in model.outputs])
        elements = etree.SubElement(system, _tag(SSD, "Elements"))
        forces = [n for n, port in self.ports.items() if port.side == "force"]
        for name in sorted(self.ports, key=lambda n: n not in forces):  # a force steps before what it feeds
            port = self.ports[name]
            told = dict.fromkeys((*port.signals, *port.motion.values()))
            late = [(v, v.name + LATE) for v in port.signals]
            self._component(elements, name, [(v, v.name) for v in told], late)
        own = self._component(
            elements, self.name, [(v, v.name) for v in model.inputs], [(v, v.name) for v in model.outputs]
        )
        self._bindings(own)
        connections = etree.SubElement(system, _tag(SSD, "Connections"))
        for source, target in self._wires():
            etree.SubElement(connections, _tag(SSD, "Connection"), _ends(source, target))
        self._units(root)
        holder = etree.SubElement(root, _tag(SSD, "Annotations"))
        note = etree.SubElement(holder, _tag(SSC, "Annotation"), type=ANNOTATION)
        etree.SubElement(
            note,
            _tag(SIMULATION, "Simulation"),
            nsmap={"slw": SIMULATION},
            stepSize=repr(self.step),
            algorithm="gauss-seidel",
        )
        etree.indent(root)
        return etree.tostring(root, xml_declaration=True, encoding="UTF-8").decode() + "\n"

    def _component(self, parent, name: str, inputs, outputs):
        element = etree.SubElement(
            parent,
            _tag(SSD, "Component"),
            name=name,
            source=f"resources/{name}.fmu",
            type="application/x-fmu-sharedlibrary",
            implementation="CoSimulation",
        )
        self._connectors(element, inputs, outputs)
        return element

    def _connectors(self, parent, inputs, outputs) -> None:
        holder = etree.SubElement(parent, _tag(SSD, "Connectors"))
        for kind, variables in (("input", inputs), ("output", outputs)):
            for v, name in variables:
                connector = etree.SubElement(holder, _tag(SSD, "Connector"), name=name, kind=kind)
                unit = {"unit": v.unit} if v.unit in UNITS else {}
                etree.SubElement(connector, _tag(SSC, "Real"), unit)

    def _bindings(self, element) -> None:
        """The FMU's own parameters as the fit left them."""
        if not self.moved:
            return
        holder = etree.SubElement(element, _tag(SSD, "ParameterBindings"))
        binding = etree.SubElement(holder, _tag(SSD, "ParameterBinding"))
        values = etree.SubElement(binding, _tag(SSD, "ParameterValues"))
        chosen = etree.SubElement(values, _tag(SSV, "ParameterSet"), version="1.0", name="reestimated")
        listed = etree.SubElement(chosen, _tag(SSV, "Parameters"))
        for name, value in self.moved.items():
            entry = etree.SubElement(listed, _tag(SSV, "Parameter"), name=name)
            etree.SubElement(entry, _tag(SSV, "Real"), value=repr(float(value)))

    def _wires(self) -> list[tuple[tuple[str, str], tuple[str, str]]]:
        """Pairs of ends (component, connector); "" is the system."""
        found = []
        for v in self.box.model.inputs:
            port = self._port(("input", "force"), v)
            if port is None:
                found.append((("", v.name), (self.name, v.name)))
                continue
            found += [(("", v.name), (port, v.name)), ((port, v.name + LATE), (self.name, v.name))]
            for m in self.ports[port].motion.values():
                found.append(((self.name, m.name), (port, m.name)))
        for v in self.box.model.outputs:
            port = self._port(("output",), v)
            if port is None:
                found.append(((self.name, v.name), ("", v.name)))
            else:
                found += [((self.name, v.name), (port, v.name)), ((port, v.name + LATE), ("", v.name))]
        return found

    def _port(self, sides: tuple[Side, ...], v: Variable) -> str | None:
        """The component of effects that a signal passes through."""
        fitting = (n for n, port in self.ports.items() if port.side in sides)
        return next((n for n in fitting if v.name in {s.name for s in self.ports[n].signals}), None)

    def _units(self, root) -> None:
        model = self.box.model
        used = {v.unit for v in (*model.inputs, *model.outputs)} & set(UNITS)
        holder = etree.SubElement(root, _tag(SSD, "Units"))
        for name in sorted(used):
            unit = UNITS[name]
            base = {k: str(n) for k, n in unit.exponents.items()}
            base |= {} if unit.factor == 1.0 else {"factor": repr(unit.factor)}
            base |= {} if unit.offset == 0.0 else {"offset": repr(unit.offset)}
            etree.SubElement(
                etree.SubElement(holder, _tag(SSC, "Unit"), name=name), _tag(SSC, "BaseUnit"), base
            )


def _tag(namespace: str, name: str) -> str:
    return f"{{{namespace}}}{name}"


def _ends(source: tuple[str, str], target: tuple[str, str]) -> dict[str, str]:
    found = {}
    for end, (component, connector) in (("start", source), ("end", target)):
        if component:
            found[f"{end}Element"] = component
        found[f"{end}Connector"] = connector
    return found
