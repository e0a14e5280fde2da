"""What orchestration costs on top of the FMUs' own functions, in the material handler's nominal system."""

import time
from pathlib import Path

from benchmarks.orchestrator.chain import Chain
from orchestrator.run.master import Master, Options
from orchestrator.system.check import load_system
from orchestrator.system.layout import lay_out
from orchestrator.system.pack import pack_system

TARGETS = {"target_x": -3.0, "target_y": 9.0, "target_z": 4.0, "pace": 1.0}
MAX_ROWS = 5_000


class Nominal:
    """The nominal system with its default record into memory, each FMU's time measured by the core.

    The clock readings themselves count as orchestration.
    """

    steps = 4_000  # long enough that the first of them, in a cold cache, hardly count

    def __init__(self, chain: Chain, folder: Path) -> None:
        system = load_system(pack_system("nominal", chain.fmi_version, folder))  # type: ignore[arg-type]
        options = Options(stimuli={0: TARGETS}, timing=True, trust=True)
        self.master = Master(system, lay_out(system), system.start_values({}), options)
        self.master.plan.log(MAX_ROWS)
        self.master.initialise()
        self.inside = 0.0
        self.run(2 * self.steps)  # the first ones of a process are slower

    def run(self, steps: int) -> float:
        self.master.take(0, MAX_ROWS, 0)
        before = self._inside()
        begin = time.perf_counter()
        self.master.run(self.master.tick + steps)
        seconds = time.perf_counter() - begin
        self.inside = self._inside() - before
        return seconds

    def _inside(self) -> float:
        components = self.master.statistics()["components"]
        return sum(part["seconds"] for part in components.values())

    def values(self) -> list[float]:
        return []
