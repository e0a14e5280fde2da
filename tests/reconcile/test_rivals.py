"""Rivals of an answer: which sets are tried in its place."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, cast

from reconcile.rivals import PAIRS, Rivals


@dataclass(frozen=True)
class Named:
    """An effect by name with its free parameters."""

    key: str
    free: tuple[str, ...]


@dataclass
class Scores:
    """Pairs of effects, the best first."""

    pairs: list[tuple[Named, Named]] = field(default_factory=list)

    def best(self, count: int, size: int) -> list[Any]:
        assert size == 2
        sets = [SimpleNamespace(variants=[SimpleNamespace(attached=a) for a in pair]) for pair in self.pairs]
        return sets[:count]


WIND = Named("wind", ("a_x", "a_y"))
LOADS = Named("load@roll", ("load",)), Named("load@pitch", ("load",))
STRIBECK = Named("stribeck", ("Fc", "Fs", "vs"))


def pairs(gone: tuple[Named, ...], *listed: tuple[Named, Named]) -> list[set[str]]:
    found = Rivals(cast(Any, None))._pairs(cast(Any, Scores([*listed])), cast(Any, gone))
    return [{v.attached.key for v in scored.variants} for scored in found]


def test_an_effect_of_two_parameters_has_two_of_one_as_rivals_but_no_more_parameters():
    assert pairs((WIND,), (LOADS[0], STRIBECK), LOADS) == [{"load@roll", "load@pitch"}]


def test_an_effect_of_one_parameter_has_no_pairs_as_rivals():
    assert pairs((LOADS[0],), LOADS) == []


def test_two_effects_are_not_exchanged_for_two_others_at_once():
    assert pairs(LOADS, (WIND, LOADS[0])) == []


def test_few_pairs_are_tried():
    many = [(Named(f"a{i}", ("p",)), LOADS[0]) for i in range(10)]
    assert len(pairs((WIND,), *many)) == PAIRS
