"""From a file to a checked System: what could be wrong with the description is found before the run."""

from collections.abc import Iterator
from pathlib import Path

from orchestrator import archive
from orchestrator.components import load_components
from orchestrator.description import SYSTEM, Description
from orchestrator.single import system_of_fmu
from orchestrator.ssd import read_ssd
from orchestrator.system import ALGORITHMS, Component, Settings, Source, System, SystemInput
from orchestrator.units import conversion
from orchestrator.wiring import Wiring
from specs.errors import InputError, nearest
from specs.signals import signals

DEFAULT_STEP_S = 0.02
SSD_NAME = "SystemStructure.ssd"


def load_system(path: Path | str) -> System:
    """Read and check a system: `.ssp`, `.ssd` with its FMUs beside it, or a bare `.fmu`.

    Raises InputError, naming element and line, for whatever could not be simulated as described.
    """
    path = Path(path)
    if path.suffix == ".fmu":
        return system_of_fmu(path)
    files = archive.Scratch()
    ssd = path if path.suffix == ".ssd" else files.path / "ssp" / SSD_NAME
    if ssd != path:
        archive.unpack(path, files.path / "ssp", f"system {path}")
        if not ssd.is_file():
            raise InputError(f"system {path} holds no {SSD_NAME}")
    return _checked(read_ssd(ssd), ssd.parent, files)


def _checked(text: Description, base: Path, files: archive.Scratch) -> System:
    if not text.components:
        raise InputError(f"system {text.name} has no component")
    algorithm = text.algorithm or ALGORITHMS[0]
    if algorithm not in ALGORITHMS:
        raise InputError(
            f"system {text.name}: unknown algorithm '{algorithm}'; {nearest(algorithm, ALGORITHMS)}"
        )
    components = load_components(text, base, files.path)
    wiring = Wiring(text, components)
    return System(
        name=text.name,
        step_s=text.step_s or DEFAULT_STEP_S,
        stop_s=text.stop_s,
        settings=Settings(algorithm),
        components=components,
        links=tuple(wiring.links),
        inputs=_inputs(text, wiring),
        outputs=wiring.outputs,
        warnings=tuple(_warnings(text, components, wiring)),
        files=files,
    )


def _inputs(text: Description, wiring: Wiring) -> dict[str, SystemInput]:
    """System inputs; one without a value from a binding starts as the first FMU variable it drives does."""
    given = {v.name: v for v in text.parameters if not isinstance(v.value, str)}
    inputs: dict[str, SystemInput] = {}
    for connector in (c for c in text.connectors.values() if c.kind == "input"):
        driven = [link for link in wiring.links if link.source == Source(SYSTEM, connector.name)]
        first = wiring.variable((driven[0].component, driven[0].name)) if driven else None
        unit = connector.unit or (first.unit if first else None)
        start = 0.0
        if connector.name in given:
            value = given[connector.name]
            start = conversion(value.unit, unit)(float(value.value))
        elif first is not None and first.start is not None:
            start = driven[0].conversion.affine.inverse(first.start)
        unit_name = connector.unit_name or (first.unit_name if first else "")
        inputs[connector.name] = SystemInput(connector.name, unit_name, unit, start)
    return inputs


def _warnings(text: Description, components: dict[str, Component], wiring: Wiring) -> Iterator[str]:
    """What is accepted, but may not be meant."""
    if text.step_s is None:
        yield f"system {text.name} states no step size; {DEFAULT_STEP_S} s is used"
    known = signals()
    for name in (n for n, c in text.connectors.items() if c.kind in ("input", "output") and n not in known):
        yield f"system connector {name} is no signal of specs/signals.toml; {nearest(name, known)}"
    driven = {(link.component, link.name) for link in wiring.links}
    sources = {link.source for link in wiring.links} | {o.source for o in wiring.outputs.values()}
    for connector in text.connectors.values():
        used = Source(SYSTEM, connector.name) in sources or connector.name in wiring.outputs
        if connector.kind in ("input", "output") and not used:
            yield f"system {connector.kind} {connector.name} is not connected"
    for component in components.values():
        for variable in component.model.variables.values():
            if variable.causality == "input" and (component.name, variable.name) not in driven:
                value = component.start.get(variable.name, variable.start)
                name = f"{component.name}.{variable.name}"
                yield f"input {name} is not connected and keeps its start value {value}"
