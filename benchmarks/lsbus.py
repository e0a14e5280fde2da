"""The reference machine under the virtual controller, over the bus FMU and by plain signals."""

import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from deployment.bundling.build import bundle
from deployment.network import nodes, system
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.stimuli import Stimuli
from records.record import Record
from specs import scenario
from specs.scenario import TICK_S, Scenario

SCENARIO, SEED = "five_targets_2t", 5
TRUE = ("true_q_slew", "true_q_boom", "true_q_stick", "true_tool_x", "true_tool_y", "p_pump")
AUTOMATIC = 3.0  # control_mode
COUNTED = ("bus.frames", "bus.load", "bus.longest_wait")
LEAST_SPEED = 20.0  # times real time


def measure(duration_s: float, controller: str) -> dict[str, Any]:
    """Runs of `duration_s` simulated seconds: twice over the bus, once by plain signals."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        made = bundle(controller, folder / "bundle")
        over, plain = folder / "over.ssp", folder / "plain.ssp"
        system.over_the_bus(made, over)
        system.by_plain_signals(made, plain)
        found, seconds = _run(over, duration_s, COUNTED)
        again, _ = _run(over, duration_s, COUNTED)
        beside, plain_seconds = _run(plain, duration_s, ())
    frames, load, wait = (float(found.column(name)[-1]) for name in COUNTED)
    return {
        "simulated_s": duration_s,
        "controller": controller,
        "times_real_time": duration_s / seconds,
        "over_plain": seconds / plain_seconds,
        "replayed": all(np.array_equal(found.column(n), again.column(n)) for n in found.names),
        "equal": all(np.array_equal(found.column(n), beside.column(n)) for n in TRUE),
        "automatic": float(np.mean(found.column("control_mode") == AUTOMATIC)),
        "frames": int(frames),
        "load": load,
        "longest_wait_s": wait,
        "cycle_phase_s": nodes.CYCLE_PHASE_S,
        "step_s": system.STEP_S,
    }


def missed(figures: Mapping[str, Any]) -> list[str]:
    """What is not as it must be."""
    found = []
    if figures["times_real_time"] < LEAST_SPEED:
        found.append(f"{figures['times_real_time']:.1f} × real time, must be at least {LEAST_SPEED:g}")
    for name, words in (("replayed", "a second run gives another record"), ("equal", "the machine differs")):
        if not figures[name]:
            found.append(words)
    return found


def _run(path: Path, duration_s: float, counted: tuple[str, ...]) -> tuple[Record, float]:
    chosen, loaded = scenario.load(SCENARIO), load_system(path)
    changes = _targets(chosen, duration_s, round(TICK_S / loaded.step_s))
    parameters = {f"machine.{name}": value for name, value in chosen.parameters(SEED).items()}
    parameters = {n: v for n, v in parameters.items() if n.partition(".")[2] in _known(loaded)}
    if not counted:
        parameters["controller.plain"] = 1.0
    ticks = round(duration_s / loaded.step_s)
    began = time.perf_counter()
    record = simulate(
        loaded, ticks, Stimuli(changes), parameters, seed=SEED, record=["control_mode", *TRUE, *counted]
    )
    return record, time.perf_counter() - began


def _known(loaded: Any) -> set[str]:
    return set(loaded.components["machine"].model.variables)


def _targets(chosen: Scenario, duration_s: float, every: int) -> dict[int, Mapping[str, float]]:
    """The scenario's targets, again and again."""
    found: dict[int, Mapping[str, float]] = {}
    for begin in range(0, round(duration_s / TICK_S), chosen.duration_ticks):
        for tick, values in chosen.stimuli().items():
            found[(begin + tick) * every] = values
    return {tick: values for tick, values in found.items() if tick < round(duration_s / TICK_S) * every}
