"""Coverage: cells, shares of the use, and what is named as not visited."""

import numpy as np
import pytest

from learning.collection.coverage import AXES, LEAST, Samples, shares, unvisited


def samples(*rows: tuple[float, float, float, float], times: int = LEAST) -> Samples:
    """Each row (u, omega, p, inertia in the axes' units) so many times."""
    values = np.repeat(np.array(rows), times, axis=0)
    return Samples(values, np.full(len(values), "part", dtype=object))


DRIVING, BRAKING = (0.6, 12.0, 250.0, 500.0), (-0.6, 12.0, -250.0, 500.0)


def test_rest_neutral_and_balance_have_cells_of_their_own():
    for axis in AXES[:3]:
        cells = axis.cell(np.array([-axis.edges[-1], -1e-9, 0.0, 1e-9, axis.edges[-1]]))
        assert len(set(cells[1:4])) == 1
        assert cells[0] == 0
        assert cells[-1] == len(axis.edges) - 2
        assert axis.edges == tuple(-e for e in reversed(axis.edges))


def test_what_is_trained_on_is_visited_and_nothing_else():
    assert shares(samples(DRIVING), samples(DRIVING))["time"] == 1.0
    assert shares(samples(BRAKING), samples(DRIVING))["time"] == 0.0
    both = shares(samples(DRIVING), samples(DRIVING, DRIVING, DRIVING) + samples(BRAKING))
    assert both["time"] == pytest.approx(0.75)
    assert both["cells"] == pytest.approx(0.5)


def test_a_cell_needs_half_a_second():
    assert shares(samples(DRIVING, times=LEAST - 1), samples(DRIVING))["time"] == 0.0


def test_the_mirror_image_turns_directions_and_keeps_the_inertia():
    turned = samples(DRIVING).mirrored()
    assert shares(turned, samples((-0.6, -12.0, -250.0, 500.0)))["time"] == 1.0
    assert shares(turned, samples(DRIVING))["time"] == 0.0


@pytest.mark.parametrize("place", range(4))
def test_every_quantity_counts(place):
    other = list(DRIVING)
    other[place] *= 1.7
    assert shares(samples(DRIVING), samples(tuple(other)))["time"] == 0.0  # type: ignore[arg-type]


def test_the_most_used_cell_that_is_not_visited_is_named_first():
    use = samples(DRIVING, times=40) + samples(BRAKING, times=20) + samples((0.0, 0.0, 0.0, 500.0), times=90)
    named = unvisited(samples((0.0, 0.0, 0.0, 500.0)), use)
    assert [n["use_s"] for n in named] == [4.0, 2.0]
    assert named[0]["where"] == "u 0.5 to 0.75, ω 10 to 15 °/s, p_a − p_b 200 to 300 bar, I 400 to 600 t m²"
    assert "u −0.75 to −0.5" in named[1]["where"]
