"""Acceptance limits per controller and system: `specs/scenarios/limits.toml`, one row a metric."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

from specs.errors import InputError, nearest
from specs.schema import ROOT, STRICT, read_toml, shown_path, validate

PATH = ROOT / "scenarios" / "limits.toml"
METRICS = (
    "speed",
    "overshoot",
    "overshoot_max",
    "error",
    "slew_error",
    "tool",
    "missed",
    "within_1m",
    "within_2m",
)


@dataclass(frozen=True, kw_only=True)
class Limit:
    """Bounds of one metric, each one number or one for each scenario, and why they are what they are."""

    __pydantic_config__: ClassVar[Any] = STRICT

    reason: str
    min: float | dict[str, float] | None = None
    max: float | dict[str, float] | None = None

    def __post_init__(self) -> None:
        if not self.reason.strip():
            raise InputError("empty reason")
        if self.min is None and self.max is None:
            raise InputError("needs min or max")

    @property
    def universal(self) -> bool:
        """Whether the bounds are the same for every scenario."""
        return not isinstance(self.min, dict) and not isinstance(self.max, dict)

    def on(self, scenario: str) -> dict[str, Any]:
        """The limit on one scenario, as a plain mapping; raises InputError if it leaves that one out."""
        found: dict[str, Any] = {"reason": self.reason}
        for side, bound in (("min", self.min), ("max", self.max)):
            if isinstance(bound, dict) and scenario not in bound:
                why = f"a {side} names no number for {scenario} ({self.reason})"
                raise InputError(f"{shown_path(PATH)}: {why}")
            if bound is not None:
                found[side] = bound[scenario] if isinstance(bound, dict) else bound
        return found


def load(controller: str, system: str) -> dict[str, Limit]:
    """Limits by metric of a controller on a system; {} if none are set."""
    return _all(PATH).get((controller, system), {})


def pairs() -> list[tuple[str, str]]:
    """(controller, system) for which limits are set."""
    return list(_all(PATH))


@cache
def _all(path: Path) -> dict[tuple[str, str], dict[str, Limit]]:
    found: dict[tuple[str, str], dict[str, Limit]] = {}
    for controller, systems in read_toml(path).items():
        for system, rows in systems.items():
            where = f"{shown_path(path)}: {controller}.{system}"
            found[controller, system] = {metric: _limit(metric, row, where) for metric, row in rows.items()}
    return found


def _limit(metric: str, row: Any, where: str) -> Limit:
    if metric not in METRICS:
        raise InputError(f"{where}: no metric '{metric}'; {nearest(metric, METRICS)}")
    return validate(Limit, row, f"{where}.{metric}")
