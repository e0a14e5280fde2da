"""Dry friction whose level changes along the way: found where it does, and not where it does not."""

from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from reconcile import uneven
from reconcile.catalogue import ALL
from reconcile.data import runs_of, split
from reconcile.freeform import NONE
from reconcile.model import Folder
from reconcile.search import Answer, Tried
from reconcile.study import Study
from reconcile.verdict import FREE_GAIN
from tests.reconcile.truth import Truth, coulomb, record

COULOMB = next(e for e in ALL if e.key == "coulomb_friction")
LEVEL = 1.0  # N


def friction(slope: float) -> Truth:
    """Coulomb friction; while it slides its level changes by `slope` (N) over a metre."""
    return Truth(**coulomb(LEVEL), force=lambda x, v, t: -slope * np.clip(x, -1.0, 1.0) * np.sign(v))


def answered(rig: Folder, truth: Truth, keys: tuple[str, ...]) -> tuple[Study, Answer]:
    """A study of a truth and a set of effects fitted to it, as if they were the answer."""
    study = Study(rig, split(runs_of(record(truth, seconds=24.0), rig, "run"), (), ()))
    present = tuple(a for a in study.candidates if a.key in keys)
    base = study.fit_set(study.fit_problem.start(study.values), (), {})
    assert base is not None
    fitted = study.fit_set(base.point, present, {a.name("Fc"): 0.5 for a in present})
    assert fitted is not None
    study.estimate_noise(fitted)
    return study, Answer(present, fitted, base, (), {}, Tried())


@pytest.mark.parametrize(("slope", "found"), [(0.6, True), (0.0, False)])
def test_a_level_that_changes_is_told_from_one_that_does_not(rig: Folder, slope: float, found: bool):
    study, answer = answered(rig, friction(slope), ("coulomb_friction@v",))
    noise, whiteners = study.noise, study.fit_problem.whiteners
    free = uneven.examine(study, answer)
    assert (free.gain - free.price > FREE_GAIN) is found
    assert free.terms == ("v: q sgn v", "v: q² sgn v")
    assert study.noise is noise
    assert study.fit_problem.whiteners is whiteners


def test_without_dry_friction_nothing_is_tried(rig: Folder):
    assert uneven.examine(*answered(rig, Truth(), ())) is NONE


@pytest.mark.parametrize("step", [None, 0.02])
def test_the_level_is_the_frictions_own_times_its_change_and_never_negative(step: float | None):
    build: Any = uneven.changing(COULOMB).build

    def force(q: float, slope: float, bend: float) -> float:
        at = SimpleNamespace(v=ca.DM(0.3), q=ca.DM(q), width=ca.DM(1e-6), step=step)
        made = build(at, SimpleNamespace(Fc=ca.DM(2.0), slope=slope, bend=bend), SimpleNamespace())
        return float(-made.value if made.dry is None else made.dry[0])

    assert force(0.5, 0.0, 0.0) == pytest.approx(2.0)
    assert force(0.5, 1.0, -2.0) == pytest.approx(2.0 * (1.0 + 0.5 - 0.5))
    assert force(-2.0, 1.0, 0.0) == 0.0
