"""What has no form of the catalogue is a curve through points, and no set of effects that imitates it."""

from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from reconcile.catalogue import freeform
from reconcile.equations.model import Attached, Folder, candidates
from reconcile.extend import extend
from reconcile.judging.judge import curves
from reconcile.search.sets import Sets
from reconcile.tolerances import PRIOR
from tests.reconcile.conftest import RIG
from tests.reconcile.truth import Truth

BY_NAME = {e.name: e for e in freeform.FORMS}
AT = (0.3, 2.0)  # middle and spacing of the points


def values(name: str, heights: np.ndarray) -> dict[str, float]:
    """Parameters of a curve with these heights at its points."""
    _, by = freeform.points(*AT)
    own = np.linalg.solve(by, heights)
    names = [q.name for q in BY_NAME[name].parameters]
    return dict(zip(names, map(float, own), strict=True)) | {"middle": AT[0], "spacing": AT[1]}


def pushed(name: str, port: str, heights: np.ndarray, x: float, v: float, u: float) -> float:
    """Force on the rig of 2 kg and 1.5 N s/m, extended by a curve, in one state."""
    more = {"width": 1e-9} if BY_NAME[name].width else {}
    model = extend(RIG, [(name, port, None, values(name, heights) | more)], {})
    p = [w.start for w in model.parameters]
    rates = np.asarray(model.f([x, v, *[0.0] * (len(model.states) - 2)], [u], ca.DM(0, 1), p)).ravel()
    return 2.0 * rates[1]


@pytest.mark.parametrize("at", [-40.0, -11.7, -1.0, 0.3, 5.1, 12.3, 40.0])
def test_a_curve_goes_straight_from_point_to_point_and_is_level_beyond(at):
    heights = np.random.default_rng(3).normal(size=2 * freeform.HALF + 1)
    wanted = np.interp(at, AT[0] + AT[1] * np.arange(-freeform.HALF, freeform.HALF + 1), heights)
    assert pushed("speed_curve", "v", heights, 0.0, at, 0.0) == pytest.approx(-1.5 * at + wanted, abs=1e-9)
    assert pushed("position_curve", "v", heights, at, 0.0, 0.0) == pytest.approx(wanted, abs=1e-9)
    assert pushed("command_curve", "force", heights, 0.0, 0.0, at) == pytest.approx(at + wanted, abs=1e-9)


def test_a_friction_curve_opposes_the_motion_and_never_drives():
    heights = np.linspace(-3.0, 3.0, 2 * freeform.HALF + 1)
    for v in (0.5, -0.5):
        assert pushed("friction_curve", "v", heights, 12.3, v, 0.0) == pytest.approx(
            -1.5 * v - 3.0 * np.sign(v)
        )
        assert pushed("friction_curve", "v", heights, -11.7, v, 0.0) == pytest.approx(-1.5 * v)


def test_a_gain_curve_is_over_the_time_since_the_start():
    model = extend(RIG, [("gain_curve", "force", None, values("gain_curve", np.full(13, 0.25)))], {})
    assert [v.name for v in model.states][2:] == ["running_time"]
    assert pushed("gain_curve", "force", np.full(13, 0.25), 0.0, 0.0, 4.0) == pytest.approx(5.0)


def test_curves_are_no_candidates(rig: Folder):
    from reconcile.recordings.data import runs_of, split
    from reconcile.search.core import Core
    from tests.reconcile.truth import record

    core = Core(rig, split(runs_of(record(Truth(), seconds=8.0, seed=1), rig, "run"), [], []))
    assert {a.effect.name for a in core.curves} == set(BY_NAME)
    assert not any(a.effect.over for a in core.candidates)
    assert all(isinstance(a, Attached) for a in core.curves)


def test_a_curve_is_compared_with_effects_that_have_a_noise_of_their_own(rig: Folder):
    coulomb = next(a for a in candidates(rig, ["position", "velocity"]) if a.key == "coulomb_friction@v")
    curve, effect = frozenset({Attached(BY_NAME["speed_curve"], "v")}), frozenset({coulomb})
    sets: Any = Sets.__new__(Sets)
    sets.points = {k: SimpleNamespace(evidence=e) for k, e in ((curve, 50.0), (effect, 0.0))}
    sets.own = {}
    assert sets.nearest(curve) == (effect, pytest.approx(50.0 - PRIOR))
    sets.own = {
        k: SimpleNamespace(evidence=e) for k, e in ((curve, 10.0), (effect, 14.0), (frozenset(), 99.0))
    }
    assert sets.nearest(curve) == (effect, pytest.approx(-4.0 - PRIOR))
    sets.own = {curve: sets.own[curve]}
    assert sets.nearest(curve) is None


def test_how_probable_a_curve_is_counts_beside_an_answer_without_one(rig: Folder):
    coulomb = next(a for a in candidates(rig, ["position", "velocity"]) if a.key == "coulomb_friction@v")
    curve, effect = frozenset({Attached(BY_NAME["speed_curve"], "v")}), frozenset({coulomb})
    posterior = {effect: 0.5, curve: 0.3, curve | effect: 0.1, frozenset(): 0.1}
    assert curves(posterior, effect) == pytest.approx(0.4)
    assert curves(posterior, curve) == 0.0


@pytest.mark.long
def test_a_half_wave_of_the_command_is_its_curve_and_no_set_of_effects(examined):
    """u + 0.06 u² where u > 0: an asymmetric gain with a dead zone or an offset comes near it."""
    figures = examined(Truth(inputs=lambda u: u + 0.06 * np.maximum(u, 0.0) ** 2), seconds=25.0, seed=8)
    assert figures["verdict"] == figures["residual_status"] == "unexplained"
    assert figures["effects"] == []
    assert figures["alternatives"] == []
    assert not set(figures["probability"]) & set(BY_NAME)
    (curve,) = figures["free_form"]
    assert curve["name"] == "command_curve"
    assert curve["unit"] == curve["over_unit"] == "N"
    at, found = (np.array([p[n] for p in curve["points"]]) for n in ("at", "value"))
    inside = np.abs(at) < 6.0  # the largest commands are rare
    wanted = 0.06 * np.maximum(at, 0.0) ** 2
    straight = np.polyfit(at[inside], (found - wanted)[inside], 1)  # no other than the mass
    assert np.allclose((found - wanted)[inside], np.polyval(straight, at[inside]), atol=0.15)
    assert curve["gap_closed"] > 0.8


@pytest.mark.slow
@pytest.mark.long
def test_friction_that_changes_with_the_place_is_a_curve(examined):
    level = 0.8
    truth = Truth(force=lambda x, v, t: -level * (1.0 + np.cos(3.0 * x)) * np.tanh(v / 1e-4))
    figures = examined(truth, seconds=25.0, seed=6)
    assert figures["verdict"] == "unexplained"
    (curve,) = figures["free_form"]
    assert curve["name"] == "friction_curve"
    assert "changes with the position" in figures["sentence"]
