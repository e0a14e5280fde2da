"""The cheap metrics against worked numbers."""

import math

import pytest
import torch

from learning.policy.judge import metrics


def test_metrics_of_two_worked_moves() -> None:
    """One machine enters the band after 4 s, passes by 2°; the other stops 5° short and is missed."""
    degrees = torch.full((151, 2), 0.0)
    degrees[:40, 0] = -90.0
    degrees[40:60, 0] = 2.0
    degrees[60:, 0] = 1.0
    degrees[:, 1] = 60.0
    degrees[50:, 1] = 5.0
    slew = torch.deg2rad(degrees)
    distance = torch.full((150, 2), 9.0)
    distance[-10:, 0], distance[-10:, 1] = 0.2, 0.6
    tool = torch.deg2rad(torch.full((150, 2), 7.0))
    lever = torch.zeros(150, 2)
    lever[:15, 1] = torch.tensor([0.1, -0.1, 0.1] * 5)
    found = metrics(slew, distance, tool, lever, torch.tensor([False, True]))
    assert found["speed"] == pytest.approx((90 / 4.0 + 60 / 15.0) / 2, rel=1e-4)
    assert found["overshoot"] == pytest.approx(1.0, rel=1e-4)
    assert found["error"] == pytest.approx(0.4)
    assert found["slew_error"] == pytest.approx(3.0, rel=1e-4)
    assert found["tool"] == pytest.approx(7.0, rel=1e-4)
    assert found["rest_peak_to_peak"] == 0.0
    assert found["sign_changes"] == pytest.approx(10 / 15.0 / 2)
    assert found["missed"] == found["ended"] == 0.5
    assert not math.isnan(sum(found.values()))
