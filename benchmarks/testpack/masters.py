"""Other people's masters on the pack, each through its own import of .ssp files.

    python -m benchmarks.testpack.masters KEY FOLDER

reads a name of a case a line, runs FOLDER/NAME/NAME.ssp in a process of its own (they may crash or hang) and
answers with a line of JSON: {"outcome": "ran", "values": {...}} or {"outcome": "refused" | "failed" |
"crashed" | "hung", "message": "..."}.
"""

import contextlib
import json
import os
import re
import select
import signal
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import fmpy
from fmpy.ssp.simulation import simulate_ssp

from benchmarks.testpack.case import SSD, Case
from benchmarks.testpack.cases import CASES
from benchmarks.testpack.damage import unzipped, zipped
from benchmarks.testpack.render import PARAMETER_SET

Values = dict[str, float]
PATIENCE_S = 5.0
LONGEST_MESSAGE = 300


class Refused(Exception):
    """The importer did not take the system; anything else that is raised came later."""


def ticks_to(case: Case) -> int:
    """Steps to the last time for which values are expected."""
    return round(float(case.checked_times[-1]) / case.step_s) if case.expect else case.ticks


# ---- FMPy ----


def fmpy_ssp(case: Case, path: Path) -> Values:
    """simulate_ssp; its rows are labelled with the begin of a step, its columns are connectors."""
    ticks = ticks_to(case)
    # time is summed up there: half a step less makes the number of steps certain
    rows = simulate_ssp(str(path), stop_time=(ticks - 0.5) * case.step_s, step_size=case.step_s)
    return {name: float(rows[name][-1]) for name in case.expect if name in (rows.dtype.names or ())}


# ---- fmu-manipulation-toolbox ----


def fmucontainer(case: Case, path: Path) -> Values:
    """An FMU made of the .ssp, which FMPy then steps; connectors of the system are its outputs."""
    from fmu_manipulation_toolbox.assembly import Assembly

    folder = path.parent
    try:
        assembly = Assembly(path.name, fmu_directory=folder, default_step_size=case.step_s)
        assembly.make_fmu(fmi_version=case.fmi_version)
        box = str(path.with_suffix(".fmu"))
        model = fmpy.read_model_description(box)
    except Exception as error:
        raise Refused(_words(error)) from error
    fmu: Any = fmpy.instantiate_fmu(fmpy.extract(box), model, "CoSimulation")
    if case.fmi_version == 2:
        fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    for tick in range(ticks_to(case)):
        fmu.doStep(tick * case.step_s, case.step_s)
    return {name: value for name in case.expect if (value := _of_fmu(fmu, model, name)) is not None}


def _of_fmu(fmu: Any, model: Any, name: str) -> float | None:
    found = [v for v in model.modelVariables if v.name == name.replace(".", "_")]
    if not found:
        return None
    kind = {"Enumeration": "Int64" if model.fmiVersion.startswith("3") else "Integer"}
    get = getattr(fmu, f"get{kind.get(found[0].type, found[0].type)}")
    return float(get([found[0].valueReference])[0])


# ---- Ecos ----


def ecos(case: Case, path: Path) -> Values:
    """EcosSimulation of an .ssp; variables of components are read."""
    from ecospy import EcosSimulation
    from ecospy.lib import EcosLib

    try:
        simulation = EcosSimulation(step_size=case.step_s, ssp_path=str(path))
        started = simulation.init(0, PARAMETER_SET) if _has_values(case) else simulation.init()
    except Exception as error:
        raise Refused(_words(error)) from error
    if not started:
        raise Refused(EcosLib.get_last_error())
    ticks = ticks_to(case)
    simulation.step(ticks)
    reached = simulation.get_time()
    if reached < (ticks - 0.5) * case.step_s:
        raise RuntimeError(EcosLib.get_last_error() or f"it stopped at {reached:g} s")
    return {name: value for name in case.expect if (value := _of_ecos(simulation, name)) is not None}


def _has_values(case: Case) -> bool:
    texts = [case.package.ssd, *(f for f in case.package.files.values() if isinstance(f, str))]
    return any("<ssv:ParameterSet" in text for text in texts)


def _of_ecos(simulation: Any, name: str) -> float | None:
    element, _, variable = name.rpartition(".")
    for get in (simulation.get_real, simulation.get_integer, simulation.get_bool):
        with contextlib.suppress(Exception):
            return float(get(f"{element}::{variable}"))
    return None


# ---- libcosim ----


def libcosim(case: Case, path: Path) -> Values:
    """cosim_ssp_fixed_step_execution_create; variables of components are observed."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver

    try:
        execution = CosimExecution.from_ssp_file(str(path), round(case.step_s * 1e9))
    except Exception as error:
        raise Refused(_cosim_error() or _words(error)) from error
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    if not execution.step(ticks_to(case)):
        raise RuntimeError(_cosim_error() or "a step failed")
    values = {name: _of_cosim(execution, observer, name) for name in case.expect}
    return {name: value for name, value in values.items() if value is not None}


def _cosim_error() -> str:
    from libcosimpy._internal import get_last_error_message

    return str(get_last_error_message())


def _of_cosim(execution: Any, observer: Any, name: str) -> float | None:
    element, _, variable = name.rpartition(".")
    for slave in execution.slave_infos():
        if slave.name.decode() != element:
            continue
        for known in execution.slave_variables(slave.index):
            if known.name.decode() == variable:
                kinds = (
                    observer.last_real_values,
                    observer.last_integer_values,
                    None,
                    observer.last_boolean_values,
                )
                get = kinds[known.type] if known.type < len(kinds) else None
                return float(get(slave.index, [known.reference])[0]) if get else None
    return None


# These import no connectors of the system: those that only show a variable are taken out for them.
WITHOUT_CONNECTORS = ("ecos", "libcosim")
SHOWN = re.compile(
    r'<ssd:Connection startElement="([^"]*)" startConnector="([^"]*)" endConnector="\1_\2">'
    r"</ssd:Connection>\n"
)
EMPTY = re.compile(r"<ssd:(Connections|Connectors)>\s*</ssd:\1>\n")


def without_connectors(content: bytes) -> bytes:
    """The .ssp without the connectors of the system that do nothing but show a variable."""
    try:
        files = unzipped(content)
        text = files[SSD].decode()
    except (zipfile.BadZipFile, KeyError, OSError, UnicodeDecodeError):
        return content  # one of the damaged ones
    for element, variable in SHOWN.findall(text):
        connector = re.escape(f'<ssd:Connector name="{element}_{variable}" kind="output">')
        text = re.sub(f"{connector}.*\n", "", text)
    text = EMPTY.sub("", SHOWN.sub("", text))
    return zipped({**files, SSD: text.encode()})


MASTERS: Mapping[str, Callable[[Case, Path], Values]] = {
    "fmpy": fmpy_ssp,
    "fmucontainer": fmucontainer,
    "ecos": ecos,
    "libcosim": libcosim,
}
# The packages that they are in.
PACKAGES = {
    "fmpy": "fmpy",
    "fmucontainer": "fmu-manipulation-toolbox",
    "ecos": "ecospy",
    "libcosim": "libcosimpy",
}


# ---- a process for each case ----


def _words(error: BaseException) -> str:
    """What an exception says, with its kind where that is all it says."""
    said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said}"[:LONGEST_MESSAGE]


def _outcome(key: str, case: Case, path: Path) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:  # some write beside the file
        copy = Path(folder) / path.name
        content = path.read_bytes()
        copy.write_bytes(without_connectors(content) if key in WITHOUT_CONNECTORS else content)
        os.chdir(folder)
        try:
            return {"outcome": "ran", "values": MASTERS[key](case, copy)}
        except Refused as error:
            return {"outcome": "refused", "message": str(error)[:LONGEST_MESSAGE]}
        except Exception as error:  # noqa: BLE001 (it is handed to the parent)
            return {"outcome": "failed", "message": _words(error)}


def run(key: str, case: Case, path: Path) -> dict[str, Any]:
    """The outcome of one case, in a forked process."""
    read_end, write_end = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read_end)
        null = os.open(os.devnull, os.O_RDWR)
        for descriptor in (0, 1, 2):
            os.dup2(null, descriptor)
        os.write(write_end, json.dumps(_outcome(key, case, path)).encode())
        os._exit(0)  # no library's clean-up may turn a result into a crash
    os.close(write_end)
    answer = _awaited(child, read_end)
    os.close(read_end)
    _, status = os.waitpid(child, 0)
    if answer is None:
        return {"outcome": "hung", "message": f"no answer within {PATIENCE_S:g} s"}
    if not answer:
        number = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
        name = signal.Signals(number).name if number else f"exit code {os.waitstatus_to_exitcode(status)}"
        return {"outcome": "crashed", "message": name}
    return json.loads(answer)


def _awaited(child: int, descriptor: int) -> bytes | None:
    """All that the child writes; None if it writes nothing for too long: it is then ended."""
    content = b""
    while True:
        if not select.select([descriptor], [], [], PATIENCE_S)[0]:
            os.kill(child, signal.SIGKILL)
            return None
        part = os.read(descriptor, 65536)
        if not part:
            return content
        content += part


def _answers(key: str, folder: Path, names: Iterator[str]) -> Iterator[dict[str, Any]]:
    known = {case.name: case for case in CASES}
    for name in map(str.strip, names):
        yield run(key, known[name], folder / name / f"{name}.ssp")


def main(key: str, folder: str) -> None:
    """One master on the cases that standard input names."""
    if key in ("fmpy", "fmucontainer"):
        import fmpy.ssp.simulation  # noqa: F401 (once, not in every process)
    for answer in _answers(key, Path(folder).resolve(), iter(sys.stdin.readline, "")):
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
