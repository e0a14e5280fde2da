"""The guard without a core is that of a bundle: the same room, the same answers."""

import numpy as np
import pytest

from deployment.bundling.guard import PARTS
from deployment.guard import draw
from deployment.guard.alone import AXES, SENSORS, Alone
from deployment.guard.stand import Stand, Start, bundle
from runtime.image import INPUT

TICKS = 300


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[Alone, Stand]:
    scene = draw.yard(3, 1)
    return Alone(scene), Stand(bundle(scene, tmp_path_factory.mktemp("alone") / "bundle"))


def rest(angles: tuple[float, float, float]) -> dict[str, float]:
    return dict.fromkeys(SENSORS, 0.0) | dict(zip(SENSORS, angles, strict=False))


def test_standing_still_leaves_the_same_room(both: tuple[Alone, Stand]):
    alone, stand = both
    random = np.random.default_rng(4)
    for angles in (draw.pose(random) for _ in range(20)):
        assert alone.begin(rest(angles)) == pytest.approx(stand.room(angles), abs=1e-3)


def test_each_tick_has_the_answer_of_the_core(both: tuple[Alone, Stand]):
    """A joystick that is pushed from end to end, in a yard full of things."""
    alone, stand = both
    parts = list[str]()

    def driver(tick: int, _: Stand) -> np.ndarray:
        return np.array([1.0, 0.4, -0.4]) * (-1.0) ** (tick // 120)

    def look(tick: int, image: np.ndarray, wanted: np.ndarray) -> None:
        seen = {name: float(image["value"][INPUT.index[name]]) for name in SENSORS}
        if tick == 0:
            alone.begin(seen)
        if tick >= 0:
            parts.append(alone.step(seen, dict(zip(AXES, wanted, strict=True)))[1])

    found = stand.drive(Start(), driver, TICKS, look=look)
    core = [PARTS[int(number)] for number in found.part]
    assert parts[1:] == core[1:]  # in the first tick the core has not seen the arm for long enough
    assert "" in parts
    assert len(set(parts)) > 1
