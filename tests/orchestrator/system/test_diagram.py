"""The picture of a system: every connection is drawn, those that lead back dashed, conversions marked."""

from pathlib import Path
from xml.etree import ElementTree

from orchestrator.system.diagram import draw
from tests.orchestrator.systems import component, connection, connector, load, ssd

SVG = "{http://www.w3.org/2000/svg}"


def test_connections_units_and_ways_back(tmp_path: Path) -> None:
    text = ssd(
        [
            component("speed", "speed", connector("x", "input"), connector("speed", "output")),
            component("position", "position", connector("v", "input"), connector("position", "output")),
        ],
        [
            connection("speed.speed", "position.v"),
            connection("position.position", "speed.x"),
            connection("position.position", "shown"),
        ],
        [connector("shown", "output", unit="mm")],
    )
    picture = draw(load(tmp_path, text, ("position", "speed")))
    root = ElementTree.fromstring(picture)
    paths = {p.findtext(f"{SVG}title"): p.get("class") for p in root.iter(f"{SVG}path")}
    assert set(paths) == {
        "speed.speed → position.v",
        "position.position → speed.x",
        "position.position → system connector shown",
    }
    assert sorted(filter(None, paths.values())) == ["back", "changed"]
    assert paths["position.position → system connector shown"] == "changed"
    texts = [t.text for t in root.iter(f"{SVG}text")]
    assert {"position [m]", "shown [mm]", "v [m/s]"} <= set(texts)
    assert draw(load(tmp_path, text, ("position", "speed"))) == picture


def test_a_long_name_fits_its_box(tmp_path: Path) -> None:
    name = "a_component_whose_name_is_long"
    part = component(name, "speed", connector("speed", "output"))
    text = ssd([part], [connection(f"{name}.speed", "shown")], [connector("shown", "output")])
    root = ElementTree.fromstring(draw(load(tmp_path, text, ("speed",))))
    first = next(r for r in root.iter(f"{SVG}rect") if r.get("class") == "box")
    assert float(first.get("width", 0)) >= 8.2 * len(name)  # of a bold character
