"""Rivals of an answer: which sets are tried in its place."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from reconcile import rivals as rivals_module
from reconcile.rivals import CLOSE, DEARER, PAIRS, WIDER, Key, Rivals, _comes_late, _less
from reconcile.score import RunsAway
from reconcile.search import Search, Tried
from tests.reconcile import fits as fits_of


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

    def parameters(self, variants: list[Any]) -> int:
        """All of theirs."""
        return sum(len(v.attached.free) for v in variants)


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


def test_in_sets_as_good_what_has_several_parameters_is_exchanged_for_what_has_fewer(monkeypatch):
    lag, delay, drag = Named("lag", ("time",)), Named("delay", ("time",)), Named("drag", ("k", "c"))
    answer, near = Key([LOADS[0], lag]), Key([WIND, lag])
    fits = {k: SimpleNamespace(point=SimpleNamespace(present=tuple(k))) for k in (answer, near)}
    tried = SimpleNamespace(fits=fits)
    search = SimpleNamespace(tried=tried, others=lambda _: [delay, drag, *LOADS])
    rivals = Rivals(cast(Any, search))
    monkeypatch.setattr(rivals, "_as_good", lambda best, pool: [near])

    def instead(fitted, gone, others, most):
        return {Key([*_less(fitted, gone[0]), x]) for x in others}

    monkeypatch.setattr(rivals, "_instead", instead)
    monkeypatch.setattr(rivals, "_merged", lambda best, pool: set())
    found = rivals._further(cast(Any, answer), cast(Any, [answer, near]))
    assert {frozenset(a.key for a in k) for k in found} == {
        frozenset({"delay", "lag"}),
        frozenset({"load@pitch", "lag"}),  # the one at roll is the answer
    }


@dataclass(frozen=True)
class Present:
    """An effect of a set by its name; stribeck turns into coulomb."""

    name: str
    port: str = ""

    @property
    def effect(self) -> "Present":
        """Its own."""
        return self

    @property
    def key(self) -> str:
        """Its name."""
        return self.name

    @property
    def becomes(self) -> dict[str, str]:
        """Its limits."""
        return {"stribeck": {"coulomb": "Fs = Fc"}, "lag": {"delay": "short"}}.get(self.name, {})

    @property
    def delays(self) -> bool:
        """Whether it is a transport delay."""
        return self.name == "delay"


def settled(
    *sets: tuple[str, int, float], tried: int | None = None, left: float = 1.0
) -> tuple[str, list[str]]:
    """Best and near of the first `tried` sets: names, parameters, twice the log-likelihood lost.

    `left`: what they leave, in deviations of the noise.
    """
    fits, count = {}, 1000
    for names, count_of, lost in sets:
        key = Key(Present(*n.split("@")) for n in names.split())
        errors = np.full(count, left * np.exp(0.5 * lost / count)) * np.where(np.arange(count) % 2, 1.0, -1.0)
        cost = float(errors @ errors)
        linear = SimpleNamespace(left=[{"y": errors}], raw=[{"y": errors}], cost=cost)
        point = SimpleNamespace(present=tuple(key))
        fits[key] = SimpleNamespace(cost=cost, linear=linear, point=point, **fits_of.parameters(count_of))
    rivals = Rivals(cast(Any, SimpleNamespace(study=None, tried=Tried(cast(Any, fits)))))
    cast(Any, rivals)._fitted_again = lambda best, pool: None  # fits are as good as they get
    best = rivals._simplest(pool := list(fits)[:tried])
    return said(best), [said(k) for k in rivals._near(cast(Any, best), cast(Any, pool))]


def said(key: Any) -> str:
    return " ".join(sorted(a.name for a in key))


def test_of_sets_that_explain_as_much_the_one_of_fewer_effects_is_named_and_alone():
    found = settled(("curve lag viscous", 4, 0.0), ("curve lag", 4, 0.5), ("curve delay viscous", 4, 1.0))
    assert found == ("curve lag", ["curve delay viscous"])


@pytest.mark.parametrize(("left", "best"), [(1.0, "dahl clock"), (3.0, "coulomb")])
def test_where_more_is_left_than_noise_no_rival_has_more_parameters(left, best):
    assert settled(("coulomb", 1, 0.0), ("dahl clock", 3, -60.0), left=left)[0] == " ".join(
        sorted(best.split())
    )


def test_a_dearer_set_must_be_better_by_more_than_its_parameters_cost():
    price = float(np.log(1000))
    assert settled(("coulomb", 1, 0.0), ("dahl", 2, -price - 0.5 * DEARER))[0] == "coulomb"
    assert settled(("coulomb", 1, 0.0), ("dahl", 2, -price - 1.5 * DEARER))[0] == "dahl"


def test_a_form_is_told_from_its_own_limit_by_less_than_from_another_effect():
    needed = WIDER + 2.0 * 2
    assert settled(("coulomb", 1, 0.0), ("stribeck", 3, -needed - 1.0))[0] == "stribeck"
    assert settled(("coulomb", 1, 0.0), ("stribeck", 3, -needed + 1.0))[0] == "coulomb"
    assert settled(("coulomb", 1, 0.0), ("ripple", 3, -needed - 1.0))[0] == "coulomb"
    assert settled(("coulomb lag", 2, 0.0), ("stribeck delay", 4, -needed - 1.0))[0] == "coulomb lag"


def test_sets_at_odds_of_less_than_five_are_named_too():
    assert settled(("lag", 1, 0.0), ("delay", 1, 0.9 * CLOSE)) == ("lag", ["delay"])
    assert settled(("lag", 1, 0.0), ("delay", 1, 1.1 * CLOSE)) == ("lag", [])


def test_a_set_of_as_many_effects_is_named_too_though_two_of_the_answers_have_one_name():
    found = settled(("bias lag@angle lag@both", 3, 0.0), ("bias delay lag", 3, 0.5))
    assert found == ("bias lag lag", ["bias delay lag"])


def test_of_sets_that_cannot_be_told_apart_those_of_fewer_effects_come_first():
    larger = ("load dry lag", 4, 0.5), ("load dry delay", 4, 0.6)
    found = settled(("sides lag", 4, 0.0), *larger, ("sides delay", 4, 1.0))
    assert found == ("lag sides", ["delay sides", "dry lag load", "delay dry load"])


def test_two_exchanges_that_each_leave_as_little_are_tried_together():
    singly = ("load lag", 2, 0.0), ("offset lag", 2, 0.5), ("load delay", 2, 1.0)
    assert settled(*singly, ("offset delay", 2, 1.5), tried=3)[1] == [
        "lag offset",
        "delay load",
        "delay offset",
    ]
    assert settled(*singly, ("offset delay", 2, 1.1 * CLOSE), tried=3)[1] == ["lag offset", "delay load"]


def test_exchanges_of_the_same_effect_are_not_tried_together():
    singly = ("load lag", 2, 0.0), ("load delay", 2, 0.5), ("load wait", 2, 1.0)
    assert settled(*singly, ("delay wait", 2, 0.1), tried=3)[1] == ["delay load", "load wait"]


def test_two_lags_are_no_alternative_to_a_lag_and_a_delay():
    assert settled(("lag delay", 2, 0.0), ("lag@q lag@v", 2, 0.5))[1] == []


@pytest.mark.parametrize(
    ("present", "added", "late"),
    [("delay", "lag", True), ("coulomb", "stribeck", False), ("coulomb", "lag", False)],
)
def test_a_lag_may_come_beside_its_limit_a_delay_and_a_friction_not(present, added, late):
    scored = SimpleNamespace(variants=[SimpleNamespace(attached=Present(added))])
    fitted = SimpleNamespace(point=SimpleNamespace(present=(Present(present),)))
    assert _comes_late(cast(Any, scored), cast(Any, fitted)) == late


@pytest.mark.parametrize(("beside", "names"), [(False, {"lag"}), (True, {"lag", "delay"})])
def test_what_is_added_takes_the_place_of_its_limits_or_comes_beside_them(monkeypatch, beside, names):
    fit = SimpleNamespace(cost=1.0, point=SimpleNamespace(present=()))
    search = Search(cast(Any, SimpleNamespace(fit_set=lambda *a, **k: fit)))
    monkeypatch.setattr("reconcile.search.starting.best", lambda *a: {})
    monkeypatch.setattr("reconcile.search.starts", lambda scored: {})
    scored = SimpleNamespace(variants=[SimpleNamespace(attached=Present("lag"))])
    before = SimpleNamespace(cost=2.0, point=SimpleNamespace(present=(Present("delay"),)))
    key = search.attempt(cast(Any, before), cast(Any, scored), beside=beside)
    assert {a.name for a in cast(Any, key)} == names


def test_no_effect_comes_twice_into_a_set_by_turning_into_another():
    lag, delay, sides, zone = (Present(n) for n in ("lag", "delay", "zone", "zone"))
    search = Search(cast(Any, SimpleNamespace(candidates=[lag, delay, zone])))
    both = cast(Any, SimpleNamespace(point=SimpleNamespace(present=(lag, delay))))
    assert search.absent(_less(both, cast(Any, delay))) == [delay, zone]
    alone = cast(Any, SimpleNamespace(point=SimpleNamespace(present=(sides,))))
    assert zone in search.absent(_less(alone, cast(Any, sides)))  # another form of itself


WIND_ALONE, DRAG = Present("wind"), Present("drag")


def without_wind(present: tuple[Present, ...]) -> tuple[Present, ...]:
    return tuple(a for a in present if a != WIND_ALONE)


def rivals(monkeypatch, found: tuple[tuple[Present, ...], tuple[tuple[Present, ...], ...]]) -> None:
    """Rivals that find this of the wind, and of all else nothing."""

    def settle(present):
        return found if present == (WIND_ALONE,) else (present, ())

    monkeypatch.setattr("reconcile.search.Rivals", lambda _: SimpleNamespace(settle=settle))


def test_what_pays_no_more_gives_way_to_a_rival_that_does(monkeypatch):
    rivals(monkeypatch, ((DRAG,), ()))
    monkeypatch.setattr("reconcile.search.minima.reshaped", lambda study, fit, known: fit)
    acceptance = SimpleNamespace(earning=without_wind)
    search = Search(cast(Any, None))
    search.tried.fits = cast(Any, {Key((DRAG,)): None})
    assert search._settled(cast(Any, acceptance), cast(Any, (WIND_ALONE,))) == ((DRAG,), ())


def test_what_confirm_does_not_bear_out_gives_way_to_a_rival_that_it_does(monkeypatch):
    rivals(monkeypatch, ((WIND_ALONE,), ((DRAG,),)))
    acceptance = SimpleNamespace(confirmed=without_wind)
    search = Search(cast(Any, None))
    search.tried.fits = cast(Any, {Key(): None, Key((WIND_ALONE,)): None, Key((DRAG,)): None})
    monkeypatch.setattr(search, "_ranked", lambda fits: sorted(fits, key=len, reverse=True))
    assert search._confirmed(cast(Any, acceptance), cast(Any, (WIND_ALONE,))) == (DRAG,)
    assert search._confirmed(cast(Any, acceptance), cast(Any, (DRAG,))) == (DRAG,)


class Told:
    """Slopes at a fit: its cost, and what each effect would gain there."""

    def __init__(self, study: Any, fitted: Any, others: Any):
        if fitted.gains is None:
            raise RunsAway
        self.cost, self.gains = fitted.cost, fitted.gains

    def best(self, count: int, size: int) -> list[Any]:
        ranked = sorted(self.gains, key=lambda a: -self.gains[a])[:count] if size == 1 else []
        return [SimpleNamespace(variants=[SimpleNamespace(attached=a)], gain=self.gains[a]) for a in ranked]


@pytest.mark.parametrize(
    ("refitted", "expected"),
    [
        ((600.0, {"drag": 590.0, "lag": 20.0}), [("drag", 600.0), ("lag", 600.0)]),
        ((600.0, None), [("lag", 7000.0), ("delay", 7000.0)]),  # it cannot be simulated
        (None, [("lag", 7000.0), ("delay", 7000.0)]),  # nobody knows it
    ],
    ids=["known", "runs away", "unknown"],
)
def test_what_to_try_instead_is_told_by_the_fit_without_an_effect_as_well(monkeypatch, refitted, expected):
    names = {n: Named(n, ("p",)) for n in ("lag", "delay", "drag", "curve", "friction")}

    def fit(cost: float, gains: dict[str, float] | None, *present: str) -> Any:
        by_effect = None if gains is None else {names[n]: g for n, g in gains.items()}
        point = SimpleNamespace(present=tuple(names[n] for n in present))
        return SimpleNamespace(cost=cost, gains=by_effect, point=point)

    answer = fit(10.0, {}, "friction", "curve")
    stripped = fit(7000.0, {"lag": 400.0, "delay": 300.0, "drag": 70.0}, "friction")
    fits = {Key([names["friction"]]): fit(*refitted, "friction")} if refitted else {}
    search = SimpleNamespace(tried=Tried(cast(Any, fits)), study=None)
    rivals = Rivals(cast(Any, search))
    monkeypatch.setattr(rivals_module, "Score", Told)
    monkeypatch.setattr(rivals_module, "stripped", lambda study, fitted, gone: stripped)
    found = rivals._likeliest(answer, cast(Any, [names["curve"]]), [], 2)
    assert [(x.variants[0].attached.key, f.cost) for f, x in found] == expected


def chain(monkeypatch: pytest.MonkeyPatch, criteria: dict[str, float]) -> Rivals:
    """Rivals of a search in which each of some sets has only the next one as its rival."""
    effects = {n: Present(n) for n in criteria}
    keys = {n: cast(Key, Key([a])) for n, a in effects.items()}
    following = dict(zip(keys.values(), list(keys.values())[1:], strict=False))
    fits = {k: SimpleNamespace(point=SimpleNamespace(present=tuple(k))) for k in keys.values()}
    found = Rivals(cast(Any, SimpleNamespace(tried=Tried(cast(Any, fits)))))
    by_key = {keys[n]: c for n, c in criteria.items()}
    monkeypatch.setattr(found, "_rivals", lambda present: {following.get(Key(present), Key(present))})
    monkeypatch.setattr(found, "_further", lambda best, pool: [])
    monkeypatch.setattr(found, "_simplest", lambda pool: min(pool, key=lambda k: by_key[k]))
    monkeypatch.setattr(found, "_near", lambda best, pool: ())
    monkeypatch.setattr(found, "_simpler", lambda best: [])
    return found


def test_no_answer_is_left_for_a_rival_that_is_better_however_often_it_was_exchanged(monkeypatch):
    found = chain(monkeypatch, {"a": 4.0, "b": 3.0, "c": 2.0, "d": 1.0, "e": 0.0})
    assert found.settle(cast(Any, (Present("a"),))) == ((Present("e"),), ())


def test_exchanges_made_together_that_are_better_become_the_answer(monkeypatch):
    found = chain(monkeypatch, {"a": 1.0, "both": 0.0})
    together = (Present("both"),)
    monkeypatch.setattr(found, "_rivals", lambda present: {Key(present)})
    monkeypatch.setattr(found, "_near", lambda best, pool: () if best == Key(together) else (together,))
    assert found.settle(cast(Any, (Present("a"),))) == (together, ())


def test_a_simpler_set_that_was_found_late_becomes_the_answer(monkeypatch):
    found = chain(monkeypatch, {"two": 1.0, "one": 0.0})
    one, two = (cast(Key, Key([Present(n)])) for n in ("one", "two"))
    monkeypatch.setattr(found, "_rivals", lambda present: {Key(present)})
    monkeypatch.setattr(found, "_simpler", lambda best: [one] if best == two else [])
    assert found.settle(cast(Any, (Present("two"),))) == ((Present("one"),), ())


def test_parts_of_an_answer_are_no_simpler_sets_beside_it():
    wind, drag, load, lag = (Present(n) for n in ("wind", "drag", "load", "lag"))
    sizes = {(wind, lag): 3, (wind,): 2, (drag,): 1, (drag, load): 2, (drag, load, lag): 3, (): 0}
    fits = {Key(k): SimpleNamespace(**fits_of.parameters(n)) for k, n in sizes.items()}
    found = Rivals(cast(Any, SimpleNamespace(tried=Tried(cast(Any, fits)))))
    assert found._simpler(cast(Key, Key([wind, lag]))) == [Key([drag]), Key([drag, load])]


def test_two_effects_of_a_larger_set_that_comes_near_may_be_one(monkeypatch):
    """A wind is a load and a drag; with the load may go friction of two sides for the drag and a gain."""
    wind, gain, load, drag = WIND, Named("gain", ("g",)), LOADS[0], Named("drag", ("b",))
    sides, curve = Named("sides", ("b+", "b-")), Named("curve", ("c",))
    best, near = Key([wind, gain]), Key([load, drag, gain])
    fits = {k: SimpleNamespace(cost=1.0, point=SimpleNamespace(present=tuple(k))) for k in (best, near)}
    search = SimpleNamespace(tried=SimpleNamespace(fits=fits), others=lambda _: [wind, sides, curve])
    found = Rivals(cast(Any, search))
    monkeypatch.setattr(found, "_loses", lambda best, pool: {near: 5.0})
    tried: list[Any] = []

    def instead(fitted, gone, others, most):
        tried.append((frozenset(gone), others))
        return {Key([*(a for a in near if a not in gone), sides])}

    monkeypatch.setattr(found, "_instead", instead)
    merged = found._merged(cast(Any, best), cast(Any, [best, near]))
    pairs = [frozenset(p) for p in ((load, drag), (load, gain), (drag, gain))]
    assert sorted(map(sorted_keys, (gone for gone, _ in tried))) == sorted(map(sorted_keys, pairs))
    assert all(others == [sides] for _, others in tried)  # of one parameter nothing, nor what the answer has
    assert Key([load, sides]) in merged


def sorted_keys(effects: Any) -> list[str]:
    return sorted(a.key for a in effects)


def test_no_effects_have_no_rivals():
    assert Rivals(cast(Any, None)).settle(()) == ((), ())


class Tuned(Present):
    """An effect with a free parameter of its name."""

    @property
    def free(self) -> tuple[str, ...]:
        """Its parameter."""
        return (self.name,)


def left_by(cost: float, a: Present) -> SimpleNamespace:
    """A fit of one effect."""
    return SimpleNamespace(cost=cost, free=("p",), point=SimpleNamespace(present=(a,), p=None))


@pytest.mark.parametrize(
    ("cost", "fitted"), [(1002.0, 0), (1010.0, 1), (1100.0, 0)], ids=["as good", "near", "far"]
)
def test_what_leaves_a_little_more_is_fitted_again_from_where_the_best_ended(monkeypatch, cost, fitted):
    lag, delay = Tuned("lag"), Tuned("delay")
    fits: Any = {Key([a]): left_by(c, a) for a, c in ((lag, 1000.0), (delay, cost))}
    study = SimpleNamespace(named=lambda p: {"lag": 0.1, "delay": 0.2})
    found = Rivals(cast(Any, SimpleNamespace(tried=Tried(cast(Any, fits)), study=study)))
    calls: list[Any] = []
    monkeypatch.setattr(found, "_fitted", lambda *given: calls.append(given))
    monkeypatch.setattr(rivals_module.evidence, "sample", lambda f: None)
    monkeypatch.setattr(rivals_module.evidence, "likelihood_gain", lambda more, less, s: more - less)
    found._fitted_again(cast(Key, Key([lag])), cast(Any, [*fits]))
    assert calls == [(fits[Key([lag])], (delay,), {"delay": 0.2})] * fitted
