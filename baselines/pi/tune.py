"""`slewright tune pi`: gains of the PI controller and of the arm velocity loop it works through.

1. python-control: the arm velocity loop on the linearised reference machine, the arm's position loop on the
   nominal arm and a cautious slew gain on the nominal drive, each as fast as its margins allow.
2. Simulation on re-drawn machines of the tuning set (FMUs of the CasADi models), over slew gain, reset rate,
   joystick limit and arm gain: a coarse grid, then Nelder-Mead from its best point; see objective.py.
3. Both results on machines of the validation set; the better one is kept, its margins are stated.

Deterministic: all draws and noise follow from keys and seeds.  Every evaluation is kept in
build/tune/pi.json, so that an interrupted search goes on where it was.
"""

import hashlib
import itertools
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

from baselines import analysis
from baselines.parameter_file import update
from baselines.pi import objective
from fmus.toolchain.build import BUILD
from orchestrator.system.system import System
from specs import parameters
from specs.errors import RunError
from specs.progress import Report

DRAWS = 8  # machines of the tuning set, and as many of the validation set
EVALUATIONS = 80
INERTIAS = (250e3, 400e3, 900e3)  # kg m2, of the margins
SLEW_PHASE_DEG, ARM_PHASE_DEG, RATE_PHASE_DEG = 30.0, 60.0, 45.0
GAIN_DB = 8.0
NAMES: tuple[str, ...] = ("pi_slew_gain", "pi_slew_reset_rate", "pi_slew_limit", "pi_arm_gain")
LOW, HIGH = np.array([0.2, 0.0, 0.3, 0.4]), np.array([4.0, 0.5, 1.0, 2.0])
GRID = tuple(itertools.product((0.5, 1.0, 2.0, 3.5), (0.35, 0.5, 0.7)))  # slew gain, joystick limit
CACHE = BUILD / "tune" / "pi.json"


def run(report: Report | None = None, evaluations: int = EVALUATIONS, draws: int = DRAWS) -> dict[str, Any]:
    """Tune, write specs/parameters/{pi,arm_velocity}.toml, and return gains, costs and margins."""
    say = report or (lambda what, done, total: None)
    total = evaluations + 4
    say("margins of the arm velocity loop", 0, total)
    rate = design_rate_loop()
    _write_rate_loop(rate)
    say("margins of the position loops", 1, total)
    start = design_position_loops()
    system = objective.reference_system()
    found = search(system, start, evaluations, draws, lambda n: say("search on tuning draws", 2 + n, total))
    say("validation draws", total - 1, total)
    kept, costs = keep_better(system, {"margins": start, "search": found}, draws)
    margins = {name: str(m) for name, m in slew_margins(kept).items()} | _arm_margins(kept)
    _write_pi(kept, costs, margins, evaluations, draws)
    say("done", total, total)
    return {
        "gains": kept,
        "by_margins": start,
        "by_search": found,
        "validation_cost": costs,
        "margins": margins,
        "arm_velocity": rate,
        "seed": objective.SEED,
    }


def design_rate_loop() -> dict[str, Any]:
    """Largest integral gain of the arm velocity PI with the margins asked for at all operating points."""
    plants = [
        analysis.joint_plant(joint, joystick, load=load)
        for joint in ("boom", "stick")
        for joystick in (0.3, 0.45, 0.7, -0.3, -0.45, -0.7)
        for load in (0.0, 2000.0)
    ]
    found: list[dict[str, Any]] = []
    for gain in (0.05, 0.1, 0.2, 0.3):
        for integral in np.arange(1.0, 3.01, 0.2):
            least = _least([analysis.pi_margins(plant, gain, integral / gain) for plant in plants])
            if least["gain_db"] >= GAIN_DB and least["phase_deg"] >= RATE_PHASE_DEG:
                ratio = float(integral / gain)
                found.append({"gain": gain, "reset_rate": ratio, "integral": float(integral), **least})
    if not found:
        raise RunError(f"no gain of the arm velocity loop has {GAIN_DB:g} dB and {RATE_PHASE_DEG:g} deg")
    return max(found, key=lambda f: (round(f["integral"], 6), f["phase_deg"]))


def design_position_loops() -> dict[str, float]:
    """Slew and arm gain by their margins; reset rate and joystick limit where the search is to start."""
    plants = [analysis.slew_plant(inertia) for inertia in INERTIAS]
    reset_rate = 0.02
    slew = [k for k in np.arange(0.2, 3.0, 0.05) if _phase(plants, k, reset_rate) >= SLEW_PHASE_DEG]
    arm = [k for k in np.arange(0.4, 2.0, 0.05) if _arm_phase(k) >= ARM_PHASE_DEG]
    values = (max(slew, default=0.2), reset_rate, 0.6, max(arm))
    return {name: round(float(value), 3) for name, value in zip(NAMES, values, strict=True)}


def search(
    system: System, start: Mapping[str, float], evaluations: int, draws: int, say: Callable[[int], None]
) -> dict[str, float]:
    """Coarse grid and Nelder-Mead on the tuning draws, `evaluations` costs in all; the best point seen."""
    runs = objective.trials("tuning", draws)
    cache = _Cache(CACHE, system, draws)

    def evaluate(x: np.ndarray) -> float:
        gains = from_cube(x)
        say(cache.used)
        return cache.get(gains, lambda: objective.cost(system, gains, runs))

    corners = [{**start, "pi_slew_gain": gain, "pi_slew_limit": limit} for gain, limit in GRID]
    grid = [to_cube(np.array([point[name] for name in NAMES])) for point in (start, *corners)]
    middle = min(grid[:evaluations], key=evaluate)
    simplex = np.clip(np.vstack([middle, *(middle + step for step in np.diag([0.1, 0.1, -0.1, -0.1]))]), 0, 1)
    left = max(evaluations - len(grid), 1)
    options = {"initial_simplex": simplex, "maxfev": left, "xatol": 1e-3, "fatol": 1e-4}
    minimize(evaluate, middle, method="Nelder-Mead", bounds=[(0, 1)] * len(NAMES), options=options)
    return cache.best()


def keep_better(
    system: System, candidates: Mapping[str, dict[str, float]], draws: int
) -> tuple[dict[str, float], dict[str, float]]:
    """The candidate with the least cost on the validation draws, and the cost of each."""
    runs = objective.trials("validation", draws)
    costs = {name: objective.cost(system, gains, runs) for name, gains in candidates.items()}
    return candidates[min(costs, key=lambda name: costs[name])], costs


def slew_margins(gains: Mapping[str, float]) -> dict[str, analysis.Margins]:
    """Margins of the slew loop by operating point."""
    plants = [analysis.slew_plant(inertia) for inertia in INERTIAS]
    return {
        plant.point: analysis.pi_margins(plant, gains["pi_slew_gain"], gains["pi_slew_reset_rate"])
        for plant in plants
    }


class _Cache:
    """Evaluations by gains, kept on disk for exactly these FMUs, draws and equations of the cost."""

    def __init__(self, path: Path, system: System, draws: int) -> None:
        self.path, self.used = path, 0
        self.seen: dict[str, float] = {}
        parts = [component.sha256 for component in system.components.values()]
        parts += [
            Path(objective.__file__).read_text(encoding="utf-8"),
            repr(objective.trials("tuning", draws)),
        ]
        self.key = hashlib.sha256("\n".join(parts).encode()).hexdigest()
        kept = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        self.known: dict[str, float] = kept.get("costs", {}) if kept.get("key") == self.key else {}

    def get(self, gains: Mapping[str, float], compute: Callable[[], float]) -> float:
        """Cost of `gains`, computed if it is not known yet."""
        name = json.dumps(gains)
        if name not in self.known:
            self.known[name] = compute()
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.write_text(
                json.dumps({"key": self.key, "costs": self.known}, indent=1), encoding="utf-8"
            )
        self.used += 1
        self.seen[name] = self.known[name]
        return self.known[name]

    def best(self) -> dict[str, float]:
        """The gains with the least cost among those asked for."""
        return json.loads(min(self.seen, key=lambda name: self.seen[name]))


def from_cube(x: np.ndarray) -> dict[str, float]:
    """Gains at a point of the unit cube: gains on a logarithmic scale, the others on a linear one."""
    linear = LOW + x * (HIGH - LOW)
    power = LOW * (HIGH / np.where(LOW > 0, LOW, 1.0)) ** x
    values = np.where([name.endswith("gain") for name in NAMES], power, linear)
    return {name: float(f"{value:.3g}") for name, value in zip(NAMES, values, strict=True)}


def to_cube(values: np.ndarray) -> np.ndarray:
    linear = (values - LOW) / (HIGH - LOW)
    logarithmic = np.log(values / np.where(LOW > 0, LOW, 1.0)) / np.log(HIGH / np.where(LOW > 0, LOW, 0.1))
    return np.where([name.endswith("gain") for name in NAMES], logarithmic, linear)


def _least(margins: list[analysis.Margins]) -> dict[str, float]:
    return {
        "gain_db": min(m.gain_db for m in margins),
        "phase_deg": min(m.phase_deg for m in margins),
        "delay_s": min(m.delay_s for m in margins),
    }


def _phase(plants: list[analysis.Plant], gain: float, reset_rate: float) -> float:
    return min(analysis.pi_margins(plant, gain, reset_rate).phase_deg for plant in plants)


def _arm_phase(gain: float) -> float:
    values = {name: p.value for name, p in parameters.load("arm").items()}
    return min(analysis.arm_margins(gain, values, joint).phase_deg for joint in ("boom", "stick"))


def _arm_margins(gains: Mapping[str, float]) -> dict[str, str]:
    values = {name: p.value for name, p in parameters.load("arm").items()}
    return {j: str(analysis.arm_margins(gains["pi_arm_gain"], values, j)) for j in ("boom", "stick")}


def _write_rate_loop(rate: Mapping[str, float]) -> None:
    how = (
        f"slewright tune pi: largest integral gain with {GAIN_DB:g} dB and {RATE_PHASE_DEG:g} deg or more on "
        f"24 linearisations of the machine; reached {rate['gain_db']:.1f} dB, {rate['phase_deg']:.0f} deg, "
        f"delay margin {rate['delay_s']:.2f} s"
    )
    found = {"arm_velocity_gain": rate["gain"], "arm_velocity_reset_rate": rate["reset_rate"]}
    update("arm_velocity", found, how)


def _write_pi(
    gains: Mapping[str, float],
    costs: Mapping[str, float],
    margins: Mapping[str, str],
    evaluations: int,
    draws: int,
) -> None:
    how = (
        f"slewright tune pi, seed {objective.SEED}: at most {evaluations} evaluations of the time-weighted "
        f"error on {draws} tuning draws; on {draws} validation draws {costs['search']:.3f}, "
        f"by margins alone {costs['margins']:.3f}"
    )
    slew = f"; slew loop at I = 400 t m2, u = 0.5: {margins['I = 400 t m2, u = 0.5']}"
    update("pi", {name: gains[name] for name in NAMES if "slew" in name}, how + slew)
    update("pi", {"pi_arm_gain": gains["pi_arm_gain"]}, f"{how}; boom loop: {margins['boom']}")
