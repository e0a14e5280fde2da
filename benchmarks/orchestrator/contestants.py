"""The masters that run the chain; each is made in a child process (see child.py) and asked for short runs.

A contestant's constructor loads and initialises the chain.  `run(steps)` goes on for that many steps and
returns the seconds that they took, `values()` the four logged signals as they stand.
What cannot be measured raises NotMeasured with the reason.
"""

import ctypes
import time
from pathlib import Path
from typing import Protocol

from fmpy import extract, read_model_description
from fmpy.ssp.simulation import simulate_ssp

from benchmarks.orchestrator import masters
from benchmarks.orchestrator.chain import LOGGED, SIGNALS, STEP_S, Chain, case
from orchestrator.fmi.component import runs_here
from orchestrator.run.master import Master, Options
from orchestrator.system.check import load_system
from orchestrator.system.layout import lay_out

MAX_STEPS = 50_000  # of one run: rows that a log in memory holds


class NotMeasured(Exception):
    """Why a master has no figure."""


class Contestant(Protocol):
    """A master with the chain loaded.

    A class may state `steps`, the length of its runs; else they are made as long as blocks.RUN_S.
    """

    def run(self, steps: int) -> float: ...

    def values(self) -> list[float]: ...


class _Driven:
    """One of the C loops of c/drive.c."""

    handle: int

    def __init__(self, chain: Chain) -> None:
        self.library = ctypes.CDLL(str(chain.driver))
        for name in ("chain", "box", "values"):
            getattr(self.library, f"slw_drive_{name}").restype = ctypes.c_void_p
        self.library.slw_drive_run.restype = ctypes.c_double
        self.library.slw_drive_run.argtypes = [ctypes.c_void_p, ctypes.c_int64]

    def run(self, steps: int) -> float:
        seconds = self.library.slw_drive_run(self.handle, steps)
        if seconds < 0.0:
            raise NotMeasured("the FMU failed in a step")
        return seconds

    def values(self) -> list[float]:
        where = self.library.slw_drive_values(ctypes.c_void_p(self.handle))
        return list((ctypes.c_double * len(LOGGED)).from_address(where))


class Floor(_Driven):
    """The hand-written loop."""

    def __init__(self, chain: Chain, _: Path) -> None:
        super().__init__(chain)
        paths = (ctypes.c_char_p * 3)(*(str(p).encode() for p in chain.libraries))
        step, rows = ctypes.c_double(STEP_S), ctypes.c_size_t(MAX_STEPS)
        self.handle = self.library.slw_drive_chain(chain.fmi_version, paths, step, rows)
        if not self.handle:
            raise NotMeasured("the libraries do not load")


class FmuContainer(_Driven):
    """The container of fmu-manipulation-toolbox, driven by a C loop."""

    def __init__(self, chain: Chain, folder: Path) -> None:
        super().__init__(chain)
        box = masters.container(case(chain, folder))
        model = read_model_description(str(box))
        root = Path(extract(str(box), unzipdir=str(folder / "box")))
        references = {v.name: v.valueReference for v in model.modelVariables}
        vr = (ctypes.c_uint * 4)(*(references[f"{c}_{v}"] for c, v in SIGNALS))
        resources = root / "resources"
        self.handle = self.library.slw_drive_box(
            chain.fmi_version,
            str(next((root / "binaries").rglob("*.so"))).encode(),
            str(model.guid).encode(),  # FMPy puts the instantiation token there too
            (resources.as_uri() if chain.fmi_version == 2 else f"{resources}/").encode(),
            vr,
            ctypes.c_double(STEP_S),
            ctypes.c_size_t(MAX_STEPS),
        )
        if not self.handle:
            raise NotMeasured("the container does not initialise")


class Slewright:
    """This project's own, every status and output checked; its ring holds the rows of a run.

    In this process, as all the others: what is measured is the stepping.
    """

    trust = True

    def __init__(self, chain: Chain, _: Path) -> None:
        system = load_system(chain.ssp)
        self.layout = lay_out(system, LOGGED)
        self.master = Master(system, self.layout, system.start_values({}), Options(trust=self.trust))
        self.master.plan.log(MAX_STEPS)
        self.master.initialise()

    def run(self, steps: int) -> float:
        self.master.take(0, MAX_STEPS, 0)
        until, core = self.master.tick + steps, self.master.core
        begin = time.perf_counter()
        self.master.library.slw_core_run(core, until)
        seconds = time.perf_counter() - begin
        if self.master.tick != until:
            raise NotMeasured("the run failed")
        return seconds

    def values(self) -> list[float]:
        return [float(self.master.plan.reals[logged.cell]) for logged in self.layout.logged]


class Isolated(Slewright):
    """The same with each FMU in a process of its own, as foreign ones run by default."""

    trust = False

    def __init__(self, chain: Chain, folder: Path) -> None:
        if all(runs_here(c, trust=False) for c in load_system(chain.ssp).components.values()):
            raise NotMeasured("FMUs run in this process")
        super().__init__(chain, folder)


class Ecos:
    """Ecos: its own loop over many steps, nothing recorded (which is to its favour)."""

    def __init__(self, chain: Chain, folder: Path) -> None:
        self.simulation = masters.ecos_simulation(case(chain, folder))

    def run(self, steps: int) -> float:
        begin = time.perf_counter()
        self.simulation.step(steps)
        return time.perf_counter() - begin

    def values(self) -> list[float]:
        return [self.simulation.get_real(f"{c}::{v}") for c, v in SIGNALS]


class FmpySsp:
    """FMPy's simulate_ssp, which loads anew each time: the time of a run of one step is taken off."""

    steps = 2000

    def __init__(self, chain: Chain, _: Path) -> None:
        if chain.fmi_version == 3:
            raise NotMeasured("simulate_ssp knows FMI 1 and FMI 2 only")
        self.path, self.result = str(chain.ssp), {}

    def run(self, steps: int) -> float:
        loading = self._whole(1)
        return (self._whole(steps) - loading) * steps / (steps - 1)

    def _whole(self, steps: int) -> float:
        begin = time.perf_counter()
        # Time is summed up there: half a step less makes the number of steps certain.
        self.result = simulate_ssp(self.path, stop_time=(steps - 0.5) * STEP_S, step_size=STEP_S)
        return time.perf_counter() - begin

    def values(self) -> list[float]:
        return [float(self.result[name][-1]) for name in LOGGED]


class Libcosim:
    """libcosim through libcosimpy: many steps a call, the last values observed."""

    def __init__(self, chain: Chain, folder: Path) -> None:
        from libcosimpy.CosimObserver import CosimObserver

        self.simulation = masters.Libcosim(case(chain, folder), CosimObserver.create_last_value())

    def run(self, steps: int) -> float:
        begin = time.perf_counter()
        self.simulation.execution.step(steps)
        return time.perf_counter() - begin

    def values(self) -> list[float]:
        return [self.simulation.value(name) for name in SIGNALS]
