"""One run of a campaign, in whatever process it is given to; systems that were loaded are kept."""

import functools
import math
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from records.metrics import check_limits, compute
from records.record import Record
from specs import scenario as scenarios_spec
from specs.errors import InputError, RunError
from specs.faults import Fault
from specs.scenario import Scenario
from verification.runs import plant_parameters

METRICS = ("speed", "overshoot", "overshoot_max", "error", "slew_error", "tool", "missed")
COUNTED = ("solves", "fallbacks")  # states in which a controller counts: figures of its runs
NEEDED = ("true_q_slew", "true_qd_tool_x", "true_qd_tool_y", "true_tool_x", "true_tool_y", "true_tool_z")
Task = dict[str, Any]  # key, digest, spec, ssp, record
Result = dict[str, Any]


def work(tasks: Sequence[Task]) -> list[Result]:
    """Do runs one after the other; a failure is a result too.  KeyboardInterrupt passes."""
    return [_one(task) for task in tasks]


def _one(task: Task) -> Result:
    began = time.perf_counter()
    result: Result = {
        "key": task["key"],
        "digest": task["digest"],
        "failed": "",
        "figures": {},
        "missed_limits": [],
    }
    try:
        record, result["figures"], result["missed_limits"] = _run(task)
        result["run_hash"] = record.run_hash
        if not record.complete:
            result["failed"] = record.reason
    except (RunError, InputError) as error:
        result["failed"] = str(error)
    except MemoryError:
        result["failed"] = "no memory"
    result["seconds"] = time.perf_counter() - began  # kept apart from what the content hash covers
    return result


def _run(task: Task) -> tuple[Record, dict[str, Any], list[str]]:
    spec = task["spec"]
    system = _system(task["ssp"], spec.get("step_s"))
    more = {
        "faults": [Fault(**f) for f in spec["faults"]],
        "record_path": task.get("record"),
        "seed": spec["seed"],
    }
    if "scenario" in spec:
        return _scenario(_find(spec["source"], spec["scenario"]), spec, system, more)
    names = list(spec["record"]) or None
    start_s = spec.get("start_s", system.start_s)
    if spec["stop_s"] <= start_s:
        raise InputError(
            f"stop_s = {spec['stop_s']:g}: the system starts at {start_s:g} s; start_s = S changes that"
        )
    more |= {name: spec[name] for name in ("tell_stop", "tell_tolerance") if name in spec}
    ticks = round((spec["stop_s"] - start_s) / system.step_s)
    record = simulate(
        system,
        ticks,
        parameters=spec["parameters"],
        record=names,
        trust=spec["trust"],
        start_s=start_s,
        **more,
    )
    return record, _statistics(record), []


def _scenario(
    scenario: Scenario, spec: Mapping[str, Any], system: System, more: Mapping[str, Any]
) -> tuple[Record, dict[str, Any], list[str]]:
    values = {**scenario.parameters(spec["seed"]), **spec["machine"]}
    ticks = scenario.duration_ticks
    if spec["stop_s"] is not None:
        ticks = min(ticks, round(spec["stop_s"] / system.step_s))
    counts = _counts(system)
    wanted = [*(n for n in NEEDED if n in system.outputs), *counts.values()]
    record = simulate(
        system,
        ticks,
        Stimuli({t: v for t, v in scenario.stimuli(spec.get("pace", 1.0)).items() if t <= ticks}),
        plant_parameters(system, spec["system"], values) | dict(spec["parameters"]),
        record=None if more["record_path"] else wanted,
        changes={t: v for t, v in scenario.parameter_changes().items() if t <= ticks},
        meta={
            "scenario": scenario.name,
            "controller": spec["controller"],
            "targets": scenario.schedule(),
            "target_interval_s": scenario.interval_s,
            "load_kg": scenario.true_load(spec["seed"]),
            "load_told_kg": scenario.load.told_kg,
        },
        **{**more, "faults": [*scenario.faults, *more["faults"]]},
    )
    found = compute(record)
    figures = {name: _plain(getattr(found, name)) for name in METRICS}
    figures |= {n: int(record.column(path)[-1]) for n, path in counts.items() if path in record.names}
    verdicts = []
    if ticks == scenario.duration_ticks and spec["draw"] == "nominal" and spec["fault"] == "no-fault":
        limits = scenario.limits(spec["controller"], spec["system"])
        verdicts = check_limits(found, limits, scenario.name, spec["system"])
    return record, figures, [v.metric for v in verdicts if not v.passed]


def _counts(system: System) -> dict[str, str]:
    """COUNTED -> "component.variable" in this system."""
    return {
        name: f"{owner}.state.{name}"
        for owner, component in system.components.items()
        for name in COUNTED
        if f"state.{name}" in component.model.variables
    }


def _statistics(record: Record) -> dict[str, Any]:
    figures: dict[str, Any] = {}
    for name in record.names[1:]:
        values = np.asarray(record.column(name), float)
        found = {"min": values.min(), "max": values.max(), "mean": values.mean(), "end": values[-1]}
        figures |= {f"{name} {kind}": _plain(float(value)) for kind, value in found.items()}
    return figures


def _plain(value: float) -> float | None:
    return None if isinstance(value, float) and not math.isfinite(value) else value


@functools.lru_cache(maxsize=8)
def _system(path: str, step_s: float | None = None) -> System:
    return load_system(Path(path), step_s)


@functools.cache
def _find(source: str, name: str) -> Scenario:
    return next(s for s in scenarios_spec.find(source) if s.name == name)
