"""A steady load is no slow random force, whatever short windows took it for."""

from dataclasses import replace

import pytest

from reconcile.data import runs_of, split
from reconcile.fit import whitening
from reconcile.model import Folder
from reconcile.rivals import Key
from reconcile.search import Search
from reconcile.study import Study
from tests.reconcile.truth import Truth, record

LOAD = 4e-5  # N: over whole runs it moves the carriage by some of its sensor's noise
SLOW = {"size": 4e-5, "time_s": 2.8}  # N: a random force that hides it


@pytest.fixture(scope="module")
def search(rig: Folder) -> Search:
    """A carriage with a small load, in whole runs, where the noise is known from elsewhere and wrong."""
    loaded = Truth(force=lambda x, v, t: LOAD)
    runs = [run for seed in (1, 2, 3) for run in runs_of(record(loaded, 20.0, seed), rig, f"run_{seed}")]
    search = Search(Study(rig, split(runs, (), ())))
    search.begin()
    search.study.lengthen(search.tried.fits[Key()])
    search.begin()
    return search


def judged(search: Search, anew: bool) -> float:
    """Size of the random force in N, judged where a slow one is known."""
    study, base = search.study, search.tried.fits[Key()]
    study.estimate_noise(base)
    sources = tuple(replace(s, **SLOW) if not s.white else s for s in study.noise.sources)
    known = whitening.transferred(replace(study.noise, sources=sources), study.fit_problem, base.point)
    study.noise, study.fit_problem.whiteners = known, known.whiteners()
    search._again([Key()])
    search._judge_noise(Key(), anew)
    return study.noise.sources[0].size


def test_a_steady_load_in_whole_runs_is_no_random_force_of_short_windows(search):
    assert judged(search, anew=False) > 0.5 * LOAD
    assert judged(search, anew=True) == 0.0
