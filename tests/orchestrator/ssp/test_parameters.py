"""Parameter values in a system description: what is taken over, and what is refused."""

import shutil
from pathlib import Path

import pytest

from orchestrator.system.check import load_system
from tests.orchestrator.systems import (
    chain,
    fmu,
    load,
    refused,
)


def bound(binding: str, at_system: str = "") -> str:
    """The chain with parameter values on `position`, and on the system."""

    def holder(values: str) -> str:
        parameters = f"<ssv:Parameters>{values}</ssv:Parameters>"
        return (
            "<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>"
            f'<ssv:ParameterSet version="1.0" name="p">{parameters}</ssv:ParameterSet>'
            "</ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"
        )

    parts = chain().rsplit("</ssd:Connectors></ssd:Component>", 1)
    text = f"</ssd:Connectors>{holder(binding)}</ssd:Component>".join(parts)
    return (
        text.replace("\n    <ssd:Elements>", f"{holder(at_system)}\n    <ssd:Elements>", 1)
        if at_system
        else text
    )


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("strat", '<ssv:Real value="1"/>', "component position has no parameter 'strat'; did you mean start"),
        ("start", '<ssv:Real value="99"/>', "position.start = 99 m is out of bounds; valid: -10 … 10 m"),
        ("start", '<ssv:Real value="1" unit="K"/>', "a unit that does not fit m"),
        ("start", '<ssv:Real value="1" unit="ell"/>', "undefined unit 'ell'"),
        ("start", '<ssv:Real value="one"/>', "value='one' is not a number"),
        ("start", '<ssv:String value="one"/>', "values of type String are not supported"),
        ("position", '<ssv:Real value="1"/>', "component position has no parameter 'position'"),
    ],
)
def test_wrong_parameter_bindings(tmp_path: Path, name: str, value: str, words: str) -> None:
    text = bound(f'<ssv:Parameter name="{name}">{value}</ssv:Parameter>')
    message = refused(tmp_path, text, ["decay", "position"])
    assert words in message
    assert "line " in message


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("positon.start", "names no component; did you mean position"),
        ("plaice", "names no connector of the system"),
    ],
)
def test_wrong_parameter_bindings_of_the_system(tmp_path: Path, name: str, words: str) -> None:
    text = bound("", f'<ssv:Parameter name="{name}"><ssv:Real value="1"/></ssv:Parameter>')
    assert words in refused(tmp_path, text, ["decay", "position"])


def test_files_outside_of_the_package_are_refused(tmp_path: Path) -> None:
    text = chain()
    end = "</ssd:Connectors></ssd:Component>"
    for attributes, inner, words in (
        ('source="../x.ssv"', "", "source '../x.ssv' is not inside the package"),
        ('source="a.ssv" type="text/csv"', "", "binding of type 'text/csv'; valid: application/x-ssp-par"),
        ("", "<ssd:ParameterMapping/>", "neither 'source' nor <ParameterSet> is there"),
    ):
        binding = f"<ssd:ParameterBinding {attributes}>{inner}</ssd:ParameterBinding>"
        holder = f"</ssd:Connectors><ssd:ParameterBindings>{binding}</ssd:ParameterBindings></ssd:Component>"
        assert words in refused(tmp_path, text.replace(end, holder, 1), ["decay", "position"])


def test_values_are_converted_and_outer_ones_win(tmp_path: Path) -> None:
    inner = '<ssv:Parameter name="start"><ssv:Real value="1500" unit="mm"/></ssv:Parameter>'
    outer = '<ssv:Parameter name="position.start"><ssv:Real value="7"/></ssv:Parameter>'
    system = load(tmp_path, bound(inner), ["decay", "position"])
    assert system.components["position"].start == {"start": pytest.approx(1.5)}
    system = load(tmp_path, bound(inner, outer), ["decay", "position"])
    assert system.components["position"].start == {"start": 7.0}


def test_parameter_files_are_read_from_the_package(tmp_path: Path) -> None:
    folder = tmp_path / "open"
    (folder / "resources").mkdir(parents=True)
    for name in ("decay", "position"):
        shutil.copy(fmu(name), folder / "resources")
    namespace = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
    (folder / "resources" / "p.ssv").write_text(
        f'<ParameterSet xmlns="{namespace}" version="1.0" name="p">'
        '<Parameters><Parameter name="start"><Real value="2.5"/></Parameter></Parameters></ParameterSet>'
    )
    parts = chain().rsplit("</ssd:Connectors></ssd:Component>", 1)
    binding = '<ssd:ParameterBinding source="resources/p.ssv"/>'
    holder = f"</ssd:Connectors><ssd:ParameterBindings>{binding}</ssd:ParameterBindings></ssd:Component>"
    (folder / "open.ssd").write_text(holder.join(parts))
    assert load_system(folder / "open.ssd").components["position"].start == {"start": 2.5}
