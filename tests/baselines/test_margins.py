"""A drive whose dead band, gain and delay are known is measured as it is; what a table of plants covers."""

import numpy as np
import pytest

from baselines.margins import coverage
from baselines.margins.drive import GAIN_HZ, Drive, Swing, drive
from baselines.margins.experiment import FREQUENCIES_HZ, experiment
from specs.errors import InputError
from specs.scenario import TICK_S

KNOWN = Drive(0.12, 0.2, 0.25)


def integrator(dead_band: float, gain: float, late_s: float, noise: float = 0.0) -> list[Swing]:
    """The experiment on a drive whose speed is `gain` times the integral of what is beyond the dead band."""
    asked, ticks, rng = experiment(), round(late_s / TICK_S), np.random.default_rng(3)
    found = []
    for number, hz in enumerate(FREQUENCIES_HZ):
        u = np.array(
            [asked.sine(number, k, asked.amplitude(dead_band)) for k in range(asked.sine_ticks)]
        )  # fmt: skip
        beyond = np.sign(u) * np.maximum(np.abs(u) - dead_band, 0.0)
        speed = gain * integral(np.concatenate([np.zeros(ticks), beyond])[: len(u)])
        angle = integral(speed)
        found.append(Swing(hz, u, angle + noise * rng.standard_normal(len(u))))
    return found


def integral(x: np.ndarray) -> np.ndarray:
    """By trapezoids [n]."""
    return (np.cumsum(x) - (x + x[0]) / 2) * TICK_S


@pytest.mark.parametrize("dead_band", [0.05, 0.18])
@pytest.mark.parametrize("gain", [0.5, 2.0])
@pytest.mark.parametrize("late", [0.1, 0.3, 0.8])
def test_a_known_drive_is_measured_as_it_is(dead_band: float, gain: float, late: float) -> None:
    swings = integrator(dead_band, gain, late, noise=1e-3)
    found = drive(swings, {1.0: dead_band, -1.0: dead_band}, experiment().settle_s)
    assert found.delay_s == pytest.approx(late, abs=0.01)
    assert found.gain == pytest.approx(gain / (2 * np.pi * GAIN_HZ), rel=0.05)
    assert found.dead_band == dead_band


def test_a_dead_band_is_between_two_levels() -> None:
    asked = experiment()
    rate = [np.full(60, 0.0 if level < 0.118 else 0.02) for level in asked.levels]
    first = next(k for k, r in enumerate(rate) if asked.turns(r, 1.0))
    assert asked.dead_band(first) == pytest.approx(0.118, abs=0.01)
    assert not asked.turns(rate[-1], -1.0)


@pytest.mark.parametrize(
    ("measured", "wrong"),
    [
        (KNOWN, []),
        (Drive(0.12, 0.4, 0.25), ["gain"]),
        (Drive(0.12, 0.1, 0.25), ["gain"]),
        (Drive(0.12, 0.2, 0.65), ["delay"]),
        (Drive(0.12, 0.2, 0.05), []),  # sooner is no harm
        (Drive(0.28, 0.2, 0.25), ["dead band"]),
        (Drive(0.12, float("nan"), float("nan")), ["gain", "delay"]),
    ],
)
def test_what_a_controller_was_not_tried_on_is_not_covered(measured: Drive, wrong: list[str]) -> None:
    found = coverage.ranges(measured, [KNOWN, Drive(0.1, 0.22, 0.3)])
    assert [r.name.removesuffix(" of the slew drive") for r in found if not r.kept] == wrong


@pytest.mark.parametrize(
    "content",
    [
        {"plants": {}},
        {"passed": ["machine"], "drives": {}},
        {"passed": ["machine"], "drives": {"machine": {"gain": 0.2}}},
        {"passed": ["machine"], "drives": {"machine": {"gain": None, "delay_s": 0.2, "dead_band": 0.1}}},
        [],
    ],
)
def test_a_table_without_drives_is_refused(content: object) -> None:
    with pytest.raises(InputError, match="build the bundle again"):
        coverage.passed(content, "b/plants.json")
