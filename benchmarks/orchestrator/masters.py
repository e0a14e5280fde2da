"""Other people's masters behind one form: a case in, the values of its outputs after so many steps out.

Their libraries may end the process: call these in a process of its own.  Reals only, and integer parameters.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import fmpy

Name = tuple[str, str]  # component, variable
Ends = dict[str, float]


@dataclass
class Case:
    """A system as others need it.

    files    the FMU of each component
    links    source to target, values unchanged
    reals    start values of inputs and parameters
    whole    values of integer parameters
    vr       value references of all variables named here
    """

    fmi_version: int
    step_s: float
    folder: Path  # to work in
    files: Mapping[str, Path]
    links: list[tuple[Name, Name]]
    outputs: list[Name]
    vr: Mapping[Name, int]
    reals: Mapping[Name, float] = field(default_factory=dict)
    whole: Mapping[Name, int] = field(default_factory=dict)


def container(case: Case) -> Path:
    """The system as one FMU, built by fmu-manipulation-toolbox; output x of component c is called c_x."""
    from fmu_manipulation_toolbox.assembly import Assembly

    files = {c: f"{c}.fmu" for c in case.files}
    for component, path in case.files.items():
        (case.folder / files[component]).write_bytes(path.read_bytes())
    start = [*case.reals.items(), *case.whole.items()]
    plan = {
        "name": "box.fmu",
        "step_size": case.step_s,
        "auto_link": False,
        "auto_input": False,
        "auto_output": False,
        "fmu": list(files.values()),
        "link": [[files[a], x, files[b], u] for (a, x), (b, u) in case.links],
        "output": [[files[c], n, f"{c}_{n}"] for c, n in case.outputs],
        "start": [[files[c], n, repr(value)] for (c, n), value in start],
    }
    (case.folder / "box.json").write_text(json.dumps(plan))
    Assembly("box.json", fmu_directory=case.folder).make_fmu(fmi_version=case.fmi_version)
    return case.folder / "box.fmu"


def fmucontainer(case: Case, ticks: int) -> Ends:
    """Built by fmu-manipulation-toolbox, imported by FMPy."""
    box = str(container(case))
    folder = fmpy.extract(box, unzipdir=str(case.folder / "box"))
    model = fmpy.read_model_description(box)
    fmu: Any = fmpy.instantiate_fmu(folder, model, "CoSimulation")
    if case.fmi_version == 2:
        fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    for tick in range(ticks):
        fmu.doStep(tick * case.step_s, case.step_s)
    vr = {v.name: v.valueReference for v in model.modelVariables}
    get = fmu.getReal if case.fmi_version == 2 else fmu.getFloat64
    ends = {f"{c}.{n}": get([vr[f"{c}_{n}"]])[0] for c, n in case.outputs}
    fmu.terminate()
    fmu.freeInstance()
    return ends


def ecos_simulation(case: Case) -> Any:
    """Ecos, fixed step: an initialised EcosSimulation."""
    from ecospy import EcosSimulation, EcosSimulationStructure

    structure = EcosSimulationStructure()
    for component, path in case.files.items():
        structure.add_model(component, str(path))
    for (a, x), (b, u) in case.links:
        structure.make_real_connection(f"{a}::{x}", f"{b}::{u}")
    start = [*case.reals.items(), *case.whole.items()]
    structure.add_parameter_set("start", {f"{c}::{n}": value for (c, n), value in start})
    simulation = EcosSimulation(structure=structure, step_size=case.step_s)
    simulation.init(parameter_set="start")
    return simulation


def ecos(case: Case, ticks: int) -> Ends:
    """Ecos, all steps in one call."""
    with ecos_simulation(case) as simulation:
        simulation.step(ticks)
        return {f"{c}.{n}": simulation.get_real(f"{c}::{n}") for c, n in case.outputs}


class Libcosim:
    """libcosim through libcosimpy: `execution` to step, `indices` of the components."""

    def __init__(self, case: Case, observer: Any) -> None:
        from libcosimpy.CosimExecution import CosimExecution
        from libcosimpy.CosimSlave import CosimLocalSlave

        self.observer = observer
        self.execution = CosimExecution.from_step_size(round(case.step_s * 1e9))
        self.slaves = {c: CosimLocalSlave(str(path), c) for c, path in case.files.items()}
        index = {c: self.execution.add_local_slave(slave) for c, slave in self.slaves.items()}
        self.where = {name: (index[name[0]], vr) for name, vr in case.vr.items()}
        for name, value in case.reals.items():
            self.execution.real_initial_value(*self.where[name], value)
        for name, whole in case.whole.items():
            self.execution.integer_initial_value(*self.where[name], whole)
        for source, target in case.links:
            self.execution.connect_real_variables(*self.where[source], *self.where[target])
        self.execution.add_observer(observer)

    def value(self, name: Name) -> float:
        """The last value, if the observer keeps it."""
        slave, vr = self.where[name]
        return self.observer.last_real_values(slave, [vr])[0]


def libcosim(case: Case, ticks: int) -> Ends:
    """libcosim, FMI 2 only."""
    from libcosimpy.CosimObserver import CosimObserver

    simulation = Libcosim(case, CosimObserver.create_last_value())
    simulation.execution.step(ticks)
    return {f"{c}.{n}": simulation.value((c, n)) for c, n in case.outputs}


MASTERS: Mapping[str, Callable[[Case, int], Ends]] = {
    "fmucontainer": fmucontainer,
    "ecos": ecos,
    "libcosim": libcosim,
}
