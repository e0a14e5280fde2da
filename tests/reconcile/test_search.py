"""The search over sets: which of those that grew are fitted sharply."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from reconcile.rivals import Key, Rivals
from reconcile.search import SHARPENED, Search, Tried
from tests.reconcile import fits

SAMPLES = 1000


def fitted(cost: float, count: int, present: tuple[str, ...]) -> SimpleNamespace:
    """A coarse fit of so many parameters that leaves so much."""
    raw = [{"y": np.zeros(SAMPLES)}]
    point = SimpleNamespace(present=present)
    linear = SimpleNamespace(raw=raw)
    return SimpleNamespace(cost=cost, linear=linear, point=point, **fits.parameters(count))


@pytest.fixture
def sharpened(monkeypatch):
    """Which sets are sharpened, of coarse fits (cost, parameters) by names."""

    def of(**sets: tuple[float, int]) -> list[str]:
        keys = {Key(name.split("_")): fitted(*found, tuple(name.split("_"))) for name, found in sets.items()}
        study = cast(Any, SimpleNamespace(fit_set=lambda *a, **k: None))
        search, done = Search(study), []
        search.tried = Tried({}, cast(Any, keys))

        def sharp(present, near):
            done.append("_".join(present))
            search.tried.fits[Key(present)] = near
            return near

        monkeypatch.setattr(search, "sharp", sharp)
        monkeypatch.setattr("reconcile.search.minima.polished", lambda study, fit: fit)
        monkeypatch.setattr("reconcile.search.minima.afresh", lambda study, fit: fit)
        search._sharpened(search._ranked(search.tried.coarse))
        return done

    return of


def test_a_set_that_gains_nothing_over_a_part_of_it_is_not_sharpened(sharpened):
    sets = {"drag": (1000.0, 4), "drag_shaft": (1010.0, 7), "drag_lag": (999.0, 5), "lag": (1500.0, 4)}
    assert sharpened(**sets) == ["drag", "lag"]


def test_a_set_that_gains_half_of_what_would_be_accepted_is(sharpened):
    assert sharpened(drag=(1000.0, 4), drag_lag=(985.0, 5)) == ["drag", "drag_lag"]


def test_sets_that_are_left_out_make_room_for_others(sharpened):
    worse = {f"other{i}": (1100.0 + i, 4) for i in range(SHARPENED)}
    found = sharpened(drag=(1000.0, 4), drag_lag=(999.0, 5), **worse)
    assert found == ["drag", *list(worse)[: SHARPENED - 1]]


@pytest.mark.parametrize(
    ("rival", "borne_out", "rival_of_drag", "answer"),
    [
        ("friction clock", "friction clock", "drag", "friction clock"),  # it earns its place
        ("clock lag", "clock", "drag", "friction"),  # what is left of it leaves more than what stood before
        ("drag lag", "drag", "drag", "drag"),
        ("drag lag", "drag", "drag lag", "drag"),  # exchanges lead back to it
    ],
)
def test_a_rival_that_does_not_earn_its_place_takes_none(
    monkeypatch, rival, borne_out, rival_of_drag, answer
):
    costs = {"friction": 1000.0, "clock": 1500.0, "drag": 900.0, rival: 800.0}
    search = Search(cast(Any, None))
    known = {Key(n.split()): fitted(c, 4, tuple(n.split())) for n, c in costs.items()}
    search.tried = Tried(cast(Any, known), {})
    monkeypatch.setattr("reconcile.search.minima.reshaped", lambda study, fit, known: fit)
    taken = {"friction": rival, "drag": rival_of_drag}
    earned = {rival: borne_out}
    monkeypatch.setattr(
        Rivals, "settle", lambda self, present: (tuple(taken[" ".join(present)].split()), ("others",))
    )
    monkeypatch.setattr(Rivals, "beside", lambda self, present, without: ("others",))
    earning = lambda present: tuple(earned.get(" ".join(present), " ".join(present)).split())  # noqa: E731
    found = search._settled(cast(Any, SimpleNamespace(earning=earning)), cast(Any, ("friction",)))
    assert found == (tuple(answer.split()), ("others",))


@pytest.mark.parametrize(
    ("pair", "alone"),
    [(900.0, {"play": 902.0}), (850.0, {"play": 902.0, "clock": 998.0}), (995.0, {})],
    ids=["one pays", "both pay", "neither"],
)
def test_effects_of_a_pair_are_tried_by_themselves_while_the_pair_gains_over_them(pair, alone):
    left = {"play": 902.0, "clock": 998.0}
    study = SimpleNamespace(
        fit_set=lambda point, present, *a, **k: fitted(left["_".join(present)], 5, present)
    )
    search = Search(cast(Any, study))
    both = fitted(pair, 6, ("clock", "play"))
    search.tried = Tried({}, cast(Any, {Key(): fitted(1000.0, 4, ()), Key(["clock", "play"]): both}))
    found = search._parted(cast(Key, Key()), cast(Any, {Key(["clock", "play"])}))
    assert {next(iter(k)): search.tried.coarse[k].cost for k in cast(Any, found)} == alone
