"""Scenarios: the targets, loads and limits of a verification run (`specs/scenarios/*.toml`).

A scenario is a target file and one of its loads: `four_targets_2t` is four_targets.toml with load 2t.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar

from specs import keys, limits
from specs.errors import InputError, nearest
from specs.faults import Change, Fault, by_tick, read_changes, read_faults
from specs.schema import ROOT, STRICT, read_toml, validate

FOLDER = ROOT / "scenarios"
TICK_S = 0.02  # s, the step of every system
SLEW_STEP_DEG = (45.0, 135.0)  # between consecutive targets, so that the metric speed is comparable
KEEP_OUT_M = 2.0  # the grab never goes lower, nor nearer to the slew axis


@dataclass(frozen=True, kw_only=True)
class Target:
    """Where the grab point is to go: slew angle [deg], radius and height above the ground [m]."""

    __pydantic_config__: ClassVar[Any] = STRICT

    slew_deg: float
    radius_m: float
    height_m: float

    def __post_init__(self) -> None:
        for key in ("radius_m", "height_m"):
            if getattr(self, key) < KEEP_OUT_M:
                raise InputError(f"{key} = {getattr(self, key):g}: keep-out, at least {KEEP_OUT_M:g} m")

    @property
    def xyz(self) -> tuple[float, float, float]:
        """The point in the machine's base frame [m]: x forward at slew angle 0, y left, z up.

        Rounded to 1 nm, so that it does not depend on the platform's cosine.
        """
        slew = math.radians(self.slew_deg)
        x, y = self.radius_m * math.cos(slew), self.radius_m * math.sin(slew)
        return round(x, 9), round(y, 9), self.height_m


@dataclass(frozen=True, kw_only=True)
class Start:
    """The pose a run starts from, at rest with the tool hanging: slew angle [deg], joint angles [rad]."""

    __pydantic_config__: ClassVar[Any] = STRICT

    slew_deg: float
    q_boom: float
    q_stick: float


@dataclass(frozen=True, kw_only=True)
class Load:
    """The load in the grab, drawn uniformly from low_kg … high_kg, and what the controller is told [kg]."""

    __pydantic_config__: ClassVar[Any] = STRICT

    name: str
    description: str
    low_kg: float
    high_kg: float
    told_kg: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.low_kg <= self.high_kg:
            raise InputError(f"low_kg = {self.low_kg:g}, high_kg = {self.high_kg:g}: need 0 <= low <= high")
        if self.told_kg < 0.0:
            raise InputError(f"told_kg = {self.told_kg:g}: must not be negative")


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """One verification run; build it with `load(name)`."""

    __pydantic_config__: ClassVar[Any] = STRICT

    base: str  # the target file, e.g. four_targets
    description: str
    interval_s: float
    start: Start
    targets: tuple[Target, ...]
    load: Load
    tolerances_m: tuple[float, ...] = ()
    faults: tuple[Fault, ...] = ()
    changes: tuple[Change, ...] = ()

    def __post_init__(self) -> None:
        if not self.targets:
            raise InputError("targets: at least one")
        if abs(self.interval_s / TICK_S - self.interval_ticks) > 1e-9 or self.interval_ticks < 1:
            raise InputError(f"interval_s = {self.interval_s:g}: not a multiple of {TICK_S:g} s")
        self._check_slews()
        self._check_times()

    def _check_slews(self) -> None:
        slews = [self.start.slew_deg, *(target.slew_deg for target in self.targets)]
        low, high = SLEW_STEP_DEG
        for number, (a, b) in enumerate(pairwise(slews), 1):
            if not low <= abs(b - a) <= high:
                raise InputError(
                    f"targets.{number}: {abs(b - a):g}° from the one before, not {low:g}–{high:g}°"
                )

    def _check_times(self) -> None:
        """Whole ticks, and before the end: what never happens is a mistake."""
        end_s = self.duration_ticks * TICK_S
        for group, key in (("faults", "start_s"), ("changes", "at_s")):
            for number, entry in enumerate(getattr(self, group), 1):
                try:
                    entry.ticks(TICK_S)
                except InputError as error:
                    raise InputError(f"{group}.{number}: {error}") from error
                if (time_s := getattr(entry, key)) >= end_s:
                    raise InputError(f"{group}.{number}: {key} = {time_s:g}: the run ends at {end_s:g} s")

    @property
    def name(self) -> str:
        """Full name, e.g. four_targets_2t."""
        return f"{self.base}_{self.load.name}"

    @property
    def interval_ticks(self) -> int:
        """Ticks of 0.02 s for which a target holds."""
        return round(self.interval_s / TICK_S)

    @property
    def duration_ticks(self) -> int:
        """Ticks of the whole run."""
        return self.interval_ticks * len(self.targets)

    def true_load(self, seed: int) -> float:
        """The load in the grab [kg] of the run with this seed."""
        share = keys.uniform("load", self.base, self.load.name, seed)
        return self.load.low_kg + share * (self.load.high_kg - self.load.low_kg)

    def parameters(self, seed: int) -> dict[str, float]:
        """Parameters (SI) that the run's models are to have, where they have them: load and start pose."""
        return {
            "load_mass": self.true_load(seed),
            "start_q_slew": math.radians(self.start.slew_deg),
            "start_q_boom": self.start.q_boom,
            "start_q_stick": self.start.q_stick,
        }

    def stimuli(self, pace: float = 1.0) -> dict[int, dict[str, float]]:
        """Changes of the system inputs: tick -> {input: value in SI}, each held until its next change."""
        changes: dict[int, dict[str, float]] = {
            i * self.interval_ticks: dict(zip(("target_x", "target_y", "target_z"), target.xyz, strict=True))
            for i, target in enumerate(self.targets)
        }
        changes[0] |= {"load_told": self.load.told_kg, "pace": pace}
        return changes

    def parameter_changes(self) -> dict[int, dict[str, float | bool | str]]:
        """Parameters that change during the run: tick -> {"component.parameter": value}."""
        return by_tick(self.changes, TICK_S)

    def schedule(self) -> list[dict[str, float]]:
        """The targets as a record's metadata lists them: time [s] and x, y, z [m] of each."""
        return [
            {"time": i * self.interval_s, **dict(zip("xyz", target.xyz, strict=True))}
            for i, target in enumerate(self.targets)
        ]

    def limits(self, controller: str, system: str) -> dict[str, dict[str, Any]]:
        """Acceptance limits: metric -> {"min" and/or "max": number, "reason": text}; {} if none are set.

        A user's own scenario has only those that do not differ from scenario to scenario.
        """
        known = limits.load(controller, system)
        own = self.name not in names()
        return {m: limit.on(self.name) for m, limit in known.items() if limit.universal or not own}


def names() -> list[str]:
    """All scenarios: every target file with each of its loads."""
    return [f"{base}_{name}" for base in bases() for name in _data(base).get("loads", {})]


def bases() -> list[str]:
    """Names of the target files, those with fewer targets first."""
    found = [path.stem for path in FOLDER.glob("*.toml") if path != limits.PATH]
    return sorted(found, key=lambda base: (len(_data(base).get("targets", ())), base))


def load(name: str) -> Scenario:
    """Return the scenario `name`; raises InputError naming the valid ones, or file and key of a mistake."""
    for base in bases():
        loads = _data(base).get("loads", {})
        if name.startswith(f"{base}_") and name.removeprefix(f"{base}_") in loads:
            return build(base, name.removeprefix(f"{base}_"), _data(base), f"specs/scenarios/{base}.toml")
    valid = f"valid: {', '.join(names())}"
    hint = nearest(name, names())
    raise InputError(f"unknown scenario '{name}'; " + (f"{hint} {valid}" if hint.endswith("?") else valid))


def find(text: str) -> list[Scenario]:
    """Scenarios as a user names them: one by its name, or all loads of a target file (path ending in .toml).

    Raises InputError for an unknown name, a missing file, or a mistake in it.
    """
    if not text.endswith(".toml"):
        return [load(text)]
    path = Path(text)
    data = read_toml(path)
    if not isinstance(data.get("loads"), dict) or not data["loads"]:
        raise InputError(f"{path}: needs at least one load, as in [loads.empty]")
    return [build(path.stem, name, data, str(path)) for name in data["loads"]]


def build(base: str, load_name: str, data: Mapping[str, Any], where: str) -> Scenario:
    """Turn the content of a target file into a Scenario; every mistake names `where` and the key."""
    rest = {key: value for key, value in data.items() if key != "loads"}
    loads = {"name": load_name, **data["loads"][load_name]}
    parts: dict[str, Any] = {"load": validate(Load, loads, f"{where}: loads.{load_name}")}
    if "start" in rest:
        parts["start"] = validate(Start, rest["start"], f"{where}: start")
    if isinstance(rest.get("targets"), list):
        parts["targets"] = tuple(
            validate(Target, entry, f"{where}: targets.{i}") for i, entry in enumerate(rest["targets"], 1)
        )
    if "faults" in rest:
        parts["faults"] = read_faults(rest["faults"], f"{where}: faults")
    if "changes" in rest:
        parts["changes"] = read_changes(rest["changes"], f"{where}: changes")
    return validate(Scenario, {"base": base, **rest, **parts}, where)


@cache
def _data(base: str) -> dict[str, Any]:
    return read_toml(FOLDER / f"{base}.toml")
