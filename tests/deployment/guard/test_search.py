"""Adversarial episodes in yards in which things move: drawn apart from those that stand, and none touched."""

from pathlib import Path

import numpy as np
import pytest

from deployment.bundling import guard
from deployment.guard import draw, search
from specs.scene import HalfSpace

SEED = 5


def test_things_that_move_are_drawn_beside_the_same_that_stand():
    kinds, tilted = set[type](), 0
    for number in range(40):
        still, moving = (draw.yard(number, SEED, moves) for moves in (False, True))
        count = len(still.things)
        assert (moving.things[:count], moving.zones) == (still.things, still.zones)
        assert not any(thing.path for thing in still.things)
        added = moving.things[count:]
        assert 1 <= len(added) <= 3
        for thing in added:
            kinds.add(type(thing))
            tilted += isinstance(thing, HalfSpace)
            assert (0.0, 0.0, 0.0) in thing.places()
            assert len(set(thing.places())) == 5
    assert len(kinds) == 4
    assert tilted > 5


def test_what_moves_leaves_the_machine_a_place():
    for number in range(6):
        found = guard.zones(draw.yard(number, SEED, moving=True))
        assert max(found.carriage) > 0.25


@pytest.mark.slow
def test_no_episode_breaks_the_promise(tmp_path: Path):
    pytest.importorskip("coal", reason="pip install 'slewright[scenes]'")
    from verification.scenes.closest import judged

    found = list(search.episodes(6, SEED, 0, tmp_path, judged, moving=True))
    assert [episode.driver for episode in found] == list(draw.JOYSTICKS)
    assert not any(episode.violated for episode in found)
    assert any(episode.guarded for episode in found)
    figures = search.summary(found)
    assert figures["violations"] == 0
    assert np.isfinite(figures["distance_min"])
