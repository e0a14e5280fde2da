"""What an FMU says of itself is read completely, or refused by name and line."""

from fractions import Fraction
from pathlib import Path

import pytest
from fmpy import read_model_description

from orchestrator.fmi.model_description import ModelDescription, parse, size_of
from orchestrator.fmi.variable import FMI3_TYPES
from specs.errors import InputError
from tests.orchestrator.systems import LIAR2, LIAR3, fmu

HEAD3 = '<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t">'
HEAD2 = '<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g">'
TYPES3 = """<TypeDefinitions>
<Float64Type name="Angle" unit="rad" min="-4" max="4" relativeQuantity="true"/>
<EnumerationType name="Gear"><Item name="park" value="-1"/><Item name="drive" value="7"/></EnumerationType>
<ClockType name="Beat" intervalVariability="constant" intervalDecimal="0.1" shiftDecimal="2.5e-1"/>
</TypeDefinitions>"""


def fmi3(variables: str, structure: str = "", interface: str = "", more: str = "") -> ModelDescription:
    """Parse an FMI 3 description; its variables begin in line 2 when there are no types."""
    return parse(
        f'{HEAD3}<CoSimulation modelIdentifier="m" {interface}/>{more}<ModelVariables>\n{variables}'
        f"</ModelVariables><ModelStructure>{structure}</ModelStructure></fmiModelDescription>".encode(),
        "FMU x",
    )


def fmi2(variables: str, structure: str = "", more: str = "") -> ModelDescription:
    """The same for FMI 2."""
    return parse(
        f'{HEAD2}<CoSimulation modelIdentifier="m"/>{more}<ModelVariables>\n{variables}'
        f"</ModelVariables><ModelStructure>{structure}</ModelStructure></fmiModelDescription>".encode(),
        "FMU x",
    )


# ---- what is read ----


def test_all_types_of_fmi_3_with_their_start_values() -> None:
    given = {
        "Float64": ('start="1.5"', 1.5),
        "Float32": ('start="-2e3"', -2000.0),
        "Int8": ('start="-128"', -128),
        "UInt8": ('start="255"', 255),
        "Int16": ('start="-32768"', -32768),
        "UInt16": ('start="65535"', 65535),
        "Int32": ('start="-2147483648"', -(2**31)),
        "UInt32": ('start="4294967295"', 2**32 - 1),
        "Int64": ('start="-9223372036854775808"', -(2**63)),
        "UInt64": ('start="18446744073709551615"', 2**64 - 1),
        "Boolean": ('start="true"', True),
        "Enumeration": ('start="7" declaredType="Gear"', 7),
        "String": ("", " two words\n".strip("\n")),
        "Binary": ("", b"\x00\xffA"),
        "Clock": ('intervalVariability="triggered"', None),
    }
    assert tuple(given) == FMI3_TYPES
    inner = {"String": '<Start value=" two words"/>', "Binary": '<Start value="00fF41"/>'}
    text = "".join(
        f'<{name} name="{name}" valueReference="{i}" causality="input" '
        f'variability="discrete" {start}>{inner.get(name, "")}</{name}>'
        for i, (name, (start, _)) in enumerate(given.items())
    )
    found = fmi3(text, more=TYPES3).variables
    for name, (_, value) in given.items():
        assert found[name].start == value
        assert type(found[name].start) is type(value)
    assert found["Enumeration"].items == {"park": -1, "drive": 7}


def test_types_of_fmi_2_with_their_start_values() -> None:
    more = """<TypeDefinitions>
    <SimpleType name="Gear"><Enumeration><Item name="one" value="1"/></Enumeration></SimpleType>
    <SimpleType name="Angle"><Real min="0" max="4" relativeQuantity="1"/></SimpleType></TypeDefinitions>"""
    scalar = '<ScalarVariable name="{0}" valueReference="{1}" causality="input" {2}>{3}</ScalarVariable>'
    kinds = ('<Real declaredType="Angle" start="1"/>', '<Integer start="-3"/>', '<Boolean start="1"/>',
             '<Enumeration declaredType="Gear" start="1"/>', '<String start="a  b"/>')  # fmt: skip
    found = fmi2("".join(scalar.format(f"v{i}", i, "", kind) for i, kind in enumerate(kinds)), more=more)
    assert [v.start for v in found.variables.values()] == [1.0, -3, True, 1, "a  b"]
    angle = found.variables["v0"]
    assert (angle.min, angle.max, angle.relative, angle.variability) == (0.0, 4.0, True, "continuous")
    assert found.variables["v1"].variability == "discrete"


@pytest.mark.parametrize(
    ("attributes", "initial"),
    [
        ('causality="input" start="0" initial="calculated"', "exact"),
        ('causality="output"', "calculated"),
        ('causality="output" initial="approx" start="0"', "approx"),
        ('causality="output" variability="constant" start="0"', "exact"),
        ('causality="parameter" start="0"', "exact"),
        ('causality="calculatedParameter"', "calculated"),
        ('causality="independent"', ""),
        ("", "calculated"),
    ],
)
def test_how_a_variable_is_initialised(attributes: str, initial: str) -> None:
    variable = fmi3(f'<Float64 name="v" valueReference="1" {attributes}/>').variables["v"]
    assert variable.initial == initial
    fixed = variable.causality in ("parameter", "calculatedParameter")
    assert (variable.variability == "fixed") == fixed


ARRAYS = """<UInt64 name="n" valueReference="1" causality="structuralParameter" start="2"/>
<UInt64 name="three" valueReference="2" variability="constant" start="3"/>
<Float64 name="a" valueReference="3" causality="input" start="1 2 3 4 5 6">
  <Dimension valueReference="1"/><Dimension valueReference="2"/></Float64>
<Float64 name="b" valueReference="4" causality="input" start="7"><Dimension start="4"/></Float64>
<String name="s" valueReference="5" causality="input"><Dimension start="2"/>
  <Start value="x"/><Start value=""/></String>"""


def test_arrays_and_structural_parameters() -> None:
    model = fmi3(ARRAYS)
    a, b, s = (model.variables[name] for name in "abs")
    assert a.dimensions == ("n", 3)
    assert a.array
    assert not model.variables["n"].array
    assert a.start == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert b.start == (7.0,) * 4  # one value is the value of every element
    assert s.start == ("x", "")
    assert model.structural() == {"n": 2}
    assert size_of(a, model.structural()) == 6
    assert size_of(a, {"n": 5}) == 15
    assert size_of(model.variables["n"], {}) == 1


def test_aliases_share_a_value_reference() -> None:
    found = fmi3(
        '<Float64 name="a" valueReference="1" causality="output"><Alias name="b" description="B"/></Float64>'
    ).variables
    assert list(found) == ["a", "b"]
    assert (found["b"].vr, found["b"].causality, found["b"].description) == (1, "output", "B")


def test_attributes_of_declared_types_are_defaults() -> None:
    found = fmi3(
        '<Float64 name="a" valueReference="1" declaredType="Angle"/>'
        '<Float64 name="b" valueReference="2" declaredType="Angle" max="1" relativeQuantity="false"/>',
        more='<UnitDefinitions><Unit name="rad"><BaseUnit rad="1"/></Unit></UnitDefinitions>' + TYPES3,
    ).variables
    a, b = found["a"], found["b"]
    assert (a.unit_name, a.min, a.max, a.relative) == ("rad", -4.0, 4.0, True)
    assert a.unit is not None
    assert (b.min, b.max, b.relative) == (-4.0, 1.0, False)


CLOCK = '<Clock name="c" valueReference="1" causality="input" intervalVariability="{}" {}/>'


@pytest.mark.parametrize(
    ("variability", "attributes", "interval", "shift"),
    [
        ("constant", 'intervalDecimal="0.1"', Fraction(1, 10), 0),
        ("fixed", 'intervalDecimal="1e-3" shiftDecimal="0.25"', Fraction(1, 1000), Fraction(1, 4)),
        ("fixed", 'supportsFraction="true" resolution="3" intervalCounter="2" shiftCounter="1"',
         Fraction(2, 3), Fraction(1, 3)),
        ("tunable", "", None, 0),
        ("countdown", "", None, 0),
        ("triggered", 'intervalDecimal="9"', None, 0),
    ],
)  # fmt: skip
def test_clocks(variability: str, attributes: str, interval: Fraction | None, shift: Fraction) -> None:
    member = '<Int32 name="i" valueReference="2" causality="input" start="0" clocks="1"/>'
    found = fmi3(CLOCK.format(variability, attributes) + member).variables
    clock = found["c"].clock
    assert clock is not None
    assert (clock.interval_variability, clock.interval_s, clock.shift_s) == (variability, interval, shift)
    assert found["i"].clocks == ("c",)


def test_what_the_fmu_is_capable_of() -> None:
    model = fmi3(
        "",
        interface='hasEventMode="true" mightReturnEarlyFromDoStep="1" fixedInternalStepSize="1e-3" '
        'canBeInstantiatedOnlyOncePerProcess="true" canGetAndSetFMUState="true"',
        more='<DefaultExperiment startTime="0" stopTime="12" stepSize="0.01" tolerance="1e-6"/>',
    )
    assert (model.has_event_mode, model.can_return_early, model.only_once_per_process) == (True,) * 3
    assert (model.can_get_set_state, model.can_serialize_state, model.variable_step) == (True, False, False)
    assert model.fixed_internal_step_s == 1e-3
    assert (model.default_stop_s, model.default_step_s, model.default_tolerance) == (12.0, 0.01, 1e-6)


@pytest.mark.parametrize("version", [2, 3])
def test_dependencies(version: int) -> None:
    if version == 3:
        io = '<Float64 name="{0}" valueReference="{1}" causality="{2}" {3}/>'
        unknown = {
            "Output": '<Output valueReference="{}" {}/>',
            "Initial": '<InitialUnknown valueReference="{}" {}/>',
        }
    else:
        io = '<ScalarVariable name="{0}" valueReference="{1}" causality="{2}"><Real {3}/></ScalarVariable>'
        unknown = {"Output": '<Unknown index="{}" {}/>', "Initial": '<Unknown index="{}" {}/>'}
    names = {"u": "input", "w": "input", "y": "output", "z": "output", "q": "output"}
    text = "".join(
        io.format(n, i + 1, c, 'start="0"' if c == "input" else "") for i, (n, c) in enumerate(names.items())
    )
    outputs = unknown["Output"].format(3, 'dependencies="1 2"') + unknown["Output"].format(
        4, 'dependencies=""'
    )
    initial = unknown["Initial"].format(4, 'dependencies="2"')
    if version == 2:
        outputs, initial = f"<Outputs>{outputs}</Outputs>", f"<InitialUnknowns>{initial}</InitialUnknowns>"
    model = (fmi3 if version == 3 else fmi2)(text, outputs + initial)
    assert model.dependencies == {"y": ("u", "w"), "z": (), "q": None}
    assert model.initial_dependencies == {"y": None, "z": ("w",), "q": None}
    assert model.warnings == ("FMU x: outputs missing from ModelStructure may depend on every input: q",)


def test_deviations_without_effect_are_warned_about() -> None:
    model = fmi3(
        '<Float64 name="y" valueReference="1" causality="output" unit="parsec" start="3"/>'
        '<Float64 name="x" valueReference="2" initial="exact" max="1" start="2"/>'
        '<Float64 name="z" valueReference="3" initial="approx"/>'
    )
    assert [w.removeprefix("FMU x: ") for w in model.warnings] == [
        "start values of variables that are calculated are not used: y",
        "variables should have a start value and have none: z",
        "start values are out of their bounds: x",
        "units are not defined and cannot be converted: parsec",
    ]


def test_attributes_that_the_standard_does_not_know_are_warned_about() -> None:
    model = fmi3(
        '<Float64 name="y" valueReference="1" Start="1" xmlns:x="urn:x" x:foreign="1">'
        '<Annotations><Annotation odd="1"/></Annotations></Float64>',
        interface='fixedInternalStepsize="1"',
    )
    assert model.warnings == (
        "FMU x: attributes that FMI 3.0 does not know are ignored: "
        "CoSimulation.fixedInternalStepsize (line 1), Float64.Start (line 2)",
    )


def test_foreign_annotations_and_parts_of_other_interfaces_are_passed_over() -> None:
    model = fmi3(
        '<Float64 name="y" valueReference="1" causality="output"><Annotations><Annotation type="a.b">'
        '<x:odd xmlns:x="urn:x"/></Annotation></Annotations></Float64>',
        '<Output valueReference="1" dependencies=""/><EventIndicator valueReference="1"/>',
        more='<LogCategories><Category name="logAll"/></LogCategories>',
    )
    assert model.warnings == ()


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", ["position", "compass", "burst"])
def test_fmpy_reads_the_same(name: str, version: int) -> None:
    import zipfile

    path: Path = fmu(name, version)
    with zipfile.ZipFile(path) as archive:
        mine = parse(archive.read("modelDescription.xml"), "FMU")
    theirs = read_model_description(str(path))
    assert [(v.name, v.valueReference, v.causality, v.type) for v in theirs.modelVariables] == [
        (v.name, v.vr, v.causality, v.type) for v in mine.variables.values()
    ]
    for v in theirs.modelVariables:
        start = mine.variables[v.name].start
        given: str | None = v.start  # type: ignore[assignment]
        assert (None if given is None else float(given)) == start
        assert v.initial in (mine.variables[v.name].initial, None)
    assert theirs.defaultExperiment is not None
    assert str(mine.default_stop_s) == str(float(theirs.defaultExperiment.stopTime or 0.0))


@pytest.mark.parametrize("text", [LIAR2, LIAR3])
def test_the_shortest_descriptions_are_enough(text: str) -> None:
    model = parse(text.encode(), "FMU")
    assert set(model.dependencies.values()) == {None}
    assert len(model.warnings) == 1


# ---- what is refused ----

F64 = '<Float64 name="v" valueReference="1" {}/>'


@pytest.mark.parametrize(
    ("variables", "words"),
    [
        ('<Float65 name="v" valueReference="1"/>', "unknown variable type <Float65>"),
        ('<Float64 valueReference="1"/>', "<Float64> has no 'name'"),
        ('<Float64 name="v"/>', "<Float64> has no 'valueReference'"),
        ('<Float64 name="v" valueReference="-1"/>', "valueReference -1; valid: 0"),
        ('<Float64 name="v" valueReference="4294967296"/>', "valueReference 4294967296"),
        (F64.format("") + '<Float64 name="w" valueReference="1"/>', "'w' has the value reference 1 of 'v'"),
        (F64.format("") + '\n<Float64 name="v" valueReference="2"/>',
         "line 3: variable 'v' has the name of the variable in line 2"),
        ('<Float64 name="v" valueReference="1"><Alias name="v"/></Float64>', "has the name of the variable"),
        (F64.format('causality="inptu"'), "causality='inptu'; valid: input, output"),
        (F64.format('variability="often"'), "variability='often'; valid: constant"),
        (F64.format('causality="input" variability="fixed" start="0"'),
         "is input and fixed; valid variability"),
        (F64.format('causality="parameter" variability="continuous" start="0"'),
         "is parameter and continuous"),
        (F64.format('causality="parameter" initial="calculated" start="0"'), "with initial='calculated'"),
        ('<Int8 name="v" valueReference="1" variability="continuous"/>', "is continuous, but of type Int8"),
        (F64.format('causality="input"'), "is input and has no start value"),
        (F64.format('causality="parameter"'), "is parameter and has no start value"),
        (F64.format('causality="input" start="INF"'), "starts at inf, which is not finite"),
        (F64.format('causality="input" start="1,5"'), "start='1,5' is no number of type Float64"),
        (F64.format('causality="input" start="1 2"'), "start has 2 values, but the variable has 1"),
        (F64.format('causality="input" start=""'), "start has 0 values"),
        (F64.format('causality="input" start="2" max="1"'), "starts at 2.0, out of its bounds None … 1.0"),
        (F64.format('min="2" max="1"'), "has min 2.0 above max 1.0"),
        (F64.format('min="low"'), "min='low' is not a number"),
        (F64.format('max="NaN"'), "max='NaN' is not a number"),
        ('<UInt8 name="v" valueReference="1" causality="input" start="256"/>',
         "is no number of type UInt8"),
        ('<Int8 name="v" valueReference="1" causality="input" start="1.0"/>', "is no number of type Int8"),
        ('<Boolean name="v" valueReference="1" causality="input" start="yes"/>', "start='yes' is no Boolean"),
        ('<Binary name="v" valueReference="1" causality="input"><Start value="0g"/></Binary>',
         "is no Binary"),
        ('<Binary name="v" valueReference="1" causality="input" maxSize="1"><Start value="0000"/></Binary>',
         "starts with 2 bytes; its maxSize is 1"),
        ('<Float32 name="v" valueReference="1" causality="input" start="1e39"/>', "beyond Float32"),
        ('<Enumeration name="v" valueReference="1" causality="input" start="1"/>', "without a declaredType"),
        (F64.format('declaredType="Angel"'), "unknown declaredType 'Angel'"),
        ('<Float64 name="v" valueReference="1"><Dimension/></Float64>',
         "needs either 'start' or 'valueReference'"),
        ('<Float64 name="v" valueReference="1"><Dimension start="0"/></Float64>', "dimension of size 0"),
        ('<Float64 name="v" valueReference="1"><Dimension start="4000"/><Dimension start="4000"/></Float64>',
         "more than 4194304 elements"),
        ('<Float64 name="v" valueReference="1"><Dimension valueReference="9"/></Float64>',
         "dimension refers to value reference 9; there is none"),
        ('<Float64 name="v" valueReference="1"><Dimension valueReference="1"/></Float64>',
         "dimension refers to 'v', which is no structural parameter"),
        ('<UInt64 name="n" valueReference="1" causality="structuralParameter" start="0"/>'
         '<Float64 name="v" valueReference="2"><Dimension valueReference="1"/></Float64>',
         "'n' gives a dimension the size 0"),
        ('<UInt64 name="n" valueReference="1" causality="structuralParameter" start="1">'
         '<Dimension start="1"/></UInt64>', "is a structural parameter with dimensions"),
        (F64.format('derivative="2"'), "derivative='2' names no variable"),
        (F64.format('previous="x"'), "previous='x' names no variable"),
        (F64.format('clocks="1"'), "clocks='1' is not the value reference of a clock"),
        (CLOCK.format("triggered", "") + '<Float64 name="v" valueReference="2" clocks="1"/>',
         "belongs to a clock, but is continuous"),
        (CLOCK.format("triggered", 'clocks="1"'), "belongs to itself as a clock"),
        (CLOCK.format("sometimes", ""), "intervalVariability='sometimes'; valid: constant"),
        (CLOCK.format("constant", ""), "without intervalDecimal"),
        (CLOCK.format("constant", 'intervalDecimal="0"'), "interval must be positive"),
        (CLOCK.format("constant", 'intervalDecimal="1e999999999"'), "is no time in s"),
        (CLOCK.format("constant", 'intervalDecimal="1" shiftDecimal="-1"'), "its shift not negative"),
        (CLOCK.format("fixed", 'intervalCounter="1" resolution="0"'), "must be positive integers"),
        (CLOCK.format("triggered", "").replace("input", "parameter"), "is a clock of causality parameter"),
        (F64.format('causality="independent"')
         + '<Float64 name="w" valueReference="2" causality="independent"/>',
         "is a second independent variable beside 'v'"),
        ('<Int8 name="v" valueReference="1" causality="independent" variability="continuous"/>',
         "of type Int8"),
        ("<Float64 name='v' valueReference='1'><Dimensions/></Float64>", "unknown element <Dimensions>"),
    ],
)  # fmt: skip
def test_wrong_variables_of_fmi_3(variables: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        fmi3(variables)
    message = str(caught.value)
    assert words in message
    assert message.startswith("FMU x, modelDescription.xml line ")
    assert len(message.splitlines()) == 1


SCALAR = '<ScalarVariable name="{0}" valueReference="1" {1}>{2}</ScalarVariable>'


@pytest.mark.parametrize(
    ("variables", "words"),
    [
        (SCALAR.format("v", "", "<Float64/>"), "<ScalarVariable> without a known type; valid: Real"),
        (SCALAR.format("v", "", "<Real/><Real/>"), "without a known type"),
        (SCALAR.format("v", 'causality="structuralParameter"', "<Real/>"), "causality='structuralParameter'"),
        (SCALAR.format("v", 'causality="input"', "<Integer start='2147483648'/>"), "of type Integer"),
        (SCALAR.format("v", 'causality="input"', '<Real start="0"/>')
         + SCALAR.format("w", 'causality="parameter"', '<Real start="0"/>'),
         "variable 'w' is parameter with the value reference 1 of 'v'"),
    ],
)  # fmt: skip
def test_wrong_variables_of_fmi_2(variables: str, words: str) -> None:
    with pytest.raises(InputError, match=r"FMU x, modelDescription\.xml line 2") as caught:
        fmi2(variables)
    assert words in str(caught.value)


def test_one_value_reference_may_serve_an_input_and_an_integer() -> None:
    """FMI 2: only variables of one base type are aliases."""
    both = SCALAR.format("v", 'causality="input"', '<Real start="0"/>') + SCALAR.format(
        "w", 'causality="input"', '<Integer start="0"/>'
    )
    assert len(fmi2(both).variables) == 2


Y = '<Float64 name="y" valueReference="1" causality="output"/>'


@pytest.mark.parametrize(
    ("structure", "words"),
    [
        ('<Output valueReference="2"/>', "valueReference names variable 2; there is none"),
        ('<Output valueReference="1" dependencies="1 x"/>', "dependencies names variable x; there is none"),
        ("<Output/>", "<Output> has no 'valueReference'"),
        ("<Outputs/>", "unknown element <Outputs> in ModelStructure"),
    ],
)
def test_a_wrong_structure(structure: str, words: str) -> None:
    with pytest.raises(InputError, match=r"FMU x, modelDescription\.xml line 2") as caught:
        fmi3(Y, structure)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("interface", "more", "words"),
    [
        ('hasEventMode="perhaps"', "", "hasEventMode='perhaps' is not true or false"),
        ('fixedInternalStepSize="0"', "", "fixedInternalStepSize=0.0 must be positive"),
        ('needsExecutionTool="1"', "", "needs an execution tool"),
        ("", '<DefaultExperiment stepSize="-1"/>', "stepSize=-1.0 must be positive"),
        ("", '<DefaultExperiment startTime="2" stopTime="1"/>', "stopTime 1.0 s is before the start time"),
        ("", "<ModelVariable/>", "unknown element <ModelVariable>; did you mean ModelVariables"),
        ("", "<ModelVariables/>", "second element <ModelVariables>"),
    ],
)
def test_wrong_attributes_of_the_whole(interface: str, more: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        fmi3("", interface=interface, more=more)
    assert words in str(caught.value)


@pytest.mark.parametrize("name", ["../../evil", "/evil", "a/b", "a\\b", ".hidden", ""])
def test_a_model_identifier_stays_in_its_folder(name: str) -> None:
    text = LIAR2.replace('modelIdentifier="liar"', f'modelIdentifier="{name}"')
    with pytest.raises(InputError, match="modelIdentifier"):
        parse(text.encode(), "FMU x")


@pytest.mark.parametrize(
    ("version", "accepted"),
    [("3.0", True), ("3.0.1", True), ("3.1", True), ("3.0-beta.2", False), ("1.0", False), ("4.0", False),
     ("2.1", False), ("3", False)],
)  # fmt: skip
def test_versions(version: str, accepted: bool) -> None:
    text = LIAR3.replace('fmiVersion="3.0"', f'fmiVersion="{version}"').encode()
    usual = parse(LIAR3.encode(), "FMU x").warnings
    if not accepted:
        with pytest.raises(InputError, match=f"has FMI version '{version}'; valid: 2.0, 3.0"):
            parse(text, "FMU x")
        return
    warnings = parse(text, "FMU x").warnings
    more = ("FMU x: FMI version 3.1 is read as 3.0; what it adds is not used",)
    assert warnings == (more + usual if version == "3.1" else usual)


def test_a_unit_that_would_drop_every_value() -> None:
    with pytest.raises(InputError, match="line 1: unit 'odd' has the factor 0"):
        fmi3(
            "", more='<UnitDefinitions><Unit name="odd"><BaseUnit m="1" factor="0"/></Unit></UnitDefinitions>'
        )
