"""How fast the FMU of a slew network is: its doStep against the bare generated C, interleaved in one process.

Bare is the generated function of the next state and nothing else; doStep adds the brake's mode, the outputs,
the check for finite states and FMI's own.  A block times both, back to back, in turning order; the ratio is
formed within a block, and a figure is the median over the blocks.
"""

import ctypes
import shutil
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

from fmus.models.slew_nn.fmu import build_from
from fmus.models.slew_nn.model import STEP, WEIGHTS, of_network
from fmus.models.slew_nn.network import SlewNetwork
from fmus.models.slew_nn.untrained import PRESSURE_LAYERS, VELOCITY_LAYERS, untrained
from fmus.toolchain import compiler
from fmus.toolchain.build import generate_sources
from specs.errors import RunError

RUN_STEPS = 400  # of a timing: some 2 ms, less than a time slice of the scheduler
U_SLEW, INERTIA = 0.5, 4e5
MOST_RATIO, LEAST_REALTIME = 1.5, 500.0
CASES: dict[str, Callable[[], SlewNetwork]] = {
    "paper": lambda: _untrained(),
    "symmetric": lambda: _untrained(symmetric=True),
    "ensemble_of_5": lambda: _untrained(members=5),
    "shipped": lambda: SlewNetwork.load(WEIGHTS),
}
JUDGED = ("paper", "shipped")


@dataclass(frozen=True)
class Speed:
    """Times a step in every block [µs]."""

    fmu: np.ndarray
    bare: np.ndarray

    def figures(self) -> dict[str, float]:
        """Medians, and the ratio's quartiles."""
        low, ratio, high = np.percentile(self.fmu / self.bare, (25, 50, 75))
        fmu = float(np.median(self.fmu))
        return {
            "fmu_us": fmu,
            "bare_us": float(np.median(self.bare)),
            "ratio": float(ratio),
            "ratio_p25": float(low),
            "ratio_p75": float(high),
            "realtime_factor": STEP * 1e6 / fmu,
        }


def run(blocks: int, report: Callable[..., None]) -> dict[str, Any]:
    """Figures of the paper's layers with random weights, plain and multiplied, and of the shipped network.

    Time depends on weights only by the share of zeros behind the ReLUs, which random ones have half of.
    """
    found: dict[str, Any] = {"blocks": blocks, "layers": [list(PRESSURE_LAYERS), list(VELOCITY_LAYERS)]}
    for name, network in CASES.items():
        report(f"building {name}")
        found[name] = measure(network(), blocks, lambda i, name=name: report(name, i, blocks)).figures()
    return found


def _untrained(**how: Any) -> SlewNetwork:
    return untrained(1, PRESSURE_LAYERS, VELOCITY_LAYERS, **how)


def missed(figures: dict[str, Any]) -> list[str]:
    """Limits that the paper's or the shipped network does not keep; the others are shown for comparison."""
    found = []
    for name in JUDGED:
        ratio, factor = figures[name]["ratio"], figures[name]["realtime_factor"]
        if ratio > MOST_RATIO:
            found.append(f"{name}: doStep takes {ratio:.2f} × its bare C, must be at most {MOST_RATIO:g} ×")
        if factor < LEAST_REALTIME:
            found.append(f"{name}: {factor:.0f} × real time, must be at least {LEAST_REALTIME:g} ×")
    return found


def measure(network: SlewNetwork, blocks: int, report: Callable[[int], None] = lambda i: None) -> Speed:
    """Time both; raises RunError if they do not compute the same."""
    with ExitStack() as stack:
        pair = _Pair(network, stack)
        pair.check()
        rows = []
        for block in range(blocks):
            order = ("fmu", "bare") if block % 2 else ("bare", "fmu")
            rows.append({which: pair.microseconds(which) for which in order})
            report(block + 1)
    return Speed(*(np.array([row[which] for row in rows]) for which in ("fmu", "bare")))


class _Pair:
    """The FMU in step mode and the bare model, at the same state."""

    def __init__(self, network: SlewNetwork, stack: ExitStack) -> None:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="slewright-")))
        self.bare = _bare(network, folder)
        self.fmu, self.vr = _fmu(network, folder, stack)
        self.tick = 0

    def check(self) -> None:
        """Both at rest, then over some steps: the same outputs."""
        inputs = [U_SLEW, INERTIA, 0.0, 0.0]
        names = ("u_slew", "inertia", "inertia_rate", "disturbance_torque_slew")
        self.fmu.setReal([self.vr[n] for n in names], inputs)
        self.bare.bare_start((ctypes.c_double * 4)(*inputs), (ctypes.c_double * 1)(1.0))
        self.step("fmu")
        self.step("bare")
        y = (ctypes.c_double * 5)()
        self.bare.bare_outputs(y)
        mine = self.fmu.getReal([self.vr[n] for n in ("q_slew", "qd_slew", "p_slew_a", "p_slew_b")])
        if mine != list(y)[:4]:
            raise RunError(f"FMU and bare code differ: {mine} and {list(y)[:4]}")

    def step(self, which: str) -> None:
        if which == "bare":
            self.bare.bare_steps(RUN_STEPS)
            return
        if self.bare.fmu_steps(self.fmu.dll.fmi2DoStep, self.fmu.component, self.tick, RUN_STEPS):
            raise RunError("the FMU's doStep failed")
        self.tick += RUN_STEPS

    def microseconds(self, which: str) -> float:
        began = time.perf_counter_ns()
        self.step(which)
        return (time.perf_counter_ns() - began) / RUN_STEPS / 1e3


def _bare(network: SlewNetwork, folder: Path) -> ctypes.CDLL:
    sources, target = folder / "sources", compiler.host().name
    generate_sources(of_network(network), sources)
    (sources / "bench.c").write_bytes(Path(__file__).with_name("bench.c").read_bytes())
    objects = [
        compiler.compile_object(sources / f"{n}.c", sources / f"{n}.o", target, generated=n == "model")
        for n in ("model", "bench")
    ]
    library = ctypes.CDLL(
        str(compiler.link_shared(objects, sources / f"bare{compiler.host().suffix}", target))
    )
    library.bare_steps.argtypes = [ctypes.c_longlong]
    library.fmu_steps.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_longlong, ctypes.c_longlong]
    return library


def _fmu(network: SlewNetwork, folder: Path, stack: ExitStack) -> tuple[Any, dict[str, int]]:
    """An instance in step mode, and its value references by name."""
    path = str(build_from(network, "slew_nn", folder))
    described: Any = fmpy.read_model_description(path)
    extracted = fmpy.extract(path)
    stack.callback(shutil.rmtree, extracted, ignore_errors=True)
    fmu = FMU2Slave(
        guid=described.guid,
        unzipDirectory=extracted,
        modelIdentifier=described.coSimulation.modelIdentifier,
    )
    fmu.instantiate()
    stack.callback(fmu.freeInstance)
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    return fmu, {v.name: v.valueReference for v in described.modelVariables}
