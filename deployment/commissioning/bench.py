"""What a step works with: the rig, the operator, figures, and checks that end in a verdict.

A check has what was measured, what was expected and where to look when it is not so.  `Failed` ends a step:
by a check at its end (`verdict`), or at once where going on would move the machine on wrong information.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from types import SimpleNamespace
from typing import Any

from deployment.commissioning.operator import Kind, Operator, Question
from deployment.commissioning.points import Point
from deployment.commissioning.rig import STILL, Rig, Trace
from fmus.equations import kinematics
from runtime.image import TICK_S
from specs import parameters


class Failed(Exception):
    """A step's check failed; the step is over."""


@dataclass(frozen=True)
class Check:
    """One thing that was looked at; numbers in `unit`, limits inclusive."""

    name: str
    measured: Any
    expected: str
    passed: bool
    unit: str = ""
    look: str = ""  # at what, if it failed

    def __str__(self) -> str:
        number = f"{self.measured:.4g}" if isinstance(self.measured, float) else str(self.measured)
        measured = f"{number} {self.unit}".strip()
        if self.measured is None or number == "nan":  # as which a record has it
            measured = "nothing that is a number"
        said = f"{self.name}: measured {measured}, expected {self.expected}"
        return said if self.passed or not self.look else f"{said}; look at: {self.look}"


@cache
def figures() -> SimpleNamespace:
    """Values of specs/parameters/commissioning.toml, and of the machine's files that checks refer to."""
    known = parameters.load("commissioning", "geometry", "slew", "machine", "gate")
    return SimpleNamespace(**{name: p.value for name, p in known.items()})


@dataclass
class Bench:
    """One step at work; `found` are its results, `before` those of the steps that passed before."""

    rig: Rig
    operator: Operator
    before: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    checks: list[Check] = field(default_factory=list)
    found: dict[str, Any] = field(default_factory=dict)
    said: list[dict[str, str]] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)  # name -> text, for the session's folder
    points: tuple[Point, ...] = ()  # known ones that are to be touched; none: the operator is asked
    begun: int = 0

    def __post_init__(self) -> None:
        self.begun = self.rig.tick
        self.f = figures()

    # ---- checks ----

    def between(
        self, name: str, measured: float, low: float, high: float, unit: str = "", look: str = ""
    ) -> bool:
        """A number within limits; NaN is not."""
        expected = f"{low:.4g} … {high:.4g}" if math.isfinite(low + high) else _one_sided(low, high)
        return self._add(Check(name, float(measured), expected, bool(low <= measured <= high), unit, look))

    def equal(self, name: str, measured: Any, expected: Any, look: str = "") -> bool:
        """Something that is what it should be."""
        return self._add(Check(name, measured, str(expected), bool(measured == expected), "", look))

    def _add(self, check: Check) -> bool:
        self.checks.append(check)
        return check.passed

    def verdict(self) -> None:
        """Failed if any check did."""
        if any(not c.passed for c in self.checks):
            raise Failed

    def fail(self, name: str, measured: Any, expected: str, look: str = "", unit: str = "") -> None:
        """A check that failed, and the end of the step."""
        self._add(Check(name, measured, expected, False, unit, look))
        raise Failed

    # ---- operator ----

    def do(self, key: str, text: str) -> None:
        """Have something done; the cycle goes on meanwhile."""
        self._ask(Question(Kind.DO, key, text))

    def seen(self, key: str, text: str) -> bool:
        """What the operator saw."""
        return self._ask(Question(Kind.WITNESS, key, text)) == "yes"

    def number(self, key: str, text: str, unit: str) -> float:
        """What the operator measured."""
        return float(self._ask(Question(Kind.NUMBER, key, text, unit)))

    def _ask(self, question: Question) -> str:
        answering = self.operator.answer(question)
        while True:
            try:
                next(answering)
            except StopIteration as end:
                self.said.append({"asked": question.text, "answered": end.value})
                return str(end.value)
            self.rig.step()

    # ---- time ----

    def wait(self, seconds: float) -> Trace:
        """Let time pass; what was seen meanwhile."""
        begin = self.rig.tick
        self.rig.step(max(1, round(seconds / TICK_S)))
        return self.rig.since(begin)

    def until(self, what: Any, seconds: float) -> bool:
        """Let time pass until `what()` holds; False if it never does."""
        for _ in range(round(seconds / TICK_S)):
            if what():
                return True
            self.rig.step()
        return bool(what())

    def neutral(self) -> None:
        """Neutral commands, nobody watching: whatever ended, the machine comes to rest."""
        self.rig.watch, self.rig.wanted = None, STILL

    def as_dict(self) -> dict[str, Any]:
        """Checks, results and answers for the record."""
        return {"checks": [asdict(c) for c in self.checks], "found": self.found, "operator": self.said}


def hanging_height(q_boom: float, q_stick: float) -> float:
    """Height of the hanging grab point above the ground, m."""
    g = kinematics.geometry()
    return float(kinematics.arm_tip(q_boom, q_stick, g)[1] - g.tool_length)


def _one_sided(low: float, high: float) -> str:
    return f"at most {high:.4g}" if math.isfinite(high) else f"at least {low:.4g}"
