"""How fast the reference machine steps, against the plain form of its step.

Three builds of the same model take turns in one process: `shipped`; `every_step`, which makes new factors in
every internal step; and `dense`, which also forms and factorises the whole matrix (dense.c).  A ratio is
formed within a block, and a figure is the median over the blocks.
"""

import ctypes
import time
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import casadi as ca
import numpy as np

from fmus.definition import Model
from fmus.models.machine.dynamics import ANGLES
from fmus.models.machine.model import MODEL
from fmus.toolchain import compiler
from fmus.toolchain.build import compile_generated, generate_sources
from fmus.toolchain.codegen import CASADI_OPTIONS, with_our_mathematics
from specs.errors import RunError
from specs.progress import Report

HERE = Path(__file__).parent
BUILDS = ("dense", "every_step", "shipped")
SAMPLES = 50  # of a timing: a second of the machine
LEAST_RATIO, LEAST_REALTIME = 2.5, 20.0


def run(blocks: int, report: Report) -> dict[str, Any]:
    """Times of an internal step, ratios to the dense one, and how far apart the builds are in the end."""
    with TemporaryDirectory(prefix="slewright-", ignore_cleanup_errors=True) as folder:
        report("building the machine three times")
        libraries = build(Path(folder))
        for library in libraries.values():
            library.bench_start()
        times: dict[str, list[float]] = {name: [] for name in BUILDS}
        for block in range(blocks):
            for name in BUILDS if block % 2 else reversed(BUILDS):
                times[name].append(_microseconds(libraries[name]))
            report("stepping", block + 1, blocks)
        states = {name: _states(library) for name, library in libraries.items()}
    return {"blocks": blocks, "simulated_s": blocks * SAMPLES * MODEL.sample_time, "serves": MODEL.serves} | {
        name: _figures(times, states, name) for name in BUILDS
    }


def missed(figures: Mapping[str, Any]) -> list[str]:
    """Limits that the shipped build does not keep."""
    found, ratio, factor = [], figures["shipped"]["speed_up"], figures["shipped"]["realtime_factor"]
    if ratio < LEAST_RATIO:
        found.append(f"{ratio:.2f} × as fast as the dense step, must be at least {LEAST_RATIO:g} ×")
    if factor < LEAST_REALTIME:
        found.append(f"{factor:.0f} × real time, must be at least {LEAST_REALTIME:g} ×")
    return found


def build(folder: Path) -> dict[str, ctypes.CDLL]:
    """The libraries of the three builds, by name."""
    target = compiler.host().name
    generate_sources(MODEL, folder)
    model = compile_generated(folder / "model.c", folder / "model.o", target)
    (folder / "dense_model.c").write_text(_dense_functions(MODEL), encoding="utf-8")
    dense = compiler.compile_object(
        folder / "dense_model.c", folder / "dense_model.o", target, ["-I", str(folder)], generated=True
    )
    size = max(f.sz_w() for f in (MODEL.f, MODEL.jacobian))
    libraries = {"dense": _link(folder, "dense", HERE / "dense.c", [model, dense], [f"-DDENSE_SZ_W={size}"])}
    libraries["shipped"] = _link(folder, "shipped", folder / "integrator.c", [model])
    config = folder / "model_config.h"
    served = config.read_text(encoding="utf-8").replace(
        f"#define SLW_SERVES {MODEL.serves}\n", "#define SLW_SERVES 1\n"
    )
    config.write_text(served, encoding="utf-8")
    libraries["every_step"] = _link(folder, "every_step", folder / "integrator.c", [model])
    return libraries


def _dense_functions(model: Model) -> str:
    """C code of right-hand side and dense Jacobian, as functions of the parameters."""
    generator = ca.CodeGenerator("dense_model.c", CASADI_OPTIONS)
    for name, function in (("dense_f", model.f), ("dense_jac", model.jacobian)):
        generator.add(ca.Function(name, list(model.symbols), [function(*model.symbols)]))
    return with_our_mathematics(generator.dump())


def _link(
    folder: Path, name: str, integrator: Path, objects: list[Path], options: tuple[str, ...] | list[str] = ()
) -> ctypes.CDLL:
    target, given = compiler.host().name, ["-I", str(folder), *options]
    compiled = [
        compiler.compile_object(source, folder / f"{name}-{source.stem}.o", target, given)
        for source in (folder / "core.c", integrator, HERE / "bench.c")
    ]
    path = folder / f"{name}{compiler.host().suffix}"
    library = ctypes.CDLL(str(compiler.link_shared([*compiled, *objects], path, target)))
    library.bench_samples.argtypes = [ctypes.c_longlong]
    library.bench_states.restype = ctypes.POINTER(ctypes.c_double)
    return library


def _microseconds(library: ctypes.CDLL) -> float:
    """Processor time of an internal step."""
    began = time.thread_time_ns()
    if library.bench_samples(SAMPLES):
        raise RunError("the machine's step failed")
    return (time.thread_time_ns() - began) / 1e3 / (SAMPLES * MODEL.sample_time / MODEL.step)


def _states(library: ctypes.CDLL) -> np.ndarray:
    return np.array(library.bench_states()[: len(MODEL.states)])


def _figures(
    times: Mapping[str, list[float]], states: Mapping[str, np.ndarray], name: str
) -> dict[str, float]:
    mine, dense = np.array(times[name]), np.array(times["dense"])
    low, ratio, high = np.percentile(dense / mine, (25, 50, 75))
    step = float(np.median(mine))
    apart = np.abs(states[name] - states["dense"])[: len(ANGLES)].max()
    return {
        "step_us": step,
        "speed_up": float(ratio),
        "speed_up_p25": float(low),
        "speed_up_p75": float(high),
        "realtime_factor": MODEL.step * 1e6 / step,
        "angle_apart_deg": float(np.degrees(apart)),
    }
