"""Linear analysis of any controller's loop: two ways that agree, and the command that tells."""

import json
import math
from pathlib import Path

import pytest

from baselines import registry
from baselines.loop import analyse
from specs.errors import InputError
from tests.conftest import Command

LINEAR = registry.select(["pi", "pd", "parabola", "lqr", "zv", "zv_sway"])  # ZVD and EI have the loops of ZV


@pytest.mark.parametrize("name", ["parabola", "zv_sway"])
def test_the_delay_margin_is_where_the_sampled_loop_becomes_unstable(name: str) -> None:
    """Frequency response and eigenvalues are two computations of one loop."""
    controller = registry.find(name)
    pose, loop = min(analyse(controller).items(), key=lambda item: item[1].margins.delay_s)
    step = 0.02  # whole steps on either side of the margin
    below, above = (f(loop.margins.delay_s / step) * step for f in (math.floor, math.ceil))
    assert analyse(controller, later_s=below - step)[pose].stable
    assert not analyse(controller, later_s=above + step)[pose].stable


@pytest.mark.parametrize("controller", LINEAR, ids=lambda c: c.name)
def test_shipped_gains_are_stable_at_every_pose(controller: registry.Controller) -> None:
    for pose, loop in analyse(controller).items():
        assert loop.stable, pose
        assert loop.margins.delay_s > 0.04, pose
        assert loop.sensitivity >= 1.0


def test_sway_feedback_is_in_the_loop() -> None:
    without, with_sway = (analyse(registry.find(name)) for name in ("zv", "zv_sway"))
    assert all(with_sway[p].margins != without[p].margins for p in with_sway)
    zvd = analyse(registry.find("zvd"))["near, empty"]
    assert zvd.margins.delay_s == pytest.approx(without["near, empty"].margins.delay_s, rel=1e-2)


def test_a_person_has_no_linear_loop() -> None:
    with pytest.raises(InputError, match="operator_experienced has no linear loop"):
        analyse(registry.find("operator_experienced"))


@pytest.mark.long
def test_an_unstable_loop_is_said_with_its_margin(slewright: Command, tmp_path: Path) -> None:
    file = tmp_path / "loop.json"
    done = slewright("analyse", "parabola", "--gain", "parabola_speed_gain=12", "--json", file)
    assert done.returncode == 1
    assert "unstable: near, empty: grows by" in done.stdout
    assert "delay margin" in done.stdout
    assert json.loads(file.read_text())["stable"] is False


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["pd", "--gain", "pd_gian=1"], "no parameter 'pd_gian'"),
        (["pd", "--gain", "pd_gain"], "NAME=VALUE"),
        (["pd", "--gain", "pd_gain=100"], "outside"),
        (["parabola", "--gain", "parabola_speed_gain=-1"], "parabola_speed_gain = -1: outside 0 … 20"),
        (["pdd"], "no controller 'pdd'"),
        (["nosuch"], "no controller 'nosuch'; valid: pi, pd, "),
    ],
)
def test_wrong_input_is_named(slewright_here: Command, arguments: list[str], message: str) -> None:
    done = slewright_here("analyse", *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) <= 2
