"""Errors ahead: over the model's own time, however short the blocks of a recording are."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from reconcile.errors import ahead as errors
from reconcile.errors.ahead import above_noise, windows
from reconcile.judging import judge as judges

PERIOD, MEMORY = 0.1, 1.0


def core(*blocks: tuple[int, int], n: int = 100, shows_all: bool = False) -> Any:
    """One recording of n samples with these blocks (first sample, end) in confirm."""
    inside = np.zeros(n, bool)
    for a, b in blocks:
        inside[a:b] = True
    record = SimpleNamespace(time=PERIOD * np.arange(n), confirm=inside)
    return SimpleNamespace(memory_s=MEMORY, period=PERIOD, records=[record], shows_all=shows_all)


def stretches(*blocks: tuple[int, int]) -> tuple[list[tuple[int, int]], np.ndarray]:
    """First sample and end of every stretch, and what counts."""
    ((ids, counts),) = windows(core(*blocks), ("confirm",))
    rows = [np.flatnonzero(ids == number) for number in np.unique(ids[ids > 0])]
    return [(int(r[0]), int(r[-1]) + 1) for r in rows], np.flatnonzero(counts)


def test_a_short_block_is_reached_over_the_models_own_time():
    found, counts = stretches((40, 45))
    assert found == [(35, 45)]
    assert counts.tolist() == [40, 41, 42, 43, 44]


def test_a_long_block_is_cut_and_begins_where_it_does():
    found, counts = stretches((40, 65))
    assert found == [(40, 50), (50, 60), (60, 65)]
    assert len(counts) == 25


def test_stretches_do_not_reach_into_the_block_before():
    found, _ = stretches((40, 45), (48, 53))
    assert found == [(35, 45), (45, 53)]


@pytest.mark.parametrize(("block", "begins"), [((3, 8), 3), ((12, 16), 10), ((0, 5), 1)])
def test_none_begins_before_hidden_states_can_be_known(block, begins):
    found, _ = stretches(block)
    assert found[0][0] == begins


def test_what_comes_before_hidden_states_are_known_does_not_count_beside_others():
    _, counts = stretches((3, 14), (40, 45))
    assert counts.tolist() == [10, 11, 12, 13, 40, 41, 42, 43, 44]


def test_where_every_state_is_recorded_ten_samples_are_enough():
    known = core((0, 95), n=400, shows_all=True)
    known.memory_s = 9.0
    ((_, counts),) = windows(known, ("confirm",))
    assert np.flatnonzero(counts).tolist() == list(range(10, 95))


def test_a_model_that_runs_away_errs_without_end(monkeypatch):
    monkeypatch.setattr(errors, "by_record", lambda core, point, which: None)
    assert above_noise(errors.by_stretch(core((40, 45)), None)) == np.inf  # type: ignore[arg-type]


def test_the_model_without_effects_is_the_fit_that_errs_less_above_the_noise(monkeypatch):
    monkeypatch.setattr(errors, "ahead", lambda core, point: point)
    monkeypatch.setattr(errors, "noise", lambda core, point: 0.1)
    monkeypatch.setattr(errors, "alone", lambda core: core.alone)
    for base, alone, wanted in (
        (0.4, [0.35, 0.3], 0.3),
        (0.2, [0.3], 0.2),
        (0.4, [], 0.4),
        (0.09, [0.01], 0.09),
    ):
        assert errors.without_effects(SimpleNamespace(base=base, alone=alone)) == wanted  # type: ignore[arg-type]


def judged(without: list[float], with_it: list[float]) -> tuple[judges.Judge, Any]:
    """A judge of one effect, whose errors by stretch (mean squares of ten samples) are these."""
    effect: Any = "an effect"
    judge = judges.Judge(SimpleNamespace(core=None, points={frozenset(): 0, frozenset({effect}): 1}))  # type: ignore[arg-type]
    for key, squares in ((frozenset(), without), (frozenset({effect}), with_it)):
        judge._stretches[key] = np.array([[10.0 * s, 0.0, 10.0] for s in squares])
    return judge, effect


def little(without: list[float], with_it: list[float]) -> bool:
    judge, effect = judged(without, with_it)
    key = frozenset({effect})
    return judge._little(judge._shortened(key, effect), judge._chance(key, effect), judge.ahead(frozenset()))


def test_one_stretch_that_is_off_does_not_turn_an_effect_down():
    assert not little([1.0, 1.0, 1.0, 1.0], [0.1, 0.1, 0.1, 4.5])
    assert little([1.0] * 40, [0.1] * 30 + [4.5] * 10)  # as often as that it is no chance
    assert little([0.4, 0.9, 0.05, 0.3], [1.1, 0.6, 0.06, 0.3])  # nor does one save it that is worse in most


def test_what_changes_no_stretch_is_too_little():
    assert little([1.0, 1.0, 1.0], [0.999, 0.999, 0.999])
    assert not little([1.0, 1.0, 1.0], [0.5, 0.5, 0.5])
