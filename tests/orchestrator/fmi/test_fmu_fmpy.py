"""The same FMU, the same inputs: the binding's outputs are those of FMPy to the last bit."""

import random
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

from fmus.toolchain.build import FMI_VERSIONS, build_fmu
from fmus.toolchain.loader import load_model, model_folders
from orchestrator.fmi.instance import Instance
from orchestrator.fmi.variable import Scalar, Value
from orchestrator.system.single_fmu import system_of_fmu
from tests.fmus.importer import STEP, Imported
from tests.fmus.toolchain.test_project_fmus import spread
from tests.orchestrator.every import every, references
from tests.orchestrator.fmi.test_fmu_values import samples
from tests.orchestrator.systems import HERE, fmu

PROJECT = [(name, version) for name in sorted(model_folders()) for version in FMI_VERSIONS]
SMALL = [(name, v) for name in ("decay", "position", "speed", "turn") for v in (2, 3)]


def inputs(model: Any, ticks: int) -> Iterator[dict[str, float]]:
    """Commands that change every third tick, within their range."""
    rng = random.Random(11)
    commands = [v for v in model.inputs if not v.name.startswith("disturbance")]
    for tick in range(ticks):
        change = tick % 3 == 0
        yield {v.name: v.start + rng.uniform(-3.0, 3.0) * spread(v) for v in commands if change}


def ours(path: Path, model: Any, step: float, ticks: int) -> list[list[float]]:
    """All outputs after each step through the binding."""
    system = system_of_fmu(path, step)
    (component,) = system.components.values()
    outputs, rows = [v.name for v in model.outputs], []
    with Instance(component) as instance:
        instance.enter_initialisation()
        instance.exit_initialisation()
        time = 0.0
        for given in inputs(model, ticks):
            instance.set_values(given)
            instance.step(time, step)
            time += step
            rows.append(instance.get(*outputs).tolist())
    return rows


def theirs(path: Path, model: Any, step: float, ticks: int) -> list[list[float]]:
    """The same through FMPy."""
    outputs, rows = [v.name for v in model.outputs], []
    with Imported(path) as instance:
        for given in inputs(model, ticks):
            instance.set(**given)
            instance.step(step)
            rows.append(instance.get(*outputs))
    return rows


@pytest.mark.parametrize(("name", "version"), PROJECT)
def test_the_project_s_fmus(name: str, version: int) -> None:
    path, model = build_fmu(name, version), load_model(name)
    found = ours(path, model, STEP, 20)
    assert found == theirs(path, model, STEP, 20)
    assert found[-1] != found[0]


@pytest.mark.parametrize(("name", "version"), SMALL)
def test_the_small_models(name: str, version: int) -> None:
    path, model = fmu(name, version), load_model(HERE / "models" / name)
    assert ours(path, model, model.step, 20) == theirs(path, model, model.step, 20)


# ---- every type ----


@contextmanager
def slave(path: Path) -> Iterator[Any]:
    """FMPy's instance in step mode."""
    description: Any = fmpy.read_model_description(str(path), validate=False)
    version = int(description.fmiVersion[0])
    made: Any = (FMU2Slave if version == 2 else FMU3Slave)(
        guid=description.guid,
        unzipDirectory=fmpy.extract(str(path)),
        modelIdentifier="every",
    )
    made.instantiate()
    if version == 2:
        made.setupExperiment(startTime=0.0)
    made.enterInitializationMode()
    made.exitInitializationMode()
    yield made
    made.freeInstance()


def their_values(made: Any, version: int, told: Mapping[str, Value]) -> dict[str, Value]:
    """Set, step and get all outputs."""
    known = references(version)
    for name, value in told.items():
        type_, vr = known[name]
        values = list(value) if isinstance(value, tuple) else [value]
        getattr(made, f"set{'Int64' if type_ == 'Enumeration' else type_}")([vr], values)
    made.doStep(currentCommunicationPoint=0.0, communicationStepSize=0.1)
    found: dict[str, Value] = {}
    for name, (type_, vr) in known.items():
        if not name.endswith("out") or type_ == "Clock":
            continue
        getter = getattr(made, f"get{'Int64' if type_ == 'Enumeration' else type_}")
        values = getter([vr], 3) if "array" in name else getter([vr])
        typed = tuple(_typed(type_, value) for value in values)
        found[name] = typed if "array" in name else typed[0]
    return found


def _typed(type_: str, value: Any) -> Scalar:
    """FMPy gives numbers for Booleans of FMI 2, bytes for its strings, and None for nothing."""
    if type_ == "Binary":
        return value or b""
    if type_ == "String":
        return value.decode() if isinstance(value, bytes) else value
    return bool(value) if type_ == "Boolean" else value


def our_values(instance: Instance, told: Mapping[str, Value]) -> dict[str, Value]:
    """The same through the binding."""
    instance.set_values(told)
    instance.step(0.0, 0.1)
    names = references(instance.model.fmi_version)
    return instance.values([n for n, (t, _) in names.items() if n.endswith("out") and t != "Clock"])


@pytest.mark.parametrize("version", [2, 3])
def test_every_type(version: int, tmp_path: Path) -> None:
    names = dir(FMU2Slave if version == 2 else FMU3Slave)  # FMPy demands every function of the standard
    stubs = tuple(n for n in names if n.startswith(f"fmi{version}"))
    built = every(version, tmp_path, modes=False, stubs=stubs)
    rng = random.Random(3)
    with slave(built.path) as their, Instance(built.component) as our:
        our.enter_initialisation()
        our.exit_initialisation()
        for _ in range(20):
            told: dict[str, Value] = {}
            for name, (type_, _) in references(version).items():
                if name.endswith("in") and type_ != "Clock":
                    values = tuple(rng.choice(samples(type_)) for _ in range(3))
                    told[name] = values if "array" in name else values[0]
            assert repr(our_values(our, told)) == repr(their_values(their, version, told))
