"""The project's systems in other people's masters; run as a program, since their libraries may end a process.

    python -m tests.orchestrator.other_masters MASTER SYSTEM FMI_VERSION TICKS OUT.json

writes {"component.output": value after TICKS steps} with system inputs held at their given start values.
"""

import json
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from fmus.build import build_fmu
from orchestrator.check import load_system
from orchestrator.modeldescription import Variable
from orchestrator.pack import pack_system
from orchestrator.system import System

START = {"target_x": -3.0, "target_y": 9.0, "target_z": 4.0, "pace": 1.0}
Ends = dict[str, float]


class Case:
    """A system, the files of its FMUs, and the start values that stand for its inputs."""

    def __init__(self, name: str, fmi_version: int, ticks: int, folder: Path) -> None:
        self.system: System = load_system(pack_system(name, fmi_version, folder))  # type: ignore[arg-type]
        self.fmi_version, self.ticks, self.folder = fmi_version, ticks, folder
        self.files = {c: build_fmu(c, fmi_version) for c in self.system.components}
        driven = {n: i.start for n, i in self.system.inputs.items()} | START
        links = self.system.links
        self.inputs = {(k.component, k.name): driven[k.source.name] for k in links if not k.source.component}
        self.links = [k for k in links if k.source.component]
        self.outputs = sorted({(o.source.component, o.source.name) for o in self.system.outputs.values()})
        self.seeds = [c for c, v in self.system.components.items() if "noise_seed" in v.model.variables]

    def variable(self, component: str, name: str) -> Variable:
        return self.system.components[component].model.variables[name]


def fmucontainer(case: Case) -> Ends:
    """Built by fmu-manipulation-toolbox, imported by FMPy."""
    from fmu_manipulation_toolbox.assembly import Assembly

    from tests.fmus.importer import Imported

    files = {c: path.name for c, path in case.files.items()}
    for path in case.files.values():
        (case.folder / path.name).write_bytes(path.read_bytes())
    plan = {
        "name": "box.fmu",
        "step_size": case.system.step_s,
        "auto_link": False,
        "auto_input": False,
        "auto_output": False,
        "fmu": list(files.values()),
        "link": [[files[k.source.component], k.source.name, files[k.component], k.name] for k in case.links],
        "output": [[files[c], n, f"{c}_{n}"] for c, n in case.outputs],
        "start": [[files[c], n, repr(v)] for (c, n), v in case.inputs.items()]
        + [[files[c], "noise_seed", "0"] for c in case.seeds],
    }
    (case.folder / "box.json").write_text(json.dumps(plan))
    assembly = Assembly("box.json", fmu_directory=case.folder)
    assembly.make_fmu(fmi_version=case.fmi_version)
    with Imported(case.folder / "box.fmu") as box:
        for _ in range(case.ticks):
            box.step(case.system.step_s)
        return {f"{c}.{n}": box.get(f"{c}_{n}")[0] for c, n in case.outputs}


def ecos(case: Case) -> Ends:
    """Ecos, fixed step."""
    from ecospy import EcosSimulation, EcosSimulationStructure

    structure = EcosSimulationStructure()
    for component, path in case.files.items():
        structure.add_model(component, str(path))
    for k in case.links:
        structure.make_real_connection(f"{k.source.component}::{k.source.name}", f"{k.component}::{k.name}")
    values: dict[str, float | int] = {f"{c}::{n}": v for (c, n), v in case.inputs.items()}
    values |= {f"{c}::noise_seed": 0 for c in case.seeds}
    structure.add_parameter_set("start", values)
    with EcosSimulation(structure=structure, step_size=case.system.step_s) as simulation:
        simulation.init(parameter_set="start")
        simulation.step(case.ticks)
        return {f"{c}.{n}": simulation.get_real(f"{c}::{n}") for c, n in case.outputs}


def libcosim(case: Case) -> Ends:
    """libcosim through libcosimpy, FMI 2 only."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution = CosimExecution.from_step_size(round(case.system.step_s * 1e9))
    slaves = {c: CosimLocalSlave(str(path), c) for c, path in case.files.items()}
    index = {c: execution.add_local_slave(slave) for c, slave in slaves.items()}
    for (c, n), value in case.inputs.items():
        execution.real_initial_value(index[c], case.variable(c, n).vr, value)
    for c in case.seeds:
        execution.integer_initial_value(index[c], case.variable(c, "noise_seed").vr, 0)
    for k in case.links:
        source = index[k.source.component], case.variable(k.source.component, k.source.name).vr
        execution.connect_real_variables(*source, index[k.component], case.variable(k.component, k.name).vr)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    execution.step(case.ticks)
    ends = {}
    for c, n in case.outputs:
        ends[f"{c}.{n}"] = observer.last_real_values(index[c], [case.variable(c, n).vr])[0]
    return ends


MASTERS: Mapping[str, object] = {"fmucontainer": fmucontainer, "ecos": ecos, "libcosim": libcosim}


def main(master: str, name: str, fmi_version: str, ticks: str, out: str) -> None:
    """Run one case; see the module docstring."""
    with tempfile.TemporaryDirectory() as folder:
        ends = MASTERS[master](Case(name, int(fmi_version), int(ticks), Path(folder)))  # type: ignore[operator]
    Path(out).write_text(json.dumps(ends))


if __name__ == "__main__":
    main(*sys.argv[1:])
