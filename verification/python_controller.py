"""Verifies a controller written in Python: any object with `step`, called 50 times a second.

What `step` returns for the sensors of one tick is in effect from the next tick on, as with a controller that
is an FMU.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from orchestrator.run.master import Options
from orchestrator.run.simulate import seeds
from orchestrator.system.assembly import assemble
from orchestrator.system.interventions import check_changes, check_faults
from orchestrator.system.system import System
from records.record import Record
from records.schema import TIME
from specs import scenario as scenarios_spec, systems as systems_spec
from specs.errors import InputError
from specs.scenario import Scenario
from specs.version import VERSION
from verification.runs import SLOT, check_reach, plant_parameters
from verification.stepped import stepped
from verification.verify import Outcome, judge, write

COMMANDS = ("u_slew", "qd_boom_ref", "qd_stick_ref")


class Controller(Protocol):
    """What drives the machine for one run."""

    def step(self, sensors: Mapping[str, float]) -> Mapping[str, float]:
        """Commands after 0.02 s more: `u_slew` (-1 to 1), `qd_boom_ref` and `qd_stick_ref` [rad/s].

        `sensors` has, in SI and by the names of specs/signals.toml, what the system offers its controller:
        `q_slew`, `imu_cabin_rate_z` …, the target (`target_x`, `target_y`, `target_z`), `load_told`, `pace`.
        """
        ...


def verify_python(
    name: str,
    make: Callable[[], Controller],
    scenarios: Sequence[str] | None = None,
    systems: Sequence[str] = ("nominal", "reference"),
    seed: int = 1,
    out: Path = Path("out/verify"),
) -> Outcome:
    """Run a new controller `make()` in each scenario on each system, as `slewright verify` does.

    `scenarios` are names (default: all); writes metrics.json and report.html to `out`.
    """
    chosen = [s for text in (scenarios or scenarios_spec.names()) for s in scenarios_spec.find(text)]
    for s in chosen:
        check_reach(s)
    out.mkdir(parents=True, exist_ok=True)
    runs: dict[str, dict[str, Record]] = {s.name: {} for s in chosen}
    factors: dict[str, float] = {}
    for which in systems:
        system, began = assemble(systems_spec.load(which).without(SLOT)), time.perf_counter()
        for s in chosen:
            runs[s.name][which] = drive(make(), name, s, system, which, seed)
        factors[which] = sum(runs[s.name][which].time[-1] for s in chosen) / (time.perf_counter() - began)
    return write([judge(name, runs, chosen, factors)], seed, out, "verify_python")


def drive(
    controller: Controller, name: str, scenario: Scenario, system: System, which: str, seed: int = 1
) -> Record:
    """The record of one run of `system`, the system `which` without its controller (`SystemSpec.without`)."""
    check_faults(system, scenario.faults)
    values = plant_parameters(system, which, scenario.parameters(seed))
    start = system.start_values({**seeds(system, seed), **values})
    changes = check_changes(system, scenario.parameter_changes())
    options = Options(settings=system.settings, faults=scenario.faults, parameters=changes, seed=seed)
    stimuli, told = scenario.stimuli(), dict[str, float]()
    heard: list[list[float]] = []

    def answer(tick: int, sensors: Mapping[str, float]) -> Mapping[str, float]:
        told.update(stimuli.get(tick, {}))
        heard.append(list(told.values()))
        return checked(controller.step({**sensors, **told}), name)

    columns, rows = stepped(system, start, options, scenario.duration_ticks, offered(which), answer)
    meta = {
        "slewright": VERSION,
        "system": which,
        "step_s": system.step_s,
        "scenario": scenario.name,
        "controller": name,
        "targets": scenario.schedule(),
        "target_interval_s": scenario.interval_s,
        "load_kg": scenario.true_load(seed),
        "load_told_kg": scenario.load.told_kg,
    }
    return Record.from_rows([TIME, *columns, *told], np.hstack([rows, np.array(heard)]), meta)


def offered(which: str) -> set[str]:
    """The names under which a controller may read what the system `which` measures."""
    spec = systems_spec.load(which)
    return {c.target.name for c in (*spec.connections, *spec.offered) if c.target.component == SLOT}


def checked(commands: Mapping[str, float], name: str) -> dict[str, float]:
    """The three commands; InputError for a name that is none of them, or a value that is no finite number."""
    if sorted(commands) != sorted(COMMANDS):
        raise InputError(f"controller {name} returns {', '.join(commands)}; wanted: {', '.join(COMMANDS)}")
    wrong = [f"{n} = {v!r}" for n, v in commands.items() if not math.isfinite(v)]
    if wrong:
        raise InputError(f"controller {name} returns {', '.join(wrong)}, which is not finite")
    return {n: float(v) for n, v in commands.items()}
