"""The system definitions and the SSDs generated from them."""

from pathlib import Path

import fmpy
import pytest
from lxml import etree

from specs import ssd, systems
from specs.errors import InputError
from specs.signals import signal
from specs.units import UNITS

SCHEMA = Path(fmpy.__file__).parent / "ssp" / "schema" / "SystemStructureDescription.xsd"
SSC = "{http://ssp-standard.org/SSP1/SystemStructureCommon}"


@pytest.mark.parametrize("name", ["nominal", "reference"])
@pytest.mark.parametrize("version", [2, 3])
def test_the_official_schema_accepts_them(name: str, version: ssd.FmiVersion) -> None:
    """SSP 2.0 has the structure of 1.0 and more type names, which are mapped: only 1.0's schema is here."""
    text = ssd.render(systems.load(name), version)
    if version == 3:
        assert 'version="2.0"' in text
        text = text.replace('version="2.0"', 'version="1.0"').replace("ssc:Float64", "ssc:Real")
    schema = etree.XMLSchema(etree.parse(SCHEMA))
    assert schema.validate(etree.fromstring(text.encode())), schema.error_log


@pytest.mark.parametrize("name", ["nominal", "reference"])
def test_every_connector_has_the_unit_of_its_signal(name: str) -> None:
    root = etree.fromstring(ssd.render(systems.load(name), 2).encode())
    connectors = list(root.iterfind(".//{*}Connector"))
    assert connectors
    for connector in connectors:
        assert connector[0].get("unit") == signal(str(connector.get("name"))).unit
    bases = {u.get("name"): u[0].attrib for u in root.iterfind(".//{*}Units/{*}Unit")}
    assert set(bases) == {c[0].get("unit") for c in connectors}
    for unit, base in bases.items():
        assert float(base.get("factor", 1)) == UNITS[str(unit)].factor
        assert {k: int(v) for k, v in base.items() if k not in ("factor", "offset")} == UNITS[
            str(unit)
        ].exponents


def test_both_systems_show_the_controller_and_the_metrics_the_same_connectors() -> None:
    nominal, reference = systems.load("nominal"), systems.load("reference")
    common = {"target_x", "target_y", "target_z", "load_told", "pace"}
    assert common <= set(nominal.inputs) & set(reference.inputs)
    true = {f"true_{q}_{j}" for q in ("q", "qd") for j in ("slew", "boom", "stick", "tool_x", "tool_y")}
    true |= {f"true_tool_{axis}" for axis in "xyz"} | {"true_p_slew_a", "true_p_slew_b"}
    shared = true | {"u_slew", "qd_boom_ref", "qd_stick_ref", "q_slew", "qd_slew", "q_boom", "q_stick"}
    assert shared <= set(nominal.outputs) & set(reference.outputs)
    assert {n for n in nominal.inputs if n.startswith("disturbance")} == {
        n for n in reference.inputs if n.startswith("disturbance")
    }
    for mine, theirs in zip(nominal.connectors("pi"), reference.connectors("pi"), strict=True):
        assert set(mine) == set(theirs)


def test_controllers_of_the_reference_system_read_sensors_only() -> None:
    spec = systems.load("reference")
    for component in ("pi", "arm_velocity"):
        assert not [n for n in spec.connectors(component)[0] if n.startswith("true_")]
    assert {signal(c.source.name).kind for c in spec.offered} == {"sensor"}


def test_a_model_in_a_controllers_place_gets_what_is_offered_and_it_wants() -> None:
    nominal, reference = systems.load("nominal"), systems.load("reference")
    offers = [{c.target.name for c in spec.offered} for spec in (nominal, reference)]
    assert offers[0] == offers[1]
    wanted = nominal.fitted("pi", {"q_slew", "imu_tool_roll"})
    assert set(wanted.connectors("pi")[0]) - set(nominal.connectors("pi")[0]) == {"imu_tool_roll"}
    assert wanted.connectors("tool")[1] == (*nominal.connectors("tool")[1],)
    assert nominal.fitted("slew", {"q_slew"}) == nominal


def test_inputs_that_are_opened_are_set_from_outside_and_nothing_else_changes() -> None:
    spec = systems.load("reference")
    opened = spec.opened("machine", {"u_slew": "joystick"})
    changed = [(a, b) for a, b in zip(spec.connections, opened.connections, strict=True) if a != b]
    assert [(b.source.component, b.source.name) for _, b in changed] == [("", "joystick")]
    assert changed[0][0].target == changed[0][1].target
    assert changed[0][0].target.name == "u_slew"


def test_the_step_and_the_algorithm_are_in_our_annotation() -> None:
    root = etree.fromstring(ssd.render(systems.load("nominal"), 3).encode())
    annotation = root.find(f"{{*}}Annotations/{SSC}Annotation")
    assert annotation is not None
    assert annotation.get("type") == ssd.ANNOTATION
    assert dict(annotation[0].attrib) == {"stepSize": "0.02", "algorithm": "jacobi"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"inputs": {"hand": ["u_slew"]}}, "no component 'hand'"),
        ({"inputs": {"system": ["q_slew as u_slew"]}}, r"q_slew \[rad\] does not fit u_slew \[1\]"),
        ({"inputs": {"system": ["u_slew", "u_boom as u_slew"]}}, "slew.u_slew has two sources"),
        ({"inputs": {"system": ["u_slow"]}}, "u_slow.*u_slew"),
    ],
)
def test_wrong_definitions_are_refused(change: dict, words: str) -> None:
    data = {
        "description": "test",
        "step_s": 0.02,
        "stop_s": 1.0,
        "components": {"slew": {"fmu": "slew", **change}},
        "outputs": {},
    }
    with pytest.raises(InputError, match=words):
        systems.parse("test", data)


def test_an_unknown_system_is_named_with_the_nearest() -> None:
    with pytest.raises(InputError, match="no system 'nominel'; did you mean nominal"):
        systems.load("nominel")
