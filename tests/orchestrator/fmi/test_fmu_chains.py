"""Two FMUs in a row: values of every type, arrays, strings and binaries arrive through connections."""

from pathlib import Path

import pytest

from orchestrator.fmi.variable import Value
from orchestrator.run.master import Master, Options
from orchestrator.system.layout import lay_out
from orchestrator.system.system import System
from tests.orchestrator.every import every, references
from tests.orchestrator.fmi.test_fmu_values import same, samples
from tests.orchestrator.systems import component, connector, load, ssd


def names(version: int) -> list[str]:
    """Inputs and outputs that connections may carry."""
    return [name for name, (type_, _) in references(version).items() if type_ != "Clock"]


def chain(version: int, folder: Path) -> System:
    """first → second, every output of the one to the same input of the other."""
    built = every(version, folder, modes=False)
    ends = [connector(name, "input" if name.endswith("in") else "output", "") for name in names(version)]
    outputs = [name for name in names(version) if name.endswith("out")]
    text = ssd(
        [component("first", "every", *ends), component("second", "every", *ends)],
        [connection_of("first", name, "second", name.removesuffix("out") + "in") for name in outputs],
        version="1.0" if version == 2 else "2.0",
    )
    return load(folder, text, {"every": built.path}, version)


def connection_of(source: str, output: str, target: str, input_: str) -> str:
    """A connection between connectors with dots in their names."""
    return (
        f'<ssd:Connection startElement="{source}" startConnector="{output}" '
        f'endElement="{target}" endConnector="{input_}"/>'
    )


@pytest.mark.parametrize("apart", [False, True], ids=["here", "apart"])
@pytest.mark.parametrize("version", [2, 3], ids=["FMI2", "FMI3"])
def test_every_type_arrives(version: int, apart: bool, tmp_path: Path) -> None:
    """After two steps the second FMU puts out what the first was told at the start."""
    system = chain(version, tmp_path)
    told: dict[str, Value] = {}
    for name, (type_, _) in references(version).items():
        if name.endswith("in") and type_ != "Clock":
            sample = samples(type_)
            told[name] = (sample * 3)[:3] if "array" in name else sample[-1]
    start = {"first": told, "second": {}}
    with Master(system, lay_out(system), start, Options(trust=not apart)) as master:
        master.plan.log(10)
        master.initialise()
        assert master.run(2)
        found = master.instances[1].values([name for name in names(version) if name.endswith("out")])
    for name, value in told.items():
        assert same(found[name.removesuffix("in") + "out"], value), name
