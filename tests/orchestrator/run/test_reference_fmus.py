"""FMUs that others made, such as the Reference-FMUs of the Modelica Association: they run as FMPy runs them.

SLEWRIGHT_FMUS names a folder of them; CONTRIBUTING.md says where some are.
"""

import os
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest

from orchestrator.run.simulate import simulate
from orchestrator.system.single_fmu import system_of_fmu

FOLDER = os.environ.get("SLEWRIGHT_FMUS", "")
FMUS = sorted(Path(FOLDER).rglob("*.fmu")) if FOLDER else []
KINDS = ("CoSimulation", "ModelExchange")
TOLERANCE = 1e-9  # told to both solvers
# Of a signal's size: rounding of times, which FMPy adds up; what two solvers with the tolerance may be apart.
NEAR = {"CoSimulation": 1e-14, "ModelExchange": 1e-6}
NUMBERS = ("Real", "Integer", "Float64", "Float32", "Int64", "Int32", "UInt64", "UInt32")

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not FMUS, reason="SLEWRIGHT_FMUS names no folder with FMUs of others"),
]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("path", FMUS or [Path()], ids=lambda p: "/".join(p.parts[-2:]))
def test_it_runs_as_fmpy_runs_it(path: Path, kind: str) -> None:
    """Co-simulation gives the same, model exchange the same within the tolerance of the solvers."""
    described = fmpy.read_model_description(str(path), validate=False)
    here = fmpy.platform in fmpy.supported_platforms(str(path))
    if not here or not getattr(described, kind[0].lower() + kind[1:]):
        pytest.skip(f"it is not there as {kind} for this platform")
    names = [v.name for v in described.modelVariables
             if v.causality == "output" and v.type in NUMBERS and not v.dimensions]  # fmt: skip
    system = system_of_fmu(path, None, kind)
    ticks = round((system.stop_s or 1.0) / system.step_s)
    theirs = by_fmpy(path, described, kind, names, ticks * system.step_s, system.step_s)
    record = simulate(system, ticks, tell_tolerance=TOLERANCE)
    rows = [np.flatnonzero(np.abs(theirs["time"] - t) < 1e-9)[-1] for t in record.column("time")]
    last = -1 if kind == "ModelExchange" else None  # FMPy leaves out an event at the end
    for name in names:
        ours, other = record.column(name)[:last], theirs[name][rows][:last]
        near = NEAR[kind] * max(1.0, float(np.abs(other).max()))
        np.testing.assert_allclose(ours, other, 0, near, True, name)


def by_fmpy(path: Path, described: Any, kind: str, names: list[str], stop: float, step: float) -> Any:
    """FMPy's record of a run, a row at each step and at each event."""
    more: dict[str, Any] = {"relative_tolerance": TOLERANCE}
    if kind == "CoSimulation" and described.coSimulation.hasEventMode:
        more |= {"use_event_mode": True, "early_return_allowed": True}
    return fmpy.simulate_fmu(
        str(path), fmi_type=kind, stop_time=stop, output_interval=step, output=names, validate=False, **more
    )
