"""Many targets on a plant: 45-135 degrees of slew each, 15 s for each, and what became of them.

They come in runs of at most RUN, each from the start pose and with a load of its own where it is drawn.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from fmus.equations import kinematics
from fmus.models.slew_nn.network import PERIOD_S, SlewNetwork
from orchestrator.run.processes import interrupts_held, warm_up
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.stimuli import Stimuli
from records.metrics import TargetMetrics, compute
from records.record import Record
from records.targets import targets
from specs import keys, parameters
from specs.errors import InputError, nearest
from specs.scenario import SLEW_STEP_DEG, Load, Scenario, Start, Target, load as load_scenario
from verification.plants.plant import Plant
from verification.runs import plant_parameters

RUN = 25  # targets of a run
RADIUS_M, HEIGHT_M = (7.0, 12.0), (3.0, 8.0)
MOST_SLEW_DEG = 170.0  # to either side
REST_S = 5.0  # before the next target: the machine should be still
CHATTER = 0.01  # of the joystick: smaller values have no sign
MOST_OUTSIDE = 0.05  # share of a run out of the trained region, above which its figures are flagged
LOADS = ("empty", "2t", "unknown")
METRICS = ("speed", "overshoot", "error", "tool")
NEEDED = ("true_q_slew", "true_qd_slew", "true_qd_tool_x", "true_qd_tool_y", "true_tool_x", "true_tool_y",
          "true_tool_z", "u_slew", "inertia")  # fmt: skip


@dataclass(frozen=True)
class Trial:
    """What is asked: how many targets, their seed, and the load (empty, 2t, unknown or kg, not told)."""

    targets: int = 100
    seed: int = 1
    load: str = "unknown"
    task: str = "full"
    pace: float = 1.0

    def scenarios(self) -> Iterator[tuple[int, Scenario]]:
        """(seed, scenario) of each run."""
        for number, first in enumerate(range(0, self.targets, RUN)):
            yield self.seed + number, self._scenario(number, min(RUN, self.targets - first))

    def _scenario(self, number: int, count: int) -> Scenario:
        start = load_scenario("four_targets_empty").start
        draw = lambda *key: keys.uniform("plant targets", self.seed, number, *key)  # noqa: E731
        return Scenario(
            base="plant", description="Drawn targets", interval_s=15.0, start=start,
            targets=tuple(_targets(count, draw, start, self.task)), load=load_of(self.load),
        )  # fmt: skip


@dataclass(frozen=True)
class Job:
    """One run in a process of its own."""

    ssp: Path
    plant: Plant
    scenario: Scenario
    seed: int
    pace: float
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Ran:
    """What became of one run."""

    per_target: Sequence[TargetMetrics]
    rest: Sequence[float]  # deg, of each target
    sign_changes: int
    seconds: float
    outside: float | None


def load_of(text: str) -> Load:
    """A load by its name or in kg; InputError for one that no grab holds."""
    if text in LOADS:
        return load_scenario(f"four_targets_{text}").load
    try:
        kg = float(text)
    except ValueError:
        raise InputError(f"no load '{text}'; {nearest(text, LOADS)}, or a number of kg") from None
    most = parameters.parameter("load_mass").max
    if most is not None and not 0.0 <= kg <= most:
        raise InputError(f"load {text}: valid are 0 to {most:g} kg")
    return Load(name=f"{kg:g}kg", description="Stated load, not told", low_kg=kg, high_kg=kg, told_kg=0.0)


def _targets(count: int, draw: Any, start: Start, task: str) -> Iterator[Target]:
    low, high = SLEW_STEP_DEG
    slew, radius, height = start.slew_deg, 9.95, 6.18  # where the start pose has the grab
    for k in range(count):
        step = low + (high - low) * draw(k, "slew")
        turn = 1.0 if draw(k, "side") < 0.5 else -1.0
        slew += step * (turn if abs(slew + turn * step) <= MOST_SLEW_DEG else -turn)
        if task == "full":
            radius, height = _point(lambda *key, k=k: draw(k, *key))
        yield Target(slew_deg=slew, radius_m=radius, height_m=height)


def _point(draw: Any) -> tuple[float, float]:
    for attempt in range(1000):
        (r0, r1), (h0, h1) = RADIUS_M, HEIGHT_M
        radius, height = r0 + (r1 - r0) * draw("r", attempt), h0 + (h1 - h0) * draw("h", attempt)
        if kinematics.reachable(radius, 0.0, height) is None:
            return radius, height
    raise InputError("no target within reach")  # pragma: no cover


def run(jobs: Sequence[Job], workers: int, report: Any) -> Iterator[Ran]:
    """What became of each job, in their order, as soon as it is known."""
    with ProcessPoolExecutor(workers, get_context("spawn"), initializer=warm_up) as pool:
        with interrupts_held():  # the processes start here, and inherit it
            coming = pool.map(_run, jobs)
        for number, one in enumerate(coming):
            report(f"{jobs[number].plant.name}", number + 1, len(jobs))
            yield one


def simulated(job: Job, columns: Sequence[str] = NEEDED) -> Record:
    """The record of one run, with those of the columns that its system has."""
    system, s = load_system(job.ssp), job.scenario
    return simulate(
        system,
        s.duration_ticks,
        Stimuli(s.stimuli(job.pace)),
        plant_parameters(system, job.plant.system, s.parameters(job.seed)) | dict(job.parameters),
        record=[n for n in columns if n in system.outputs],
        seed=job.seed,
        meta={
            "scenario": s.name, "targets": s.schedule(), "target_interval_s": s.interval_s,
            "load_kg": s.true_load(job.seed), "load_told_kg": s.load.told_kg,
        },
    )  # fmt: skip


def _run(job: Job) -> Ran:
    record = simulated(job)
    return Ran(
        compute(record).per_target,
        [_rest(record, t.rows) for t in targets(record) if t.whole],
        _sign_changes(record.column("u_slew")),
        float(record.time[-1]),
        outside(job.plant.network, record),
    )


def _rest(record: Record, rows: slice) -> float:
    """Peak to peak of the slew angle in the last seconds of a target, deg."""
    time = record.time[rows]
    still = record.column("true_q_slew")[rows][time > time[-1] - REST_S]
    return math.degrees(float(np.ptp(still)))


def _sign_changes(u: np.ndarray) -> int:
    signs = np.sign(u[np.abs(u) > CHATTER])
    return int(np.count_nonzero(np.diff(signs)))


def outside(network: SlewNetwork | None, record: Record) -> float | None:
    """Share of the run out of the region that the network was trained on; None if that is not known."""
    if network is None or not network.knows_region:
        return None
    step = round(PERIOD_S / float(record.time[1] - record.time[0]))
    state = [record.column(name)[::step] for name in ("inertia", "u_slew", "true_qd_slew")]
    return float(np.mean(network.outside(*state)))


def figures(ran: Sequence[Ran], task: str) -> dict[str, Any]:
    """The means over all targets; flagged where one run or more is out of the trained region for too long."""
    rows = [row for one in ran for row in one.per_target]
    of = {name: name for name in METRICS} | {"error": "slew_error" if task == "slew" else "error"}
    values = {name: [getattr(r, attribute) for r in rows] for name, attribute in of.items()}
    shares = [one.outside for one in ran if one.outside is not None]
    most = max(shares, default=None)
    return {
        "missed_share": float(np.mean([not r.reached for r in rows])),
        **{name: float(np.mean(v)) for name, v in values.items()},
        "overshoot_max": max(values["overshoot"]),
        "standard_error": {name: _standard_error(v) for name, v in values.items()},
        "rest_peak_to_peak": float(np.mean([v for one in ran for v in one.rest])),
        "sign_changes": sum(one.sign_changes for one in ran) / sum(one.seconds for one in ran),
        "targets": len(rows),
        "outside": float(np.mean(shares)) if shares else None,
        "outside_max": most,
        "flagged": most is not None and most > MOST_OUTSIDE,
    }


def _standard_error(values: Sequence[float]) -> float | None:
    """Of the mean, the targets taken as independent; None of fewer than two."""
    return float(np.std(values, ddof=1) / math.sqrt(len(values))) if len(values) > 1 else None
