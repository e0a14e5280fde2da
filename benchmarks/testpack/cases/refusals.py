"""Descriptions that must be refused before the first step, by element and line."""

from benchmarks.testpack.case import Case, cases
from benchmarks.testpack.cases.common import gain, pair, source, whole
from benchmarks.testpack.render import (
    annotation,
    binding,
    bindings,
    component,
    connection,
    gives,
    linear,
    mapping,
    size,
    system,
    takes,
    value,
)

SINK = '<ssd:Connection startElement="a" startConnector="y" endElement="b" endConnector="u"'
VALUE = "<ssv:Real"


def _bad(
    name: str, about: str, text: str, *names: str, fmi: tuple[int, ...] = (2, 3), **more: object
) -> list[Case]:
    return cases(name, about, text, fmi, kind="refused", names=names, **more)


def _parameter(*values: str, fmu: str = "gain") -> str:
    return whole(
        [source(), gain("b", fmu, bindings=bindings(binding(*values)))],
        [connection("a.y", "b.u")],
        {"b.y": "Real"},
    )


def _typed(a: tuple[str, str], b: tuple[str, str], inner: str = "") -> str:
    """An output of the source to an input of an echo, by name and type."""
    return whole(
        [component("a", "source", gives(*a)), component("b", "echo", takes(*b), gives("real_out"))],
        [connection(f"a.{a[0]}", f"b.{b[0]}", inner)],
        {"b.real_out": "Real"},
    )


def _stepped(inner: str, step: object = 0.1, **more: str) -> str:
    return whole(
        [source(), gain()],
        [connection("a.y", "b.u")],
        {"b.y": "Real"},
        annotated=annotation(str(step), inner, **more),
    )


def _units(first: str, second: str, units: tuple[str, str]) -> str:
    return whole(
        [gain("a", first, unit=units[0]), gain("b", second, unit=units[1])],
        [connection("a.y", "b.u")],
        {"b.y": "Real"},
    )


THROUGH = system("inner", [gain("c")], [connection("in", "out")], [takes("in"), gives("out")])
CYCLE = whole(
    [source(), gain(), THROUGH],
    [connection("inner.out", "inner.in"), connection("a.y", "b.u")],
    {"b.y": "Real"},
)
TWO_SOURCES = whole(
    [source(), source("c"), gain()],
    [connection("a.y", "b.u"), connection("c.y", "b.u")],
    {"b.y": "Real"},
)
SIZES = whole(
    [
        component("a", "vector3", gives("y", "Real", size(3))),
        component(
            "b",
            "vector_n",
            takes("u", "Real", size(2)),
            gives("total"),
            bindings=bindings(binding(value("n", "UInt64", 2))),
        ),
    ],
    [connection("a.y", "b.u")],
    {"b.total": "Real"},
)
TURNED = whole(
    [
        component("a", "matrix", gives("y", "Real", size(2) + size(3))),
        component("b", "matrix_turned", takes("u", "Real", size(3) + size(2)), gives("total")),
    ],
    [connection("a.y", "b.u")],
    {"b.total": "Real"},
)
STATELESS = whole(
    [source(), gain("b", "gain_stateless")],
    [connection("a.y", "b.u")],
    {"b.y": "Real"},
    annotated=annotation(0.1, algorithm="iterate"),
)
CLOCKS = whole(
    [
        component(n, "relay", takes("tick", "Clock"), gives("tock", "Clock"), gives("count", "Integer"))
        for n in ("a", "b")
    ],
    [connection("a.tock", "b.tick"), connection("b.tock", "a.tick")],
    {"a.count": "Integer"},
)
ODD_CLOCK = whole(
    [component("b", "sampler_rigid", takes("u"), gives("count", "Integer"))], [], {"b.count": "Integer"}
)
UNDEFINED = pair().replace(
    '<ssd:Connector name="u" kind="input"><ssc:Real/>',
    '<ssd:Connector name="u" kind="input"><ssc:Real unit="furlong"/>',
)
FACTORLESS = _units("gain_m", "gain_mm", ("m", "mm")).replace('m="1" factor="0.001"', 'm="1" factor="0"')
ITEM = mapping("Enumeration", {"off": "off", "slow": "quick", "fast": "fast"})
GEARS = whole(
    [
        component("a", "source", gives("mode", "Enumeration", name="Mode")),
        component("b", "echo_gear", takes("mode_in", "Enumeration", name="Gear"), gives("real_out")),
    ],
    [connection("a.mode", "b.mode_in", ITEM)],
    {"b.real_out": "Real"},
)
TWICE = whole([source(), gain(), gain()], [connection("a.y", "b.u")], {"b.y": "Real"})

CASES: tuple[Case, ...] = (
    *_bad("cycle", "connections that form a cycle", CYCLE, "inner.in", "inner.out"),
    *_bad("two-sources", "two sources for one input", TWO_SOURCES, "b.u", at='startElement="c"'),
    *_bad("sizes", "arrays of different sizes", SIZES, "a.y", "b.u", "3", "2", at=SINK, fmi=(3,)),
    *_bad("shapes", "a matrix to one of as many elements, turned", TURNED, "a.y", "b.u", at=SINK, fmi=(3,)),
    *_bad(
        "step-multiple",
        "a component's step is no whole multiple of the system's",
        _stepped('<slw:Component name="b" stepSize="0.15"/>'),
        "'b'",
        at="<slw:Component",
        own=True,
    ),
    *_bad(
        "step-negative",
        "a step size that is not positive",
        _stepped("", "-0.1"),
        "stepSize",
        at="<slw:Simulation",
        own=True,
    ),
    *_bad(
        "step-of-nobody",
        "a step size for a component that is not there",
        _stepped('<slw:Component name="c" stepSize="0.2"/>'),
        "'c'",
        at="<slw:Component",
        own=True,
    ),
    *_bad(
        "algorithm",
        "an unknown algorithm",
        _stepped("", algorithm="jacoby"),
        "jacoby",
        at="<slw:Simulation",
        own=True,
    ),
    *_bad(
        "no-rollback",
        "an algorithm that takes steps back, and an FMU that cannot",
        STATELESS,
        "component b",
        at='<ssd:Component name="b"',
        own=True,
    ),
    *_bad("clock-cycle", "clocks that form a cycle", CLOCKS, "a.tock", "b.tick", fmi=(3,)),
    *_bad(
        "clock-interval",
        "a clock whose interval is no whole multiple of the step, of an FMU that takes no other steps",
        ODD_CLOCK,
        "tick",
        fmi=(3,),
    ),
    *_bad("factor-zero", "a LinearTransformation with factor 0", pair(linear(0)), "factor", at=SINK),
    *_bad(
        "linear-boolean",
        "a LinearTransformation for Booleans",
        _typed(("on", "Boolean"), ("boolean_in", "Boolean"), linear(2)),
        at="<ssc:LinearTransformation",
    ),
    *_bad("mapping-item", "a mapping to an item that the enumeration lacks", GEARS, "quick", at="quick"),
    *_bad(
        "mapping-twice",
        "a mapping with two entries for one value",
        _typed(("count", "Integer"), ("integer_in", "Integer"), mapping("Integer", {"1": 2, "01": 3})),
        at="<ssc:MapEntry",
    ),
    *_bad("unit-undefined", "a unit that is nowhere defined", UNDEFINED, "furlong", at="furlong"),
    *_bad(
        "unit-other", "metres to radians", _units("gain_m", "gain_rad", ("m", "rad")), "a.y", "b.u", at=SINK
    ),
    *_bad("unit-factor-zero", "a unit with factor 0", FACTORLESS, "'mm'", at='name="mm"'),
    *_bad(
        "types",
        "a Real to a Boolean",
        _typed(("y", "Real"), ("boolean_in", "Boolean")),
        at='startElement="a"',
    ),
    *_bad(
        "type-declared",
        "a connector of another type than its variable",
        pair().replace('name="y" kind="output"><ssc:Real/>', 'name="y" kind="output"><ssc:Boolean/>', 1),
        "a.y",
        at="<ssc:Boolean",
    ),
    *_bad(
        "kind-declared",
        "a connector of another kind than its variable",
        pair().replace('name="u" kind="input"', 'name="u" kind="output"'),
        "b.u",
        at='name="u"',
    ),
    *_bad(
        "two-outputs",
        "an output to an output",
        whole([source(), gain()], [connection("a.y", "b.y")], {}),
        "a.y",
        "b.y",
        at='startElement="a"',
    ),
    *_bad(
        "element-missing",
        "a connection to an element that is not there",
        pair().replace('endElement="b"', 'endElement="bb"', 1),
        "'bb'",
        at='endElement="bb"',
    ),
    *_bad(
        "connector-missing",
        "a connection to a connector that is not there",
        pair().replace('endConnector="u"', 'endConnector="w"', 1),
        "'w'",
        at='endConnector="w"',
    ),
    *_bad(
        "variable-missing",
        "a connector that the FMU does not have",
        pair().replace('name="u" kind', 'name="w" kind'),
        "b.w",
        at='name="w"',
    ),
    *_bad("name-twice", "two components of one name", TWICE, "'b'"),
    *_bad(
        "value-bounds",
        "a value out of the bounds of its parameter",
        _parameter(value("k", "Real", 11), fmu="gain_bounded"),
        "k",
        "-10",
        "10",
        at='value="11"',
    ),
    *_bad(
        "value-nan",
        "a value that is not a number",
        _parameter(value("k", "Real", "NaN")),
        "k",
        at='value="NaN"',
    ),
    *_bad("value-text", "a text for a number", _parameter(value("k", "Real", "three")), "three", at="three"),
    *_bad(
        "value-type",
        "a value of another type than its parameter",
        _parameter(value("k", "String", "3")),
        "k",
        at="<ssv:String",
    ),
    *_bad(
        "value-unit-other",
        "a value in a unit that does not fit",
        whole(
            [gain("b", "gain_mm", bindings=bindings(binding(value("b", "Real", 1, unit="K"))))],
            [],
            {"b.y": "Real"},
        ),
        "b",
        at='unit="K"',
    ),
    *_bad(
        "parameter-missing",
        "a value for a parameter that is not there",
        _parameter(value("kk", "Real", 3)),
        "'kk'",
        at='name="kk"',
    ),
    *_bad(
        "parameter-twice",
        "two values of one set for one parameter",
        _parameter(value("k", "Real", 2), value("k", "Real", 3)),
        "'k'",
    ),
    *_bad(
        "element-unknown",
        "an element that SSP does not know",
        pair().replace("<ssd:Elements>", "<ssd:Surprise/>\n<ssd:Elements>"),
        "Surprise",
        at="Surprise",
    ),
    *_bad(
        "indices",
        "a connection to single elements of an array",
        pair(startIndices="1"),
        "startIndices",
        at="startIndices",
        fmi=(3,),
    ),
    *_bad(
        "version",
        "a version of SSP that is not known",
        pair().replace('version="@SSP@"', 'version="7.0"'),
        "7.0",
    ),
)
