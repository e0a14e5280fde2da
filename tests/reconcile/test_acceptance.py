"""What an effect must still show once confirm is fitted to as well."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from reconcile import evidence
from reconcile.acceptance import Acceptance


def effect(name: str) -> SimpleNamespace:
    return SimpleNamespace(effect=SimpleNamespace(name=name), port="axis")


FRICTION, BACKLASH = effect("load_dependent_friction"), effect("sensor_backlash")


@pytest.fixture
def kept(monkeypatch):
    """Which effects stay, of (gain in BIC, standard errors from nothing) by effect."""

    def of(friction: tuple[float, float], backlash: tuple[float, float]) -> tuple[list[str], list[str]]:
        said = {"load_dependent_friction": friction, "sensor_backlash": backlash}
        search = SimpleNamespace(study=None, tried=SimpleNamespace(refused=[]))
        acceptance = Acceptance(cast(Any, search))
        monkeypatch.setattr(acceptance, "_without", lambda present, a: a)
        monkeypatch.setattr(acceptance, "_fit", lambda present: None)
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
