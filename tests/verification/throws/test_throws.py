"""Throws on the reference machine, and their command."""

import json
from pathlib import Path

import numpy as np
import pytest

from slewright.__main__ import run as command
from verification.throws import study
from verification.throws.practice import delay_shown, practised
from verification.throws.run import TICK_S, Case, Track, run
from verification.throws.study import failures, summary


@pytest.mark.slow
@pytest.mark.parametrize("beyond", [-3.0, 2.0])
def test_a_load_lands_near_its_target(beyond: float):
    row = run(Case(beyond))
    assert row["released"]
    assert row["error"] < 0.5
    assert row["speed"] > 1.0  # it was let go on the move


def test_a_grab_that_opens_late_drops_farther_on():
    places = np.stack([np.arange(100) * 0.1, np.zeros(100), np.full(100, 5.0)], axis=1)  # 5 m/s along x
    track = Track(places, released=20)
    (early, speed, first), (late, _, second) = track.landing(0.2), track.landing(0.4)
    assert early == pytest.approx(21 * TICK_S + 0.2)
    assert late - early == pytest.approx(0.2)
    assert speed == pytest.approx(5.0)
    assert second.place[0] - first.place[0] == pytest.approx(1.0)


def test_drawn_machines_have_their_own_delays_loads_and_directions():
    cases = [Case(0.0, f"tuning:{k}") for k in range(20)]
    delays = [case.delay_s for case in cases]
    assert 0.2 <= min(delays) < 0.25 < 0.35 < max(delays) <= 0.4
    assert len({case.load_kg for case in cases}) == len({case.target for case in cases}) == 20
    assert Case(0.0).delay_s == 0.3


def test_what_lands_too_far_on_shows_a_grab_that_opens_late():
    landed = {"released": True, "told_s": 0.3, "aside": 0.4, "speed": 5.0}
    assert delay_shown([landed], [0.0]) == pytest.approx(0.38)
    assert delay_shown([landed, {**landed, "aside": -0.4}], [0.0, 0.1]) == pytest.approx(0.31)
    never = {"released": False, "told_s": 0.3}
    assert delay_shown([never, landed], [9.0, 0.0]) == pytest.approx(0.38)
    assert delay_shown([never], [0.0]) == 0.3  # nothing was learnt
    assert delay_shown([{**landed, "aside": -9.0}], [0.0]) == 0.0  # no grab opens before it is told to


@pytest.mark.slow
def test_a_practice_throw_tells_the_delay_of_its_machine():
    machine = next(m for k in range(99) if abs(Case(0.0, m := f"tuning:{k}").delay_s - 0.3) > 0.08)
    learnt = practised(machine, {}, seed=1, throws=1)
    (row,) = learnt["rows"]
    assert row["told_s"] == 0.3
    assert abs(learnt["told_s"] - row["delay_s"]) < 0.5 * abs(row["told_s"] - row["delay_s"])
    assert Case(0.0, machine, practice=1).load_kg != Case(0.0, machine).load_kg


def test_limits_that_are_missed_are_named():
    figures = {"error": 1.2, "error_delay_known": 0.1, "out": 1.0, "aside": 0.1, "speed": 5.0, "cycle": 9.0}
    row = {"released": True, **figures}
    found = {"2": summary([row]), "0": summary([{"released": False}])}
    assert [text.split(":")[0] for text in failures(found)] == ["2 m beyond reach"] * 2 + ["0 m beyond reach"]


@pytest.mark.slow
def test_the_command_writes_its_figures(tmp_path: Path):
    page = tmp_path / "page.md"
    page.write_text("<!-- throws:begin -->\n<!-- throws:end -->\n")
    assert command(["throw", "--beyond", "0", "--page", str(page), "--json", str(tmp_path / "f.json")]) == 0
    figures = json.loads((tmp_path / "f.json").read_text())
    assert figures["by_distance_m"]["0"]["landed"] == 1
    assert figures["failures"] == []
    assert "beyond reach m" in page.read_text()


def test_an_interrupt_keeps_what_was_thrown_and_leaves_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def thrown(case: Case) -> dict[str, object]:
        if case.beyond:
            raise KeyboardInterrupt
        return {"beyond": 0.0, "machine": case.machine, "released": False}

    monkeypatch.setattr(study, "run", thrown)
    page, figures = tmp_path / "page.md", tmp_path / "f.json"
    page.write_text("<!-- throws:begin -->\nas it was\n<!-- throws:end -->\n")
    asked = ["throw", "--beyond", "0", "--beyond", "1", "--page", str(page), "--json", str(figures)]
    assert command(asked) == 130
    found = json.loads(figures.read_text())
    assert (found["interrupted"], len(found["rows"])) == (True, 1)
    assert "as it was" in page.read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--beyond", "9"], "no throw lands 9 m beyond reach (16.75 m); valid: -8.67 to 2.23 m"),
        (["--beyond", "0", "--beyond", "nan"], "no throw lands nan m beyond reach"),
        (["--draws", "tunings"], "unknown set of draws 'tunings'"),
        (["--machines", "9000"], "9000 machines of set validation: valid are 0 to"),
        (["--sealed", "a purpose"], "--machines 1 to 48"),
        (["--sealed", "a purpose", "--machines", "49"], "49 machines of set test: valid are 0 to 48"),
        (["--draws", "test"], "sealed"),
        (["--page", "x.html"], "valid: .md"),
        (["--sealed", " "], "say what they are opened for"),
    ],
)
def test_wrong_input_is_named(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]):
    assert command(["throw", *arguments]) == 2
    assert message in capsys.readouterr().err
