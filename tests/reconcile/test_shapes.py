"""Effects that look alike from most starts of their shape: a fast wind is a load."""

import pytest

from reconcile.data import runs_of, split
from reconcile.model import Attached, Folder
from reconcile.rivals import Key, Rivals
from reconcile.search import Search
from reconcile.study import Study
from tests.reconcile.truth import Truth, record

DRAG, WIND = 0.05, -1.0  # N.s2/m2, m/s: about half of the carriage's speed
FLOOR = 1.2 * 1200  # squared errors: what the noise leaves


@pytest.fixture(scope="module")
def search(rig: Folder) -> Search:
    """A carriage in the wind, examined over whole runs."""
    blown = Truth(force=lambda x, v, t: DRAG * (WIND - v) * abs(WIND - v))
    search = Search(Study(rig, split(runs_of(record(blown, seconds=20.0), rig, "run"), (), ())))
    search.begin()
    search.study.lengthen(search.tried.fits[Key()])
    search.begin()
    return search


def candidate(search: Search, name: str) -> Attached:
    return next(a for a in search.study.candidates if a.effect.name == name)


def test_a_wind_is_found_though_a_faster_one_gains_more_at_first(search):
    search._extended(Key(), pairs=False)
    assert search.tried.coarse[Key([candidate(search, "wind_load")])].cost < FLOOR


def test_a_load_is_held_against_winds_of_several_speeds(search, monkeypatch):
    load, wind = (candidate(search, n) for n in ("constant_load", "wind_load"))
    loaded = search.study.fit_set(search.tried.fits[Key()].point, (load,), {})
    assert loaded.cost > 10.0 * FLOOR
    monkeypatch.setattr(Rivals, "_turned", lambda *a: None)  # from what the load came to
    Rivals(search)._widened(loaded, load)
    assert search.tried.fits[Key([wind])].cost < FLOOR
