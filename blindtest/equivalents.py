"""E(T): the sets of effects that the noise-free data do not tell from the visible effects T.

E(T) = sets S with lambda(S) < 5 and no more parameters than T.  All sets cannot be fitted; these are tried:

1. T itself;
2. each effect i of T swapped for one effect e with few enough parameters: all of i's family (the near
   equivalents that the contract lists) and the nearest others by linearised lambda;
3. an effect of two or more parameters swapped for two effects with no more, unless one effect did;
4. two effects of T swapped for one with no more parameters than both;
5. two swaps that each succeeded, together.

Sets with a member to spare are not listed: a set is in E(T) only if it is needed whole.
The exact identity asymmetric Coulomb = Coulomb + constant load is part of 3; the other way round is 4.
"""

import itertools
from collections.abc import Iterable, Sequence

from blindtest.case import Case
from blindtest.effects.effect import Effect, Values
from blindtest.likelihood import Fit, Problem

EQUIVALENT = 5.0
NEAREST = 4  # others, beside the family, that are fitted
HOPELESS = 400.0  # linearised lambda beyond which even a member of the family is not fitted
EXACT = {"asymmetric_coulomb_friction": ("coulomb_friction", "constant_load")}  # by the contract

FAMILIES = (
    {"input_delay", "input_lag", "sensor_delay", "sensor_lag", "clock_drift"},
    {"constant_load", "input_offset", "gravity_load", "wind_load", "slope_torque", "sensor_bias"},
    {"asymmetric_coulomb_friction", "coulomb_friction", "constant_load"},
    {"internal_leakage", "viscous_friction"},
    {"compressibility", "structural_compliance"},
    {"relief_limit", "input_saturation", "input_rate_limit"},
    {"shared_pump_flow", "supply_pressure_sag"},
    {"slope_torque", "gravity_load"},
    {"gear_backlash", "sensor_backlash", "input_backlash", "input_hysteresis"},
    {"stribeck_friction", "presliding_hysteresis", "coulomb_friction", "load_dependent_friction"},
    {"viscous_friction", "asymmetric_viscous_friction", "quadratic_drag", "wind_load"},
    {"coriolis_coupling", "euler_coupling", "centrifugal_coupling"},
    {"input_dead_zone", "valve_flow_curve", "asymmetric_gain"},
    {"stiffness", "cubic_stiffness", "gravity_load"},
)


def family(name: str) -> set[str]:
    """Names that can stand for `name`, after the contract."""
    return set().union(*(f for f in FAMILIES if name in f)) - {name}


def count(effects: Iterable[Effect]) -> int:
    """Parameters of a set."""
    return sum(len(e.parameters) for e in effects)


class Equivalents:
    """The search for E(T) of one case; `members` maps sets of names to their lambda."""

    def __init__(self, case: Case) -> None:
        self.problem: Problem = case.problem
        self.visible = case.visible
        self.truth = case.truth_fit
        self.pool = [
            e for e in case.kit.declared(case.system) if e.name not in {v.name for v in self.visible}
        ]
        self.members: dict[frozenset[str], float] = {self._names(self.visible): self.truth.value}
        self.swaps: list[tuple[int, Effect, Values]] = []

    @staticmethod
    def _names(effects: Iterable[Effect]) -> frozenset[str]:
        return frozenset(e.name for e in effects)

    def search(self) -> dict[frozenset[str], float]:
        """All members that were found, T first."""
        for i in range(len(self.visible)):
            kept, at = self._without(i)
            if not self._single(i, kept, at):
                self._pair(i, kept, at)
        for i, j in itertools.combinations(range(len(self.visible)), 2):
            self._merge(i, j)
        self._double()
        return self.members

    def _without(self, *gone: int) -> tuple[tuple[Effect, ...], Fit]:
        """T without some effects, and its fit."""
        kept = [k for k in range(len(self.visible)) if k not in gone]
        effects = tuple(self.visible[k] for k in kept)
        values = tuple(self.truth.effects[k] for k in kept)
        start = Fit(float("inf"), self.truth.base, values, self.truth.starts)
        return effects, self.problem.fit(effects, start)

    def _best(self, kept: Sequence[Effect], at: Fit, effect: Effect) -> Fit:
        return self.problem.best(kept, at, effect, EQUIVALENT)

    def _keep(self, effects: Sequence[Effect], fit: Fit) -> bool:
        if fit.value >= EQUIVALENT:
            return False
        names = self._names(effects)
        self.members[names] = min(fit.value, self.members.get(names, float("inf")))
        return True

    def _ranked(self, kept: Sequence[Effect], at: Fit, most: int) -> list[tuple[float, Effect]]:
        """Effects of the pool with at most `most` parameters by linearised lambda."""
        names = self._names(kept)
        fitting = [e for e in self.pool if len(e.parameters) <= most and e.name not in names]
        found = [(self.problem.promise(kept, at, e), e) for e in fitting]
        return sorted(found, key=lambda pair: pair[0])

    def _single(self, i: int, kept: Sequence[Effect], at: Fit) -> bool:
        """Swap i for one effect; whether that succeeded once."""
        gone, hit = self.visible[i], False
        near = family(gone.name)
        ranked = self._ranked(kept, at, len(gone.parameters))
        for place, (linear, effect) in enumerate(ranked):
            if linear > HOPELESS + 0.3 * at.value or (place >= NEAREST and effect.name not in near):
                continue
            fit = self._best(kept, at, effect)
            if self._keep((*kept, effect), fit):
                self.swaps.append((i, effect, fit.effects[-1]))
                hit = True
        return hit

    def _pair(self, i: int, kept: Sequence[Effect], at: Fit) -> None:
        """Swap i for two effects that have no more parameters."""
        most = len(self.visible[i].parameters)
        for _, first in self._ranked(kept, at, most - 1)[:2]:
            fit = self._best(kept, at, first)
            if not fit.effects:  # it does not run from any start
                continue
            for _, second in self._ranked((*kept, first), fit, most - len(first.parameters))[:2]:
                self._keep((*kept, first, second), self._best((*kept, first), fit, second))
        self._identity(self.visible[i], kept, at)

    def _identity(self, gone: Effect, kept: Sequence[Effect], at: Fit) -> None:
        """The two effects that are the same as `gone`, if there are such on its axis."""
        here = {e.name: e for e in self.pool if e.subsystem == gone.subsystem}
        pair = [here[name] for name in EXACT.get(gone.name, ()) if name in here]
        if len(pair) == 2 and self._names((*kept, *pair)) not in self.members:
            fit = self._best(kept, at, pair[0])
            if fit.effects:
                self._keep((*kept, *pair), self._best((*kept, pair[0]), fit, pair[1]))

    def _merge(self, i: int, j: int) -> None:
        """Swap i and j for one effect."""
        kept, at = self._without(i, j)
        most = count((self.visible[i], self.visible[j]))
        for linear, effect in self._ranked(kept, at, most)[:3]:
            if linear < HOPELESS + 0.3 * at.value:
                self._keep((*kept, effect), self._best(kept, at, effect))

    def _double(self) -> None:
        """Two swaps that each succeeded, together."""
        for (i, e, p), (j, f, q) in itertools.combinations(self.swaps, 2):
            if i != j and e.name != f.name:
                kept, at = self._without(i, j)
                start = Fit(float("inf"), at.base, (*at.effects, p, q), at.starts)
                self._keep((*kept, e, f), self.problem.fit((*kept, e, f), start, EQUIVALENT))


def equivalents(case: Case) -> list[list[str]]:
    """E(T) as sorted lists of names, T first, then by lambda."""
    found = Equivalents(case).search()
    truth = frozenset(e.name for e in case.visible)
    ordered = sorted(found, key=lambda names: (names != truth, found[names], sorted(names)))
    return [sorted(names) for names in ordered]
