"""Parameter values: precedence, prefixes, mappings, types, arrays, and connections that carry them."""

import zipfile
from pathlib import Path

import pytest

from orchestrator.system.check import load_system
from orchestrator.system.system import System
from specs.errors import InputError
from tests.orchestrator.ssp.test_nested import system
from tests.orchestrator.ssp.test_transformations import mapping
from tests.orchestrator.systems import component, connection, connector, ssd
from tests.verification.comparison.paper import load_package, package, paper

SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSM = "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
UNITS = (
    f'<Units xmlns:ssc="{SSC}"><ssc:Unit name="degC"><ssc:BaseUnit K="1" offset="273.15"/></ssc:Unit>'
    '<ssc:Unit name="deg"><ssc:BaseUnit rad="1" factor="0.017453292519943295"/></ssc:Unit></Units>'
)
MODEL = """
<Float64 name="gain" valueReference="1" causality="parameter" variability="tunable" start="1" min="-5"
max="5"/>
<Float64 name="heat" valueReference="2" causality="parameter" variability="fixed" unit="K" start="300"/>
<Int8 name="small" valueReference="3" causality="parameter" variability="fixed" start="1"/>
<UInt64 name="large" valueReference="4" causality="parameter" variability="fixed" start="1"/>
<Boolean name="on" valueReference="5" causality="parameter" variability="fixed" start="false"/>
<String name="label" valueReference="6" causality="parameter" variability="fixed"><Start value="x"/></String>
<Binary name="blob" valueReference="7" causality="parameter" variability="fixed" maxSize="4">
<Start value="00"/></Binary>
<Enumeration name="gear" valueReference="8" causality="parameter" variability="fixed" declaredType="Gear"
start="1"/>
<UInt64 name="n" valueReference="9" causality="structuralParameter" variability="fixed" start="2"/>
<Float64 name="row" valueReference="10" causality="parameter" variability="fixed" start="1 2">
<Dimension valueReference="9"/></Float64>
<Float64 name="u" valueReference="11" causality="input" start="0.5"/>
<Float64 name="y" valueReference="12" causality="output"/>
<Float64 name="state" valueReference="13" causality="local" variability="continuous" initial="exact"
start="3"/>
<Float64 name="g" valueReference="14" causality="calculatedParameter" variability="fixed"/>
<Float64 name="two" valueReference="15" causality="output" variability="constant" start="2"/>
<Float64 name="wave" valueReference="16" causality="input" start="0 0">
<Dimension valueReference="9"/></Float64>
"""


def parameter_set(values: str, attributes: str = 'version="2.0"') -> str:
    inner = f"<Parameters>{values}</Parameters>{UNITS}"
    return f'<ParameterSet xmlns="{SSV}" {attributes} name="p">{inner}</ParameterSet>'


def value(name: str, type_: str, text: str, unit: str = "", dimensions: tuple[int, ...] = ()) -> str:
    unit = f' unit="{unit}"' if unit else ""
    sizes = "".join(f'<ssc:Dimension xmlns:ssc="{SSC}" size="{size}"/>' for size in dimensions)
    return f'<Parameter name="{name}"><{type_} value="{text}"{unit}/>{sizes}</Parameter>'


def inline(values: str, mapped: str = "", **attributes: str) -> str:
    more = "".join(f' {k}="{v}"' for k, v in attributes.items())
    return (
        f"<ssd:ParameterBinding{more}><ssd:ParameterValues>{parameter_set(values)}</ssd:ParameterValues>"
        f"{mapped}</ssd:ParameterBinding>"
    )


def mapped(entries: str) -> str:
    return (
        f'<ssd:ParameterMapping><ParameterMapping xmlns="{SSM}" xmlns:ssc="{SSC}" version="2.0">{entries}'
        "</ParameterMapping></ssd:ParameterMapping>"
    )


def bindings(*found: str) -> str:
    return f"<ssd:ParameterBindings>{''.join(found)}</ssd:ParameterBindings>"


def at(
    inner: str, outer: str = "", middle: str = "", connectors: tuple[str, ...] = (), links: tuple = ()
) -> str:
    """A model `m` in a system `s` in the whole, with bindings at each level."""
    model = component("m", "model", *connectors, inner=bindings(inner) if inner else "")
    nested = system("s", [], [model], []).replace(
        "</ssd:Connectors>\n<ssd:Elements>", f"</ssd:Connectors>{bindings(middle)}<ssd:Elements>", 1
    )
    if not middle:
        nested = system("s", [], [model], [])
    return ssd([nested], links, bindings=bindings(outer) if outer else "", version="2.0")


def loaded(folder: Path, text: str, files: dict[str, str | bytes] | None = None) -> System:
    return load_package(folder, files or {}, text, {"model": paper(folder, "model", MODEL)})


def start(folder: Path, *arguments: str, **more: str) -> dict:
    return dict(loaded(folder, at(*arguments, **more)).components["s.m"].start)  # type: ignore[arg-type]


def no(folder: Path, text: str, files: dict[str, str | bytes] | None = None) -> str:
    with pytest.raises(InputError) as caught:
        load_system(package(folder, files or {}, text, {"model": paper(folder, "model", MODEL)}))
    assert "line " in str(caught.value)
    return str(caught.value)


def test_later_bindings_win_and_higher_levels_win_over_lower_ones(tmp_path: Path) -> None:
    one, two, three = (inline(value("gain", "Float64", str(k))) for k in (1.5, 2.5, 3.5))
    middle, outer = inline(value("m.gain", "Float64", "4")), inline(value("s.m.gain", "Float64", "4.5"))
    assert start(tmp_path, one + two) == {"gain": 2.5}
    assert start(tmp_path, three + one) == {"gain": 1.5}
    assert start(tmp_path, one + two, middle=middle) == {"gain": 4.0}
    assert start(tmp_path, one, outer, middle) == {"gain": 4.5}


def test_prefixes_come_before_mappings(tmp_path: Path) -> None:
    assert start(tmp_path, "", inline(value("gain", "Float64", "2"), prefix="s.m.")) == {"gain": 2.0}
    entry = mapped('<MappingEntry source="p.a" target="s.m.gain"/>')
    given = inline(value("a", "Float64", "2") + value("b", "Float64", "9"), entry, prefix="p.")
    assert start(tmp_path, "", given) == {"gain": 2.0}


def test_mappings_convert_units_first_and_transform_then(tmp_path: Path) -> None:
    linear = '<ssc:LinearTransformation factor="2" offset="1"/>'
    for attributes, expected in (("", 2 * 293.15 + 1), (' suppressUnitConversion="true"', 41.0)):
        entry = mapped(f'<MappingEntry source="a" target="heat"{attributes}>{linear}</MappingEntry>')
        found = start(tmp_path, inline(value("a", "Float64", "20", "degC"), entry))
        assert found == {"heat": pytest.approx(expected)}
    for target, kind, given, table, expected in (
        ("on", "Boolean", "true", mapping("Boolean", ("true", "false")), False),
        ("small", "Int8", "3", mapping("Integer", (3, 7)), 7),
        ("gear", "Enumeration", "forward", mapping("Enumeration", ("forward", "high")), 2),
    ):
        entry = mapped(f'<MappingEntry source="a" target="{target}">{table}</MappingEntry>')
        assert start(tmp_path, inline(value("a", kind, given), entry)) == {target: expected}


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (value("heat", "Float64", "20", "degC"), {"heat": pytest.approx(293.15)}),
        (value("small", "Int8", "-128"), {"small": -128}),
        (value("large", "UInt64", str(2**64 - 1)), {"large": 2**64 - 1}),
        (value("small", "Real", "7.0"), {"small": 7}),
        (value("gear", "String", "high"), {"gear": 2}),
        (value("gear", "Integer", "2"), {"gear": 2}),
        (value("on", "Boolean", "true"), {"on": True}),
        (value("label", "String", "a b"), {"label": "a b"}),
        (value("blob", "Binary", "00ff"), {"blob": b"\x00\xff"}),
        (value("gear", "Enumeration", "high"), {"gear": 2}),
        (value("row", "Float64", "3 4", dimensions=(2,)), {"row": (3.0, 4.0)}),
        (value("n", "UInt64", "3") + value("row", "Float64", "3 4 5", dimensions=(3,)),
         {"n": 3, "row": (3.0, 4.0, 5.0)}),
        (value("state", "Float64", "7"), {"state": 7.0}),
        (value("u", "Float64", "7"), {"u": 7.0}),
        ('<Parameter name="label"><String><Value value="v"/></String></Parameter>', {"label": "v"}),
    ],
)  # fmt: skip
def test_values_have_the_type_of_their_variable(tmp_path: Path, given: str, expected: dict) -> None:
    found = start(tmp_path, inline(given))
    assert found == expected
    assert [type(v) for v in found.values()] == [
        type(v) if type(v).__module__ == "builtins" else float for v in expected.values()
    ]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (value("gain", "Float64", "6"), "parameter s.m.gain = 6 is out of bounds; valid: -5 … 5"),
        (value("small", "Int16", "128"), "parameter s.m.small = 128, but its type is Int8"),
        (value("small", "Int8", "128"), "value='128' is not an integer from -128 to 127"),
        (value("small", "Real", "7.5"), "parameter s.m.small = 7.5, but its type is Int8"),
        (value("label", "Boolean", "true"), "values of type Boolean are not supported for its type, String"),
        (value("on", "Boolean", "yes"), "value='yes' is not true or false"),
        (value("blob", "Binary", "0"), "value='0' is not a hexadecimal number of whole bytes"),
        (value("blob", "Binary", "0011223344"), "parameter s.m.blob has 5 bytes; valid: at most 4"),
        (value("gear", "Enumeration", "hi"), "the enumeration has no item 'hi'; did you mean high"),
        (value("gear", "Integer", "7"), "s.m.gear = 7 is no value of its enumeration; valid: 1 (low)"),
        (value("heat", "Float64", "1", "deg"), "is given in a unit that does not fit K"),
        (value("row", "Float64", "3"), "row is given as a scalar, but the variable is an array"),
        (value("row", "Float64", "3 4 5", dimensions=(3,)),
         "s.m.row has 3 values, but the variable has 2 elements"),
        (value("row", "Float64", "3 4 5", dimensions=(2,)), "parameter 'row' has 3 values for 2 elements"),
        (value("y", "Float64", "1"), "component s.m has no parameter 'y'"),
        (value("two", "Float64", "1"), "component s.m has no parameter 'two'"),
        (value("gain", "Float64", "1") * 2, "second parameter 'gain' in the set"),
        ('<Parameter name="gain"><Float64/></Parameter>', "<Float64> has no 'value'"),
        ('<Parameter name="gain"/>', "parameter 'gain' has 0 values; a parameter has exactly one"),
        ('<Parameter name="gain" unit="K"><Float64 value="1"/></Parameter>', "attribute 'unit' of <Par"),
    ],
)  # fmt: skip
def test_values_that_do_not_suit(tmp_path: Path, given: str, words: str) -> None:
    assert words in no(tmp_path, at(inline(given)))


def test_files_may_hold_more_than_is_needed(tmp_path: Path) -> None:
    """What is written at the place itself may not; what no file has, a mapping cannot take."""
    files: dict[str, str | bytes] = {
        "resources/p.ssv": parameter_set(value("gain", "Float64", "2") + value("other", "Float64", "1"))
    }
    source = '<ssd:ParameterBinding source="resources/p.ssv"/>'
    found = loaded(tmp_path, at(source), files)
    assert found.components["s.m"].start == {"gain": 2.0}
    (warning,) = [w for w in found.warnings if "other" in w]
    assert "resources/p.ssv line 1: ignored: component s.m has no parameter 'other'" in warning
    assert "has no parameter 'other'" in no(tmp_path, at(inline(value("other", "Float64", "1"))))
    entry = mapped('<MappingEntry source="nothing" target="gain"/>')
    unmapped = loaded(tmp_path, at(inline(value("a", "Float64", "1"), entry)))
    assert any("has no parameter 'nothing' to map" in w for w in unmapped.warnings)
    twice = mapped('<MappingEntry source="a" target="gain"/><MappingEntry source="b" target="gain"/>')
    assert "'gain' is the target of a second mapping entry" in no(
        tmp_path, at(inline(value("a", "Float64", "1"), twice))
    )


def test_files_inside_of_the_component(tmp_path: Path) -> None:
    model = paper(
        tmp_path, "model", MODEL, files={"resources/own.ssv": parameter_set(value("gain", "Float64", "4"))}
    )
    text = at('<ssd:ParameterBinding source="resources/own.ssv" sourceBase="component"/>')
    found = load_package(tmp_path, {}, text, {"model": model})
    assert found.components["s.m"].start == {"gain": 4.0}
    assert "needs a component with a source" in no(
        tmp_path, at("", '<ssd:ParameterBinding source="a.ssv" sourceBase="component"/>')
    )
    assert "sourceBase 'fmu'; valid: SSD, component" in no(
        tmp_path, at('<ssd:ParameterBinding source="a.ssv" sourceBase="fmu"/>')
    )


def test_structural_parameters_size_what_is_connected(tmp_path: Path) -> None:
    model = component("m", "model", connector("wave", "input", "Float64", dimensions=(3,)),
                      inner=bindings(inline(value("n", "UInt64", "3"))))  # fmt: skip
    source = connector("tide", "input", "Float64", dimensions=(3,))
    text = ssd([model], [connection("tide", "m.wave")], [source], version="2.0")
    found = loaded(tmp_path, text)
    assert (found.inputs["tide"].size, found.inputs["tide"].start) == (3, (0.0, 0.0, 0.0))
    assert found.components["m"].size(found.components["m"].model.variables["wave"]) == 3
    with pytest.raises(InputError, match=r"m.n gives arrays their size; it can only be set in the system"):
        found.start_values({"m.n": 4})
    message = no(tmp_path, text.replace('size="3"', 'size="4"'))
    assert "m.wave is declared as size 4, but is size 3 in the FMU" in message


def test_sizes_that_another_connector_gives(tmp_path: Path) -> None:
    """On the FMU's side a structural parameter, on the system's one that has a value bound to it."""
    wave = connector("wave", "input", "Float64").replace(
        "</ssd:C", '<ssc:Dimension sizeConnector="n"/></ssd:C'
    )
    tide = wave.replace("wave", "tide").replace('"n"', '"many"')
    ends = (wave, connector("n", "structuralParameter", "UInt64"))
    model = component("m", "model", *ends, inner=bindings(inline(value("n", "UInt64", "3"))))
    own = [tide, connector("many", "structuralParameter", "UInt64")]
    for size in (3, 4):
        given = bindings(inline(value("many", "UInt64", str(size))))
        text = ssd([model], [connection("tide", "m.wave")], own, given, version="2.0")
        if size == 3:
            assert loaded(tmp_path, text).inputs["tide"].size == 3
        else:
            assert "system connector tide (size 4) does not fit m.wave (size 3)" in no(tmp_path, text)
    text = ssd([model], [connection("tide", "m.wave")], own[:1], version="2.0")
    assert "sizeConnector 'many' of 'tide' is no connector" in no(tmp_path, text)


def test_a_structural_parameter_may_come_through_a_connection(tmp_path: Path) -> None:
    model = component("m", "model", connector("n", "structuralParameter", "UInt64"))
    own = [connector("many", "structuralParameter", "UInt64")]
    given = bindings(inline(value("many", "UInt64", "4")))
    found = loaded(tmp_path, ssd([model], [connection("many", "m.n")], own, given, version="2.0"))
    assert found.components["m"].start == {"n": 4}
    assert found.components["m"].size(found.components["m"].model.variables["row"]) == 4


# ---- values that connections carry ----

CONNECTORS = (connector("gain", "parameter", "Float64"), connector("heat", "parameter", "Float64", "K"))


def carried(values: str, own: str = "", **attributes: str) -> str:
    """A parameter of the whole, connected through `s` to the model's."""
    model = component("m", "model", *CONNECTORS, inner=own and bindings(own))
    nested = system(
        "s", [connector("g", "parameter", "Float64")], [model], [connection("g", "m.gain", **attributes)]
    )
    return ssd(
        [nested],
        [connection("g", "s.g", '<ssc:LinearTransformation factor="2"/>')],
        [connector("g", "parameter", "Float64")],
        bindings=bindings(inline(values)) if values else "",
        version="2.0",
    )


def test_values_of_connectors_go_where_their_connections_lead(tmp_path: Path) -> None:
    found = loaded(tmp_path, carried(value("g", "Float64", "1.5")))
    assert found.components["s.m"].start == {"gain": 3.0}
    assert found.parameters["g"].start == 1.5
    assert found.start_values({"g": 2.0})["s.m"] == {"gain": 4.0}
    assert found.links == ()
    with pytest.raises(InputError, match=r"parameter g for s.m.gain = 6 is out of bounds"):
        found.start_values({"g": 3.0})


def test_a_carried_value_overrides_and_says_so(tmp_path: Path) -> None:
    own = inline(value("gain", "Float64", "-1"))
    found = loaded(tmp_path, carried(value("g", "Float64", "1.5"), own))
    assert found.components["s.m"].start == {"gain": 3.0}
    assert any(
        "the value of s.m.gain is overridden by the connection from system" in w for w in found.warnings
    )
    assert loaded(tmp_path, carried("", own)).components["s.m"].start == {"gain": -1.0}


def test_constants_reach_parameters_and_calculated_ones_do_not(tmp_path: Path) -> None:
    for name, kind in (("two", "constant"), ("g", "calculatedParameter")):
        giver = component("giver", "model", connector(name, kind, "Float64"))
        model = component("m", "model", *CONNECTORS)
        text = ssd([giver, model], [connection(f"giver.{name}", "m.gain")], version="2.0")
        if kind == "constant":
            assert loaded(tmp_path, text).components["m"].start == {"gain": 2.0}
        else:
            assert "giver.g is calculated by its FMU; connections to parameters, like m.gain" in no(
                tmp_path, text
            )


def test_a_bound_inner_input_is_the_start_of_what_it_drives(tmp_path: Path) -> None:
    model = component("m", "model", connector("u", "input", "Float64"))
    nested = system("s", [connector("in", "input", "Float64")], [model], [connection("in", "m.u")])
    outer = inline(value("s.in", "Float64", "8"))
    found = loaded(tmp_path, ssd([nested], bindings=bindings(outer), version="2.0"))
    assert found.components["s.m"].start == {"u": 8.0}


def test_a_file_that_is_no_parameter_set(tmp_path: Path) -> None:
    binding = '<ssd:ParameterBinding source="resources/p.ssv"/>'
    for content, words in (
        ("<a/>", "resources/p.ssv line 1: <a> is not a ParameterSet"),
        (parameter_set("", 'version="9.0"'), "resources/p.ssv: SSP version '9.0' is not supported"),
    ):
        with pytest.raises(InputError) as caught:
            loaded(tmp_path, at(binding), {"resources/p.ssv": content})
        assert words in str(caught.value)
    with pytest.raises(InputError, match=r"resources/p.ssv cannot be read"):
        loaded(tmp_path, at(binding))
    assert zipfile.is_zipfile(tmp_path / "test.ssp")
