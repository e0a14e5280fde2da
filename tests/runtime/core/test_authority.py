"""Limited authority: commands, speeds and rises go as far as it lets them, ways to neutral stay fast."""

import numpy as np
import pytest

from runtime.image import OUTPUT
from specs.errors import InputError
from tests.runtime.bench import Bench
from tests.runtime.bundles import core

SLEW = OUTPUT.at("u_slew")


def by_hand(commands: tuple[float, float, float], speed: float = 1.0, rise: float = 1.0) -> Bench:
    """A bench in manual whose core has this authority."""
    bench = Bench(core())
    bench.core.limit(commands, speed, rise)
    bench.manual()
    return bench


def slew(bench: Bench) -> np.ndarray:
    return np.array([image["value"][SLEW] for image in bench.seen])


def test_a_command_goes_as_far_as_its_authority() -> None:
    bench = by_hand((0.25, 1.0, 1.0)).set(joystick_slew=1.0, joystick_boom=0.5).tick(20)
    assert slew(bench).max() == 0.25
    assert bench.seen[-1]["value"][OUTPUT.at("u_boom")] == 0.5


def test_it_grows_as_slowly_as_told_and_falls_as_fast_as_ever() -> None:
    bench = by_hand((1.0, 1.0, 1.0), rise=0.1).set(joystick_slew=1.0).tick(10)
    assert np.diff(slew(bench)).max() == pytest.approx(0.02)
    held = slew(bench)[-1]
    bench.set(joystick_slew=0.0).tick(2)
    assert slew(bench)[-1] == 0.0
    assert 0.3 < held < 0.41


def test_at_its_share_of_the_speed_limit_it_pushes_no_further() -> None:
    bench = by_hand((1.0, 1.0, 1.0), speed=0.1).set(joystick_slew=0.5).tick(20)
    bench.set(imu_cabin_rate_z=0.084).tick(5)
    assert slew(bench)[-1] == 0.5
    bench.set(imu_cabin_rate_z=0.086).tick(5)
    assert slew(bench)[-1] == 0.0


def test_it_is_part_of_a_snapshot_and_ends_with_a_reset() -> None:
    bench = by_hand((0.25, 1.0, 1.0))
    other = Bench(core())
    other.core.restore(bench.core.snapshot())
    assert other.core.snapshot() == bench.core.snapshot()
    first = core().snapshot()
    bench.core.reset()
    assert bench.core.snapshot() == first


@pytest.mark.parametrize("wrong", [(2.0, 1.0, 1.0), (1.0, 1.0), (float("nan"), 1.0, 1.0), (-0.1, 1.0, 1.0)])
def test_nonsense_is_refused(wrong: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="limited authority"):
        core().limit(wrong)
