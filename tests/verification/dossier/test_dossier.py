"""The validation dossier: a run with reduced effort, and what its verdicts and tables rest on."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specs import draws as draws_spec, parameters as parameter_specs
from specs.draws import Spread
from tests.conftest import ROOT
from verification.dossier import (
    Effort,
    draw_tables,
    draws,
    halving,
    machine,
    page,
    parameters,
    physics,
    steps,
    trust,
)
from verification.dossier.markdown import chapter, number, table
from verification.dossier.page import run
from verification.dossier.section import Check
from verification.dossier.svg import ticks
from verification.dossier.trust import Settled

LEAST = Effort(scenarios=("four_targets_empty",), machines=1)
SHORT = {"REST_S": 5.0, "SWING_S": 20.0, "BALANCE_S": 4.0, "FINEST": 1.25e-4}  # runs of the physics chapter
TITLES = (
    "What it is calibrated on",
    "Which parameters the traces identify",
    "Residuals by regime and direction",
    "Where the traces cannot be trusted",
    "The machine against the step traces",
    "Physics checks",
    "How the machines are re-drawn",
)


@dataclass(frozen=True)
class Written:
    """A dossier on disk: page, its text, the figures and the sets that were drawn from."""

    out: Path
    html: Path
    text: str
    figures: dict[str, Any]
    drawn: set[str]


@pytest.fixture(scope="module")
def short() -> Iterator[None]:
    """Fewer commands and shorter runs than a dossier has that is published."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in SHORT.items():
            patch.setattr(physics, name, value)
        patch.setattr(steps, "COMMANDS", steps.COMMANDS[::3])
        patch.setattr(draws, "COMMANDS", draws.COMMANDS[:1])
        yield


@pytest.fixture(scope="module")
def written(short: None, tmp_path_factory: pytest.TempPathFactory) -> Written:
    out = tmp_path_factory.mktemp("dossier") / "page.md"
    drawn: set[str] = set()
    draw = draws_spec.draw
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(draws_spec, "draw", lambda name, *rest: drawn.add(name) or draw(name, *rest))
        figures = run(out, page=out.with_suffix(".html"), effort=LEAST)
    return Written(out, out.with_suffix(".html"), out.read_text(encoding="utf-8"), figures, drawn)


@pytest.mark.long
def test_the_page_has_every_chapter_and_says_what_it_is_about(written: Written) -> None:
    assert "simulated reference machine" in written.text
    for i, title in enumerate(TITLES, 1):
        assert f"\n## {i}. {title}\n" in written.text
        assert f"(#{i}-" in written.text
    assert "{" not in written.text


@pytest.mark.long
def test_every_picture_is_shown_and_is_valid_svg(written: Written) -> None:
    pictures = sorted(written.out.with_suffix("").glob("*.svg"))
    assert len(pictures) == 8
    for picture in pictures:
        assert f"({written.out.stem}/{picture.name})" in written.text
        root = ET.parse(picture).getroot()
        assert "nan" not in picture.read_text(encoding="utf-8")
        assert len(list(root)) > 5


@pytest.mark.long
def test_the_html_page_carries_its_pictures(written: Written) -> None:
    html = written.html.read_text(encoding="utf-8")
    assert html.count("<svg") == 8
    assert "<img" not in html
    assert "<table>" in html


@pytest.mark.long
def test_all_figures_are_finite(written: Written) -> None:
    bad = [path for path, value in _numbers(written.figures) if not math.isfinite(value)]
    assert not bad


@pytest.mark.long
def test_verdicts_follow_from_the_figures(written: Written) -> None:
    checks = written.figures["checks"]
    for name, check in checks.items():
        inside = check["found"] >= check["limit"] if check["at_least"] else check["found"] <= check["limit"]
        assert check["passed"] == inside, name
    judged = [c["passed"] for c in checks.values() if c["judged"]]
    assert written.figures["accepted"] == all(judged)
    calibration = written.figures["calibration"]
    assert checks["speed, mean absolute error"]["found"] == calibration["velocity_mae_deg_s"]


@pytest.mark.long
def test_the_page_shows_the_figures(written: Written) -> None:
    calibration, order = written.figures["calibration"], written.figures["physics"]["order"]["order"]
    assert f"| {calibration['velocity_mae_deg_s']:.2f} °/s | ≤ 2 °/s |" in written.text
    assert f"falls with order {order:.2f}" in " ".join(written.text.split())
    for step in written.figures["steps"]["steps"]:
        assert (
            f"| {step['command']:g} | speed before release [°/s] | {step['traces']['speed_deg_s']:.1f} |"
            in written.text
        )


@pytest.mark.long
def test_the_sealed_set_is_never_drawn(written: Written) -> None:
    assert written.drawn == {"tuning", "validation"}


@pytest.mark.long
def test_again_gives_the_same_bytes(written: Written, tmp_path: Path) -> None:
    again = tmp_path / "page.md"
    (tmp_path / "page").mkdir()
    (tmp_path / "page" / "old.svg").write_text("of an earlier page")
    (tmp_path / "page" / "notes.txt").write_text("somebody's")
    figures = run(again, effort=LEAST)
    assert again.read_bytes() == written.out.read_bytes()
    first, second = (sorted(p.with_suffix("").glob("*.svg")) for p in (written.out, again))
    assert [p.name for p in first] == [p.name for p in second]
    assert all(a.read_bytes() == b.read_bytes() for a, b in zip(first, second, strict=True))
    assert (tmp_path / "page" / "notes.txt").is_file()
    assert figures == written.figures


def test_the_page_in_docs_is_of_this_machine() -> None:
    text = (ROOT / "docs" / "results" / "dossier.md").read_text(encoding="utf-8")
    prints = [parameters.fingerprint(), *(draws.fingerprint(name) for name in draws.OPEN)]
    assert all(f"`{p}`" in text for p in prints), (
        "machine or draws have changed: run `python -m benchmarks dossier`"
    )


def test_the_step_pose_has_the_inertia_asked_for() -> None:
    from fmus.equations import kinematics

    at = machine.pose(400e3)
    p = kinematics.geometry()
    assert float(kinematics.inertia_z(at.q_boom, at.q_stick, 0.0, p)) == pytest.approx(400e3, rel=1e-9)
    assert kinematics.arm_tip(at.q_boom, at.q_stick, p)[1] - p.tool_length == pytest.approx(6.0)


def test_expected_swing_is_that_of_a_point_mass_pendulum() -> None:
    values = {
        "grab_com": 2.0,
        "grab_gyration": 0.0,
        "grab_offset": 0.0,
        "grab_damping_roll": 0.0,
        "gravity": 9.81,
    }
    found = physics.expected_swing("roll", values)
    assert found["length_m"] == pytest.approx(2.0)
    assert found["period_expected_s"] == pytest.approx(2 * math.pi * math.sqrt(2.0 / 9.81))
    assert found["decay_expected_1_s"] == 0.0


def test_a_metric_that_moves_too_far_is_missed() -> None:
    row = {"whole": 10.0, "half": 10.2, "allowed": 0.1, "passed": False}
    found = {"scenarios": {"s": {"speed": row, "tool": {**row, "half": 10.0, "passed": True}}}}
    check = halving.check(found)
    assert check.found == 1
    assert not check.passed


@pytest.mark.parametrize(("found", "passed"), [(1.0, True), (1.01, False)])
def test_a_check_says_met_or_missed(found: float, passed: bool) -> None:
    check = Check("x", found, 1.0, "m")
    assert check.passed == passed
    assert check.row[-1] == ("met" if passed else "**missed**")
    assert replace(check, judged=False).row[-1] == "not judged"


def test_less_speed_for_more_joystick_is_found() -> None:
    def step(command: float, speed: float, inertia: float = 700e3) -> Settled:
        return Settled(inertia, command, (speed, speed), 10.0, speed)

    steps = [step(0.7, 40.0, 550e3), step(0.5, 20.0), step(0.7, 28.0), step(1.0, 26.5)]
    assert trust.falling(steps) == [{"inertia_kg_m2": 700e3, "command": 1.0, "less_by_deg_s": 1.5}]


@pytest.mark.parametrize(
    ("speeds", "doubtful"), [((5.0, 6.0), False), ((5.0, 8.0), True), ((47.0, 53.0), False)]
)
def test_directions_that_differ_too_much_are_doubtful(speeds: tuple[float, float], doubtful: bool) -> None:
    assert Settled(250e3, 0.5, speeds, 10.0, 5.0).doubtful == doubtful


def test_a_spread_off_its_nominal_value_and_a_range_not_covered_are_said() -> None:
    known = parameter_specs.load(*draws_spec.FILES)
    nominal = known["slew_dead_band"].value
    spreads = dict(draws_spec.spreads())
    assert draws.outside(spreads, known) == []
    spreads["slew_dead_band"] = Spread(
        parameters=("slew_dead_band",),
        reason="test",
        status="assumed",
        low=nominal + 0.01,
        high=nominal + 0.02,
    )
    assert draws.outside(spreads, known) == ["slew_dead_band"]
    rows = {r["name"]: r["covered"] for r in draws.coverage(spreads, known)}
    assert not rows["slew_dead_band"]
    assert rows["slew_boost_pressure"]


def test_the_shipped_spreads_cover_the_known_ranges() -> None:
    known = parameter_specs.load(*draws_spec.FILES)
    assert all(row["covered"] for row in draws.coverage(draws_spec.spreads(), known))


@pytest.mark.parametrize(("share", "said"), [(-0.12, "not centred"), (0.01, "is off the nominal")])
def test_a_bias_of_the_draws_is_said(share: float, said: str) -> None:
    assert said in draw_tables.bias_sentence({"tuning": share, "validation": 0.0})


def test_paragraphs_are_wrapped_and_tables_are_not() -> None:
    wide = table(("a", "b"), [["x" * 80, "y" * 80]])
    text = chapter(
        "page",
        title="T",
        version="1",
        verdict="word " * 60,
        checks=wide,
        contents="1. [T](#t)",
        chapters="## 1. T",
    )
    assert wide in text
    assert max(len(line) for line in text.splitlines() if line.startswith("word")) <= 100


def test_numbers_and_ticks_are_readable() -> None:
    assert number(-1.234, 1) == "−1.2"
    assert number(0.0001, 2) == "1.0e−04"
    assert list(ticks((0.0, 55.0), 6)) == [0, 10, 20, 30, 40, 50]
    assert table(("a", "b"), [["x|y", "1"]]).splitlines()[1:] == ["| --- | ---: |", "| x\\|y | 1 |"]


def test_pictures_are_replaced_in_the_html_page() -> None:
    from verification.dossier.section import Section

    section = Section("k", "T", "", {}, {"a.svg": "<svg><title>one</title></svg>"})
    html = page.as_html("![c](PICTURES/a.svg)\n", [section])
    assert "<svg><title>one</title></svg>" in html


def _numbers(value: Any, path: str = "") -> Iterator[tuple[str, float]]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _numbers(item, f"{path}.{key}")
    elif isinstance(value, list | tuple | np.ndarray):
        for i, item in enumerate(value):
            yield from _numbers(item, f"{path}[{i}]")
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path, float(value)
