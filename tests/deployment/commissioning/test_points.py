"""Known points: what a file may say, and what their touching tells of the encoders."""

from pathlib import Path

import numpy as np
import pytest

from deployment.commissioning import points
from deployment.commissioning.points import JOINTS, Point
from fmus.equations import kinematics
from specs.errors import InputError

PLACES = ((9.0, 2.0, 3.0), (7.0, -3.0, 5.0), (11.0, -2.0, 4.0), (9.5, 4.0, 6.0))
KNOWN = tuple(Point(name=f"p{k}", x=x, y=y, z=z) for k, (x, y, z) in enumerate(PLACES, 1))
OFFSETS = np.array([0.01, -0.02, 0.015])


def shown(places: np.ndarray, offsets: np.ndarray = OFFSETS) -> np.ndarray:
    """What encoders with these offsets show while the grab's centre is at places (n, 3)."""
    found = [kinematics.inverse(x, y, z, kinematics.geometry()) for x, y, z in places.tolist()]
    return np.array(found, dtype=float) + offsets


def test_offsets_are_found_and_nothing_is_left():
    found = points.fit(KNOWN, shown(np.array(PLACES)))
    assert list(found.offsets.values()) == pytest.approx(OFFSETS.tolist(), abs=1e-6)
    assert list(found.offsets) == list(JOINTS)
    assert max(found.residuals) < 1e-6


def test_the_interval_holds_the_true_offset_as_often_as_it_says():
    random, held = np.random.default_rng(1), []
    for _ in range(300):
        found = points.fit(KNOWN, shown(np.array(PLACES) + random.normal(0.0, 0.05, (4, 3))))
        for joint, true in zip(JOINTS, OFFSETS, strict=True):
            held.append(abs(found.offsets[joint] - true) <= found.intervals[joint])
    assert np.mean(held) == pytest.approx(points.CONFIDENCE, abs=0.02)


def test_a_point_that_is_wrong_is_told_from_the_others():
    places = np.array(PLACES)
    places[2] += [0.3, -0.6, 0.2]
    angles = shown(places)
    assert max(points.fit(KNOWN, angles).residuals) > 0.2
    assert points.odd_one(KNOWN, angles, 0.2) == KNOWN[2]
    assert points.odd_one(KNOWN, shown(np.array(PLACES)), 0.2) is None  # any of them may go


def moved(**changes: float) -> tuple[Point, ...]:
    return (*KNOWN[:3], Point(name="far", **{"x": 9.0, "y": 0.0, "z": 3.0, **changes}))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (KNOWN[:2], r"file: 2 points; 3 to 20 are needed"),
        ((*KNOWN, KNOWN[0]), "two points called 'p1'"),
        (moved(x=30.0), r"file: far \(x 30.00, y 0.00, z 3.00 m\): out of reach: .* is beyond the arm"),
        (moved(x=0.5), r"far .* is inside the keep-out radius"),
        (moved(z=-1.0), r"far .* height -1.00 m is below"),
        (tuple(Point(name=f"{x}", x=x, y=1.0, z=3.0) for x in (8.0, 9.0, 10.0, 11.0)), "lie on one line"),
    ],
)
def test_points_that_say_nothing_are_refused(wrong: tuple[Point, ...], said: str):
    with pytest.raises(InputError, match=said):
        points.check(wrong, "file")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", r"points.toml: needs tables \[\[point\]\]"),
        ("[[points]]\nx = 1.0", r"needs tables \[\[point\]\]"),
        ('[[point]]\nname = "a"\nx = 1.0\ny = 2.0', "point 1: .*z"),
        ('[[point]]\nname = "a"\nx = 1.0\ny = 2.0\nz = nan', "point 1: .*finite"),
        ('[[point]]\nname = "a"\nx = "1"\ny = 2.0\nz = 3.0', "point 1: .*x"),
        ('[[point]]\nname = "a"\nx = 1.0\ny = 2.0\nz = 3.0\nw = 1', "unknown key w"),
        ("point = 3", r"needs tables \[\[point\]\]"),
        ("[[point", "not valid TOML"),
    ],
)
def test_a_wrong_file_is_named(text: str, said: str, tmp_path: Path):
    (tmp_path / "points.toml").write_text(text)
    with pytest.raises(InputError, match=said):
        points.read(tmp_path / "points.toml")


def test_a_file_gives_its_points(tmp_path: Path):
    rows = [f'[[point]]\nname = "{p.name}"\nx = {p.x}\ny = {p.y}\nz = {p.z}\n' for p in KNOWN]
    (tmp_path / "points.toml").write_text("\n".join(rows))
    assert points.read(tmp_path / "points.toml") == KNOWN
