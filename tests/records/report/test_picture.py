"""The picture for the README."""

import xml.etree.ElementTree as ET

import pytest

from records.report.figures import STYLES
from records.report.picture import write_picture
from tests.records.runs import runs

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    path = tmp_path_factory.mktemp("picture") / "docs" / "run.svg"
    write_picture(path, runs()["four_targets_empty"], "Four targets & an empty grab")
    return path


def test_it_is_svg_with_three_curves_a_system(drawn):
    root = ET.parse(drawn).getroot()
    lines = [e.get("stroke") for e in root.iter(f"{SVG}polyline")]
    for look in STYLES.values():
        assert lines.count(look.color) == 3
    texts = [e.text for e in root.iter(f"{SVG}text")]
    for text in ("Four targets & an empty grab", "Time [s]", "Tool rate [°/s]", "x [m]", "4"):
        assert text in texts


def test_everything_lies_within_the_picture(drawn):
    root = ET.parse(drawn).getroot()
    _, _, width, height = map(float, (root.get("viewBox") or "").split())
    for line in root.iter(f"{SVG}polyline"):
        for point in (line.get("points") or "").split():
            x, y = map(float, point.split(","))
            assert 0 <= x <= width
            assert 0 <= y <= height


def test_it_is_small_and_needs_nothing_else(drawn):
    text = drawn.read_text()
    assert len(text) < 100_000
    assert "href" not in text
    assert "script" not in text
