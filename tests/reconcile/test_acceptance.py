"""What an effect must still show once confirm is fitted to as well."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from reconcile import evidence
from reconcile.acceptance import Acceptance


def effect(name: str) -> SimpleNamespace:
    return SimpleNamespace(effect=SimpleNamespace(name=name), port="axis", key=f"{name}@axis", free=("p",))


CLOSES = evidence.Confirmed(0.5, 40.0)
SILENT = evidence.Confirmed(0.01, 0.7, expected=3.8)
FRICTION, BACKLASH = effect("load_dependent_friction"), effect("sensor_backlash")


@pytest.fixture
def kept(monkeypatch):
    """Which effects stay, of (gain in BIC, standard errors from nothing) by effect.

    `outside`: what confirm shows of each; `left`: deviations of the noise that the set leaves.
    """

    def of(
        friction: tuple[float, float],
        backlash: tuple[float, float],
        outside: evidence.Confirmed = CLOSES,
        left: float = 1.0,
    ) -> tuple[list[str], list[str]]:
        said = {"load_dependent_friction": friction, "sensor_backlash": backlash}
        search = SimpleNamespace(study=None, tried=SimpleNamespace(refused=[]))
        acceptance = Acceptance(cast(Any, search))
        monkeypatch.setattr(acceptance, "_without", lambda present, a: a)
        errors = np.full(100, left)
        linear = SimpleNamespace(cost=float(errors @ errors), raw=[{"y": errors}], left=[{"y": errors}])
        fitted = SimpleNamespace(linear=linear, cost=linear.cost)
        monkeypatch.setattr(acceptance, "_fit", lambda present: fitted)
        monkeypatch.setattr(acceptance, "_on_confirm", lambda without, fitted: outside)
        monkeypatch.setattr("reconcile.acceptance._gains", lambda *_: (0.0, 0.0))
        monkeypatch.setattr(acceptance, "_pays", lambda present, a: said[a.effect.name][0])
        monkeypatch.setattr(evidence, "from_nothing", lambda study, fitted, a: said[a.effect.name][1])
        present = acceptance.earning(cast(Any, (FRICTION, BACKLASH)))
        return [a.effect.name for a in present], [r["because"] for r in search.tried.refused]

    return of


def test_what_gains_little_goes_and_what_is_sure_stays(kept):
    found = kept((9.0, 8.0), (50.0, 8.0))
    assert found == (["sensor_backlash"], ["BIC gains 9.0, not more than 10"])


def test_what_may_as_well_be_nothing_goes_however_it_gains(kept):
    assert kept((18.0, 1.8), (50.0, 8.0)) == (["sensor_backlash"], ["1.8 standard errors from nothing"])


def test_an_overwhelming_gain_outweighs_parameters_that_make_up_for_each_other(kept):
    assert kept((5000.0, 2.3), (50.0, 8.0))[0] == ["load_dependent_friction", "sensor_backlash"]


def test_where_confirm_is_silent_a_sure_gain_counts_unless_more_is_left_than_noise(kept):
    both = ["load_dependent_friction", "sensor_backlash"]
    assert kept((50.0, 8.0), (60.0, 8.0), SILENT)[0] == both
    found = kept((50.0, 8.0), (60.0, 8.0), SILENT, left=3.0)
    assert found == ([], ["closes 1 % of the gap on confirm"] * 2)


def test_what_confirm_bears_out_stays_whatever_else_is_left(kept):
    assert kept((50.0, 8.0), (60.0, 8.0), CLOSES, left=3.0)[0] == [
        "load_dependent_friction",
        "sensor_backlash",
    ]
