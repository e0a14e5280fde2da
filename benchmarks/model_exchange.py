"""Van der Pol's oscillator by model exchange: this master and FMPy, both with CVODE, blocks interleaved."""

import re
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import extract, read_model_description, simulate_fmu
from scipy.integrate import solve_ivp

from fmus.toolchain import compiler
from fmus.toolchain.build import SHIM, pack
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system

SOURCE = Path(__file__).parent / "orchestrator" / "c" / "oscillator3.c"
STOP_S, STEP_S, TOLERANCE = 20.0, 0.01, 1e-6
DESCRIPTION = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="3.0" modelName="oscillator" instantiationToken="oscillator">
<ModelExchange modelIdentifier="oscillator"/>
<ModelVariables>
<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
<Float64 name="x" valueReference="1" causality="output" initial="exact" start="2"/>
<Float64 name="v" valueReference="2" causality="output" initial="exact" start="0"/>
<Float64 name="der(x)" valueReference="3" derivative="1"/>
<Float64 name="der(v)" valueReference="4" derivative="2"/>
</ModelVariables>
<ModelStructure><Output valueReference="1"/><Output valueReference="2"/>
<ContinuousStateDerivative valueReference="3"/><ContinuousStateDerivative valueReference="4"/>
</ModelStructure>
</fmiModelDescription>
"""


def measure(blocks: int) -> dict[str, Any]:
    """Times of a run of 20 s with 2,000 outputs, loading included, and the largest errors of x."""
    with tempfile.TemporaryDirectory() as folder:
        path = _fmu(Path(folder))
        system, unpacked = load_system(path, STEP_S), extract(str(path), str(Path(folder) / "fmpy"))
        described = read_model_description(str(path), validate=False)

        def ours() -> np.ndarray:
            ticks = round(STOP_S / STEP_S)
            record = simulate(system, ticks, trust=True, record=["x", "v"], tell_tolerance=TOLERANCE)
            return record.column("x")

        def fmpy() -> np.ndarray:
            found = simulate_fmu(
                unpacked,
                validate=False,
                model_description=described,
                fmi_type="ModelExchange",
                stop_time=STOP_S,
                output_interval=STEP_S,
                relative_tolerance=TOLERANCE,
                output=["x", "v"],
            )
            return np.interp(_times(), found["time"], found["x"])

        contestants = {"slewright": ours, "fmpy": fmpy}
        errors = {name: float(np.abs(run() - _exact()).max()) for name, run in contestants.items()}
        seconds: dict[str, list[float]] = {name: [] for name in contestants}
        for _ in range(blocks):
            for name, run in contestants.items():
                began = time.perf_counter()
                run()
                seconds[name].append(time.perf_counter() - began)
    ratios = np.array(seconds["fmpy"]) / np.array(seconds["slewright"])
    return {
        "seconds": {name: float(np.median(values)) for name, values in seconds.items()},
        "error": errors,
        "times_faster": [float(q) for q in np.percentile(ratios, (25, 50, 75))],
        "tolerance": TOLERANCE,
        "blocks": blocks,
    }


def missed(figures: dict[str, Any]) -> list[str]:
    """It must not be slower than FMPy."""
    faster = figures["times_faster"][1]
    return [] if faster >= 1.0 else [f"{faster:.2f} times as fast as FMPy, must be at least 1"]


def _times() -> np.ndarray:
    return STEP_S * np.arange(round(STOP_S / STEP_S) + 1)


def _exact() -> np.ndarray:
    """x by a method of order 8 with a far smaller tolerance."""
    found = solve_ivp(
        lambda _, y: [y[1], (1 - y[0] ** 2) * y[1] - y[0]],
        (0, STOP_S),
        [2, 0],
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
        t_eval=np.minimum(_times(), STOP_S),
    )
    return found.y[0]


def _fmu(folder: Path) -> Path:
    host, source = compiler.host(), SOURCE.read_text()
    known = set(re.findall(r"\b(fmi3\w+)\(", source))
    names = set(re.findall(r"\s(fmi3\w+);", (SHIM / "fmi" / "fmi3Functions.h").read_text())) - known
    (folder / "rest.c").write_text("".join(f"int {name}(void) {{ return 0; }}\n" for name in sorted(names)))
    flags = (f"-I{SHIM}", "-fvisibility=default")
    objects = [
        compiler.compile_object(SOURCE, folder / "oscillator.o", host.name, flags),
        compiler.compile_object(folder / "rest.c", folder / "rest.o", host.name, flags, generated=True),
    ]
    library = compiler.link_shared(objects, folder / f"oscillator{host.suffix}", host.name)
    path = folder / "oscillator.fmu"
    path.write_bytes(
        pack(
            {
                "modelDescription.xml": DESCRIPTION.encode(),
                f"binaries/{host.name}/{library.name}": library.read_bytes(),
            }
        )
    )
    return path
