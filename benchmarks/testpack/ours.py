"""A case on this project's own orchestrator, judged as strictly as its README promises."""

import tempfile
from pathlib import Path

import numpy as np

from benchmarks.testpack.case import SSD, Case
from benchmarks.testpack.pack import content
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from specs.errors import InputError, RunError

LIMIT_S = 2.0  # that a call of an isolated FMU may take
PASSED = ""


def judge(case: Case) -> str:
    """ "" if all is as it must be, or a sentence on what is not."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{case.name}.ssp"
        path.write_bytes(content(case))
        return _refused(case, path) if case.kind == "refused" else _run(case, path)


def _refused(case: Case, path: Path) -> str:
    try:
        system = load_system(path)
        simulate(system, 0, limit_s=LIMIT_S)
    except InputError as error:
        return unnamed(case, str(error))
    except RunError as error:
        return f"it is refused as if it had run: {error}"
    return "it is accepted"


def unnamed(case: Case, message: str) -> str:
    """What a message should name and does not."""
    wanted = [*case.names, *([f"{SSD} line {case.line}"] if case.line else [])]
    missing = [name for name in wanted if name not in message]
    if len(message.splitlines()) > 2:
        return f"the message is longer than two lines: {message}"
    return f"the message does not name {', '.join(missing)}: {message}" if missing else PASSED


def _run(case: Case, path: Path) -> str:
    try:
        system = load_system(path)
        if system.stop_s != case.stop_s or (case.step_s != system.step_s):
            return f"it is stepped {system.step_s} s to {system.stop_s} s"
        record = simulate(system, case.ticks, record=list(case.expect) or None, limit_s=LIMIT_S)
    except (InputError, RunError) as error:
        return unnamed(case, str(error)) if case.kind == "fails" else f"{type(error).__name__}: {error}"
    if case.kind == "fails":
        return "it ran to its end"
    if case.kind == "ends":
        ended = not record.complete and all(name in record.reason for name in case.names)
        return PASSED if ended else f"it ended with '{record.reason}'"
    ticks = np.rint(case.checked_times / case.step_s).astype(int)
    return compared(case, {name: record.column(name)[ticks].astype(float) for name in case.expect})


def compared(case: Case, found: dict[str, np.ndarray]) -> str:
    """The first value that is not what is expected, if there is one."""
    times = case.checked_times
    for name, values in found.items():
        wanted = case.values(name, times)
        wrong = np.flatnonzero(~(np.abs(values - wanted) <= case.tolerance))
        if len(wrong):
            i = wrong[0]
            return f"{name} = {values[i]:.12g} at t = {times[i]:g}, expected {wanted[i]:.12g}"
    return PASSED
