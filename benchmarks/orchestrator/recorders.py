"""Whole runs of the chain with every variable recorded to a file, from loading to the closed file.

A recorder is a contestant whose run is a whole run; afterwards `bytes` is the size of what it wrote.
Ours writes Parquet, the others what they can: CSV.
"""

import time
from pathlib import Path

from fmpy.ssp.simulation import simulate_ssp
from fmpy.util import write_csv

from benchmarks.orchestrator import masters
from benchmarks.orchestrator.chain import STEP_S, Chain, case
from benchmarks.orchestrator.contestants import NotMeasured
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system


class _Recorder:
    steps = 10_000
    bytes = 0

    def __init__(self, chain: Chain, folder: Path) -> None:
        self.chain, self.folder, self.runs = chain, folder, 0

    def run(self, steps: int) -> float:
        self.runs += 1
        out = self.folder / f"run{self.runs}"
        out.mkdir()
        begin = time.perf_counter()
        self.record(steps, out)
        seconds = time.perf_counter() - begin
        files = [path for path in out.rglob("*") if path.is_file()]
        self.bytes = sum(path.stat().st_size for path in files)
        for path in files:
            path.unlink()
        return seconds

    def record(self, steps: int, out: Path) -> None:
        """One run."""
        raise NotImplementedError

    def values(self) -> list[float]:
        return []


class SlewrightRecorder(_Recorder):
    """`slewright simulate --record all`."""

    steps = 100_000

    def record(self, steps: int, out: Path) -> None:
        system = load_system(self.chain.whole_ssp)
        simulate(system, steps, record_path=out / "run.parquet", record="all", trust=True)


class FmpyRecorder(_Recorder):
    """simulate_ssp and FMPy's own write_csv."""

    def record(self, steps: int, out: Path) -> None:
        if self.chain.fmi_version == 3:
            raise NotMeasured("simulate_ssp knows FMI 1 and FMI 2 only")
        stop = (steps - 0.5) * STEP_S
        result = simulate_ssp(str(self.chain.whole_ssp), stop_time=stop, step_size=STEP_S)
        write_csv(str(out / "run.csv"), result)


class LibcosimRecorder(_Recorder):
    """libcosim's observer that writes one CSV file an FMU."""

    def record(self, steps: int, out: Path) -> None:
        from libcosimpy.CosimObserver import CosimObserver

        simulation = masters.Libcosim(case(self.chain, out), CosimObserver.create_to_dir(str(out)))
        simulation.execution.step(steps)  # the files are closed with the objects, on return
