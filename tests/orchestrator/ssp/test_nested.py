"""Systems in systems, in one file and in others: flattened to components named by their path."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from orchestrator.run.simulate import simulate
from orchestrator.ssp.description import Port
from orchestrator.system.check import load_system
from orchestrator.system.system import System
from specs.errors import InputError
from tests.orchestrator.ssp.test_bad_ssd import line_of
from tests.orchestrator.systems import OSCILLATOR, component, connection, connector, fmu, load, refused, ssd
from tests.verification.comparison.paper import load_package, package

NAMES = ["position", "speed"]
FMUS = {name: fmu(name) for name in NAMES}
POSITION = component(
    "position", "position", connector("v", "input", unit="m/s"), connector("position", "output")
)
SPEED = component("speed", "speed", connector("x", "input", unit="m"), connector("speed", "output"))
OUTPUTS = [connector("place", "output", unit="m"), connector("pace", "output", unit="m/s")]


def system(
    name: str, connectors: list[str], elements: list[str], connections: list[str], more: str = ""
) -> str:
    """A system element."""
    return (
        f'<ssd:System name="{name}"{more}>\n<ssd:Connectors>{"".join(connectors)}</ssd:Connectors>\n'
        f"<ssd:Elements>{''.join(elements)}</ssd:Elements>\n"
        "<ssd:Connections>\n" + "\n".join(connections) + "\n</ssd:Connections></ssd:System>"
    )


INNER = system(
    "cart",
    [connector("drive", "input", unit="m/s"), connector("where", "output", unit="mm")],
    [POSITION],
    [connection("drive", "position.v"), connection("position.position", "where")],
)
LINKS = [
    connection("speed.speed", "cart.drive"),
    connection("cart.where", "speed.x"),
    connection("cart.where", "place"),
    connection("speed.speed", "pace"),
]
NESTED = ssd([INNER, SPEED], LINKS, OUTPUTS)


def place(system: System) -> np.ndarray:
    return simulate(system, 200).column("place")


def test_an_embedded_system_gives_what_the_flat_one_gives(tmp_path: Path) -> None:
    flat, nested = load(tmp_path, OSCILLATOR, NAMES), load(tmp_path, NESTED, NAMES)
    assert list(nested.components) == ["cart.position", "speed"]
    assert [(link.source, link.target) for link in nested.links] == [
        (Port("speed", "speed"), Port("cart.position", "v")),
        (Port("cart.position", "position"), Port("speed", "x")),
    ]
    np.testing.assert_allclose(place(nested), place(flat), rtol=1e-12)


def test_units_of_connectors_on_the_way_count(tmp_path: Path) -> None:
    """Without conversion from mm back to m the place would be a thousand times what it is."""
    text = NESTED.replace(LINKS[2], connection("cart.where", "place", suppressUnitConversion="true"))
    nested = load(tmp_path, text, NAMES)
    assert nested.outputs["place"].link.conversion.affine.scale == pytest.approx(1000.0)
    assert nested.links[1].conversion.affine.scale == pytest.approx(1.0)


def test_names_with_dots_are_split_at_the_component(tmp_path: Path) -> None:
    nested = load(tmp_path, NESTED, NAMES)
    assert nested.split("cart.position.start")[1] == "start"
    assert nested.start_values({"cart.position.start": 3.0})["cart.position"] == {"start": 3.0}
    with pytest.raises(
        InputError, match=r"component cart.position has no parameter 'strat'; did you mean start"
    ):
        nested.start_values({"cart.position.strat": 3.0})


def referring(type_: str, source: str, *, connectors: str = "") -> str:
    """The oscillator with its cart in another file."""
    connectors = connectors or connector("drive", "input") + connector("where", "output")
    cart = (
        f'<ssd:Component name="cart" type="application/x-ssp-{type_}" source="{source}">'
        f"<ssd:Connectors>{connectors}</ssd:Connectors></ssd:Component>"
    )
    return ssd([cart, SPEED], LINKS, OUTPUTS)


def alone(inner: str, **attributes: str) -> str:
    """A description of one system and nothing else."""
    text = ssd([], step="", **attributes)
    start, end = text.index("<ssd:System "), text.index("</ssd:System>") + len("</ssd:System>")
    return text[:start] + inner + text[end:]


def test_a_system_from_another_description(tmp_path: Path) -> None:
    inner = alone(INNER.replace("resources/position.fmu", "../resources/position.fmu"))
    found = load_package(tmp_path, {"other/cart.ssd": inner}, referring("definition", "other/cart.ssd"), FMUS)
    assert list(found.components) == ["cart.position", "speed"]
    np.testing.assert_allclose(place(found), place(load(tmp_path, OSCILLATOR, NAMES)), rtol=1e-12)


@pytest.mark.parametrize(("fragment", "entry"), [("", "SystemStructure.ssd"), ("#B.ssd", "B.ssd")])
def test_a_system_from_another_package(tmp_path: Path, fragment: str, entry: str) -> None:
    path = tmp_path / "cart.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", "<nothing/>") if fragment else None
        archive.writestr(entry, alone(INNER))
        archive.write(fmu("position"), "resources/position.fmu")
    text = referring("package", f"resources/cart.ssp{fragment}")
    found = load_package(tmp_path, {"resources/cart.ssp": path.read_bytes()}, text, {"speed": fmu("speed")})
    np.testing.assert_allclose(place(found), place(load(tmp_path, OSCILLATOR, NAMES)), rtol=1e-12)


def test_one_definition_used_twice(tmp_path: Path) -> None:
    twin = '<ssd:Component name="twin" type="application/x-ssp-definition" source="#cart"/>'
    text = ssd(
        [INNER.replace('name="cart"', 'name="cart" id="cart"'), twin, SPEED], LINKS, OUTPUTS, version="2.0"
    )
    assert list(load(tmp_path, text, NAMES).components) == ["cart.position", "twin.position", "speed"]


def test_a_system_that_contains_itself(tmp_path: Path) -> None:
    for text, files in (
        (referring("definition", "a.ssd"), {"a.ssd": referring("definition", "a.ssd")}),
        (referring("definition", "SystemStructure.ssd"), {}),
    ):
        with pytest.raises(InputError) as caught:
            load_system(package(tmp_path, dict(files), text, FMUS))
        assert "contains itself: SystemStructure.ssd → " in str(caught.value)
        assert f"line {line_of(text, 'x-ssp-definition')}:" in str(caught.value)


def test_what_does_not_fit_a_referred_system(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {"cart.ssd": alone(INNER.replace("resources/", "resources/"))}
    drive = connector("drive", "input")
    for text, words in (
        (referring("definition", "cart.ssd", connectors=drive + connector("were", "output")),
         "cart.were: the system has no such connector; did you mean where"),
        (referring("definition", "cart.ssd", connectors=drive + connector("where", "input")),
         "cart.where is declared input, but is output in the system"),
        (referring("definition", "cart.ssd#front"), "no system has the id 'front'"),
        (referring("definition", "card.ssd"), "'card.ssd' of component 'cart' is missing"),
        (referring("definition", "../cart.ssd"), "source '../cart.ssd' of component 'cart' is not inside"),
        (referring("package", "resources/position.fmu"), "SystemStructure.ssd' of component 'cart' is"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=words.replace("(", r"\(")):
            load_system(package(tmp_path, files, text, FMUS))


def test_systems_nested_too_deeply(tmp_path: Path) -> None:
    inner = SPEED
    for level in range(40):
        inner = system(f"s{level}", [], [inner], [])
    assert "systems are nested more than 32 deep" in refused(tmp_path, ssd([inner]), NAMES)


def test_growth_by_reference_is_bounded(tmp_path: Path) -> None:
    """Files that each use the next one ten times: a few kB that would unfold to a million systems."""
    files: dict[str, str | bytes] = {}
    for level in range(6):
        uses = "".join(
            f'<ssd:Component name="u{i}" type="application/x-ssp-definition" source="f{level + 1}.ssd"/>'
            for i in range(10)
        )
        files[f"f{level}.ssd"] = alone(system("s", [], [uses if level < 5 else ""], []))
    text = ssd(['<ssd:Component name="a" type="application/x-ssp-definition" source="f0.ssd"/>'])
    with pytest.raises(InputError, match="has more than 10000 elements"):
        load_system(package(tmp_path, files, text, FMUS))


def test_cyclic_connections_name_their_members(tmp_path: Path) -> None:
    through = system("loop", [connector("a", "input"), connector("b", "output")], [], [connection("a", "b")])
    links = [connection("loop.b", "loop.a")]
    message = refused(tmp_path, ssd([through, SPEED], links, []), NAMES)
    assert "cyclic connections: loop.b → loop.a → loop.b" in message or (
        "cyclic connections: loop.a → loop.b → loop.a" in message
    )
    assert "line " in message


def test_an_output_that_nothing_inside_feeds(tmp_path: Path) -> None:
    text = NESTED.replace(connection("position.position", "where"), "")
    message = refused(tmp_path, text, NAMES)
    assert "cart.where is connected to speed.x, but nothing inside of it gives it a value" in message
    assert f"line {line_of(text, LINKS[1])}:" in message


def test_a_second_source_from_inside(tmp_path: Path) -> None:
    again = connection("drive", "position.v")
    text = NESTED.replace(again, f"{again}\n{again}")
    message = refused(tmp_path, text, NAMES)
    first = line_of(text, again)
    assert (
        f"line {first + 1}: cart.position.v has a second source; the first is connected in line {first}"
        in message
    )


def test_loose_ends_are_warned_of(tmp_path: Path) -> None:
    text = NESTED.replace(connection("drive", "position.v"), "")
    warnings = load(tmp_path, text, NAMES).warnings
    assert any("what is connected to cart.drive leads nowhere" in w for w in warnings)
    assert "input cart.position.v is not connected and keeps its start value 0.25" in warnings


def test_connections_that_the_standard_forbids(tmp_path: Path) -> None:
    parameter = system("p", [connector("rate", "parameter")], [], [])
    for connectors, links, words in (
        ([connector("u", "input")], [connection("u", "p.rate")],
         "system connector u (input) cannot be connected to p.rate (parameter)"),
        ([connector("w", "output")], [connection("p.rate", "w")],
         "p.rate and system connector w are both targets"),
    ):  # fmt: skip
        message = refused(tmp_path, ssd([parameter, SPEED], links, connectors), NAMES)
        assert words in message


def test_a_component_without_implementation(tmp_path: Path) -> None:
    connectors = f"<ssd:Connectors>{connector('y', 'output')}</ssd:Connectors>"
    ghost = f'<ssd:Component name="ghost">{connectors}</ssd:Component>'
    text = ssd([ghost, SPEED], [connection("ghost.y", "speed.x")], version="2.0")
    warnings = load(tmp_path, text, NAMES).warnings
    assert any("component 'ghost' has no implementation: it is left out" in w for w in warnings)
    assert any(w.startswith("input speed.x is not connected") for w in warnings)
    old = text.replace('version="2.0"', 'version="1.0"')
    assert "<Component> has no 'source'" in refused(tmp_path, old, NAMES)


def test_punned_names_are_refused_for_components(tmp_path: Path) -> None:
    text = ssd([INNER, POSITION.replace('name="position"', 'name="cart.position"', 1)])
    assert "a second component has the path 'cart.position'" in refused(tmp_path, text, NAMES)
