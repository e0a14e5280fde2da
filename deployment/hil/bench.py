"""`slewright bench runtime`: how late the cycle is, against cyclictest in the same minutes on the same
computer.

A block is one run of ours and one of cyclictest under the same load, in turned order; ratios are formed
within a block, and a figure is the median over the blocks.  Ours is the whole runtime: bus, Modbus server,
recorder, and the control process driving the simulated machine.  Without real-time priority or without
cyclictest there is nothing to compare: that is said, and nothing is measured.
"""

import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

from deployment.hil import loads
from deployment.hil.commanding import KINDS, PAGE, ROS2, commanding
from deployment.hil.rig import Interfaces, Rig, Setting, free_domain, free_port
from deployment.hil.watchers import watching
from runtime.image import TICK_S
from runtime.realtime import PRIORITY
from specs.errors import RunError
from specs.progress import Report
from specs.scenario import Scenario, load

LOADS = ("idle", "modbus", "stress")
# Measured when it is asked for: the HMI with three pages open, on other computers (`hmi`) or in browsers on
# this one (`browsers`), which then has them to draw.
PAGES = {"hmi": loads.readers, "browsers": loads.pages}
# All interfaces beside CAN and Modbus, with ten clients: four of Foxglove, three of OPC UA, three of ROS 2.
INTERFACES = "interfaces"
# Who commands in the place of the planner: the page, or a ROS 2 publisher (deployment/hil/commanding.py).
MORE = (*PAGES, INTERFACES, *KINDS)
LIMITS = {
    "idle": 1.5,
    "modbus": 1.5,
    "stress": 3.0,
    "hmi": 1.5,
    "browsers": 1.5,
    "interfaces": 1.5,
    "page": 1.5,
    "ros2": 1.5,
}  # ratio of p99, asked for
POLICY_P50_US = 150.0
RATIO = 4.0  # of the median tick and the core's step in it, asked for
RESOLUTION_US = 1.0  # of the histograms
COSTS = (("ours", "p50"), ("ours", "p99"), ("policy_tick", "p50"), ("other_tick", "p50"), ("latency", "p99"))
QUANTILES = {"p50": 0.5, "p99": 0.99, "p999": 0.999}
SCENARIO = "four_targets_empty"
WORK = {
    "policy tick": "policy_tick_us",
    "other tick": "other_tick_us",
    "core in policy tick": "policy_step_us",
}


@dataclass
class Block:
    """One pair of runs; times in µs."""

    ours: dict[str, float]
    cyclictest: dict[str, float]
    tick: dict[str, float]
    policy_tick: dict[str, float]
    other_tick: dict[str, float]
    policy_step: dict[str, float]
    step: dict[str, float]
    bus: dict[str, float]
    latency: dict[str, float]
    rehearsal: dict[str, float]
    stolen: int
    overruns: int
    ticks: int
    rps: float | None = None

    @property
    def ratio(self) -> float:
        """p99 of ours over cyclictest's."""
        return self.ours["p99"] / self.cyclictest["p99"]

    @property
    def tick_ratio(self) -> float:
        """Median tick over the median of the core's step in it."""
        return self.tick["p50"] / self.step["p50"]

    @property
    def tick_ratio_without_bus(self) -> float:
        """The same without the system calls of the bus."""
        return (self.tick["p50"] - self.bus["p50"]) / self.step["p50"]


@dataclass
class Result:
    """Blocks by load; `skipped` says why there are none."""

    blocks: dict[str, list[Block]] = field(default_factory=dict)
    skipped: str = ""

    def figures(self) -> dict[str, Any]:
        """Medians over the blocks."""
        if self.skipped:
            return {"skipped": self.skipped}
        return {name: _medians(blocks) for name, blocks in self.blocks.items()}

    def costs(self, load: str) -> dict[str, dict[str, float]]:
        """What open pages (`hmi`, `browsers`) add to the control loop, µs: differences from idle in a block.

        `idle_varies` is by how much idle alone differs between blocks: a difference below that is not
        measurable.  Empty unless both loads were measured.
        """
        if not {"idle", load} <= self.blocks.keys():
            return {}
        found = {}
        for kind, quantile in COSTS:
            idle, open_ = ([getattr(b, kind)[quantile] for b in self.blocks[n]] for n in ("idle", load))
            apart = [b - a for a, b in zip(idle, open_, strict=True)]
            name = f"{'lateness' if kind == 'ours' else kind} {quantile}"
            found[name] = {"smallest": min(apart), "median": median(apart), "largest": max(apart)}
            found[name]["idle_varies"] = max(idle) - min(idle)
        return found

    def misses(self) -> list[str]:
        """What is beyond its limit."""
        found = [
            f"{load}: {name} {cost['median']:.0f} µs more than idle; that varies by {cost['idle_varies']:.0f}"
            for load in MORE
            for name, cost in self.costs(load).items()
            if cost["median"] > cost["idle_varies"] + RESOLUTION_US
        ]
        for name, row in self.figures().items() if not self.skipped else ():
            if row["ratio_p99"] > LIMITS[name]:
                found.append(f"{name}: p99 {row['ratio_p99']:.2f} × cyclictest's, limit {LIMITS[name]:g} ×")
            if row["overruns"]:
                found.append(f"{name}: {row['overruns']} overruns of our own making")
        idle = self.figures().get("idle")
        if idle and idle["tick_ratio"] > RATIO:
            found.append(f"tick: {idle['tick_ratio']:.1f} × the core's step in it, limit {RATIO:g} ×")
        if idle and idle["policy_tick_us"]["p50"] > POLICY_P50_US:
            p50 = idle["policy_tick_us"]["p50"]
            found.append(f"policy tick: p50 {p50:.0f} µs, limit {POLICY_P50_US:g} µs")
        return found


def run(bundle: Path, blocks: int, seconds: float, names: Sequence[str], report: Report) -> Result:
    """Measure, or say why not."""
    reason = _missing(names)
    if reason:
        return Result(skipped=reason)
    result = Result({name: [] for name in names})
    for number in range(blocks):
        for name in names:
            report(
                f"block {number + 1}, {name}", number * len(names) + names.index(name), blocks * len(names)
            )
            result.blocks[name].append(_block(bundle, name, seconds, ours_first=number % 2 == 0))
    return result


def cyclictest(seconds: float) -> dict[str, float]:
    """Quantiles of cyclictest's lateness at the same period and priority, in µs."""
    command = ["cyclictest", "-q", "-m", "-t", "1", "-p", str(PRIORITY), "--policy=fifo", "-h", "100000"]
    command += ["-i", str(round(TICK_S * 1e6)), "-l", str(round(seconds / TICK_S))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RunError(f"cyclictest: {done.stderr.strip().splitlines()[-1:] or done.returncode}")
    return quantiles(done.stdout)


def quantiles(text: str) -> dict[str, float]:
    """p50, p99, p999 and max from cyclictest's histogram."""
    rows = [line.split() for line in text.splitlines() if line[:1].isdigit()]
    bins = [(int(us), int(count)) for us, count in rows]
    total, largest = sum(count for _, count in bins), 0
    found: dict[str, float] = {}
    seen = 0
    for us, count in bins:
        seen += count
        largest = us if count else largest
        for name, share in QUANTILES.items():
            if name not in found and count and seen >= share * total:
                found[name] = us + 0.5
    return {**found, "max": float(largest)}


def _block(bundle: Path, name: str, seconds: float, ours_first: bool) -> Block:
    if ours_first:
        ours, rps = _ours(bundle, name, seconds)
        theirs = _theirs(name, seconds)
    else:
        theirs = _theirs(name, seconds)
        ours, rps = _ours(bundle, name, seconds)
    return Block(
        ours=ours["lateness_us"],
        cyclictest=theirs,
        tick=ours["tick_us"],
        policy_tick=ours["policy_tick_us"],
        other_tick=ours["other_tick_us"],
        policy_step=ours["policy_step_us"],
        step=ours["step_us"],
        bus=ours["bus_us"],
        latency=ours["latency_us"],
        rehearsal=ours["rehearsal_us"],
        stolen=ours["stolen_ticks"],
        overruns=ours["overruns"],
        ticks=ours["ticks"],
        rps=rps,
    )


def _ours(bundle: Path, name: str, seconds: float) -> tuple[dict[str, Any], float | None]:
    """Statistics of the cycles, and requests a second that were answered beside them."""
    ticks = round(seconds / TICK_S)
    scenario = load(SCENARIO)
    setting = _setting(bundle, scenario, min(ticks, scenario.duration_ticks), name)
    with Rig(setting) as rig:
        command = commanding(rig, name) if name in KINDS else nullcontext()
        with command, _load(name, lambda: nullcontext(rig.port), seconds, setting) as found:
            rig.begin()
            end = time.monotonic() + seconds
            while time.monotonic() < end and not rig.step():
                time.sleep(0.01)
        return rig.statistics(), found.get("rps")


def _setting(bundle: Path, scenario: Scenario, ticks: int, name: str) -> Setting:
    hmi = free_port() if name in (*PAGES, PAGE) else None
    served = None
    if name in (INTERFACES, ROS2):
        served = Interfaces(free_port(), free_port(), free_domain(), commands=name == ROS2)
    return Setting(bundle, scenario, ticks=ticks, hmi=hmi, interfaces=served, planner=name not in KINDS)


def _theirs(name: str, seconds: float) -> dict[str, float]:
    with _load(name, loads.server, seconds):
        return cyclictest(seconds)


@contextmanager
def _load(
    name: str,
    port: Callable[[], AbstractContextManager[int]],
    seconds: float,
    ours: Setting | None = None,
) -> Iterator[dict[str, Any]]:
    with ExitStack() as stack:
        if name == "stress":
            stack.enter_context(loads.stress())
        # Not beside cyclictest: what is compared is the cycle with clients and the computer without.
        if ours and ours.hmi and name in PAGES:
            stack.enter_context(PAGES[name](ours.hmi))
        if ours and (served := ours.interfaces) and name == INTERFACES:
            stack.enter_context(watching(served.foxglove, served.opcua, served.domain))
        yield (
            stack.enter_context(loads.clients(stack.enter_context(port()), seconds))
            if name == "modbus"
            else {}
        )


def _missing(names: Sequence[str]) -> str:
    """Why nothing can be measured; empty if it can."""
    if "browsers" in names and loads.browser() is None:
        return "no browser for the load browsers: install chromium"
    if shutil.which("cyclictest") is None:
        return "cyclictest is not installed (Debian: rt-tests)"
    if "stress" in names and shutil.which("stress-ng") is None:
        return "stress-ng is not installed"
    before = os.sched_getscheduler(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(1))
        os.sched_setscheduler(0, before, os.sched_param(0))
    except OSError as error:
        return f"no real-time priority: {error.strerror}"
    return ""


def _medians(blocks: Sequence[Block]) -> dict[str, Any]:
    def over(rows: Sequence[dict[str, float]]) -> dict[str, float]:
        return {key: median(row[key] for row in rows) for key in rows[0]}

    rps = [b.rps for b in blocks if b.rps is not None]
    return {
        "ours": over([b.ours for b in blocks]),
        "cyclictest": over([b.cyclictest for b in blocks]),
        "ratio_p99": median(b.ratio for b in blocks),
        "tick_ratio": median(b.tick_ratio for b in blocks),
        "tick_ratio_without_bus": median(b.tick_ratio_without_bus for b in blocks),
        "tick_us": over([b.tick for b in blocks]),
        "policy_tick_us": over([b.policy_tick for b in blocks]),
        "other_tick_us": over([b.other_tick for b in blocks]),
        "policy_step_us": over([b.policy_step for b in blocks]),
        "step_us": over([b.step for b in blocks]),
        "bus_us": over([b.bus for b in blocks]),
        "latency_us": over([b.latency for b in blocks]),
        "rehearsal_us": over([b.rehearsal for b in blocks]),
        "modbus_rps": median(rps) if rps else None,
        "stolen_ticks": sum(b.stolen for b in blocks),
        "overruns": sum(b.overruns for b in blocks),
        "ticks": sum(b.ticks for b in blocks),
        "blocks": len(blocks),
    }


def tables(figures: Mapping[str, Any]) -> Iterator[tuple[str, Sequence[str], Sequence[Sequence[object]]]]:
    """Title, columns and rows: lateness against cyclictest; work of a tick, and what was missed."""
    late = ("p50", "p99", "p999")
    yield (
        "lateness in µs, medians of the blocks",
        ["load", *(f"ours {q}" for q in late), *(f"cyclictest {q}" for q in late), "ratio p99", "requests/s"],
        [
            (
                name,
                *(f"{row['ours'][q]:.0f}" for q in late),
                *(f"{row['cyclictest'][q]:.0f}" for q in late),
                f"{row['ratio_p99']:.2f}",
                "—" if row["modbus_rps"] is None else f"{row['modbus_rps']:.0f}",
            )
            for name, row in figures.items()
        ],
    )
    yield (
        "a tick and the core's step in it, p50 in µs",
        ["load", "tick", "core's step", "bus", "tick / step", "without bus"],
        [
            (
                name,
                *(f"{row[key]['p50']:.1f}" for key in ("tick_us", "step_us", "bus_us")),
                f"{row['tick_ratio']:.1f}",
                f"{row['tick_ratio_without_bus']:.1f}",
            )
            for name, row in figures.items()
        ],
    )
    yield (
        "work of a tick in µs, and what was missed",
        ["load", *(f"{kind} {q}" for kind in WORK for q in ("p50", "p99")), "ticks", "stolen", "overruns"],
        [
            (
                name,
                *(f"{row[key][q]:.0f}" for key in WORK.values() for q in ("p50", "p99")),
                row["ticks"],
                row["stolen_ticks"],
                row["overruns"],
            )
            for name, row in figures.items()
        ],
    )
