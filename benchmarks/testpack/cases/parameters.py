"""Parameter values: where they may stand, which one counts, how they are named and converted."""

from benchmarks.testpack.case import Case, Package, cases
from benchmarks.testpack.cases.common import HOP, U, gain, source, whole
from benchmarks.testpack.render import (
    XML,
    binding,
    bindings,
    component,
    connection,
    connector,
    entry,
    gives,
    linear,
    lines,
    parameter_mapping,
    parameter_set,
    system,
    takes,
    value,
)

K = "k"


def _k(number: float, name: str = K) -> str:
    return value(name, "Real", number)


def _system(own: str = "", outer: str = "", fmu: str = "gain", connectors: tuple[str, ...] = ()) -> str:
    """source a → gain b; bindings of b (`own`) and of the system (`outer`)."""
    return whole(
        [source(), gain("b", fmu, bindings=own)],
        [connection("a.y", "b.u")],
        {"b.y": "Real"},
        connectors=connectors,
        bindings=outer,
    )


def _file(text: str) -> str:
    return lines(XML, text) + "\n"


def _mapped(inner: str = "", source: str = "") -> str:
    """<ParameterMapping> of a binding, inline or from a file."""
    if source:
        return f'<ssd:ParameterMapping source="{source}"/>'
    return lines("<ssd:ParameterMapping>", inner, "</ssd:ParameterMapping>")


FACTOR = value("factor", "Real", 1.5)
TO_K = parameter_mapping(entry("factor", K, linear(2)))
CONNECTED = whole(
    [source(), component("b", "gain", takes("u"), connector(K, "parameter"), gives("y"))],
    [connection("a.y", "b.u"), connection("strength", "b.k")],
    {"b.y": "Real"},
    connectors=[connector("strength", "parameter")],
    bindings=bindings(binding(_k(3, "strength"))),
)
START = whole(
    [component("b", "gain", takes("u"), gives("y"))],
    [connection("drive", "b.u")],
    {"b.y": "Real"},
    connectors=[takes("drive")],
    bindings=bindings(binding(_k(7, "drive"))),
)
ECHO = whole(
    [
        component(
            "b",
            "echo",
            takes("integer_in", "Integer"),
            takes("boolean_in", "Boolean"),
            gives("integer_out", "Integer"),
            gives("boolean_out", "Boolean"),
            gives("string_size", "Integer"),
            bindings=bindings(
                binding(
                    value("integer_in", "Integer", 41),
                    value("boolean_in", "Boolean", "true"),
                    value("string_in", "String", "abcde"),
                )
            ),
        )
    ],
    [],
    {"b.integer_out": "Integer", "b.boolean_out": "Boolean", "b.string_size": "Integer"},
)
CONNECTED_LINEAR = CONNECTED.replace(
    connection("strength", "b.k"), connection("strength", "b.k", linear(2, 1))
)
NESTED = whole(
    [
        source(),
        system(
            "inner",
            [component("c", "gain", takes("u"), connector(K, "parameter"), gives("y"))],
            [connection("strength", "c.k"), connection("in", "c.u"), connection("c.y", "out")],
            [connector("strength", "parameter"), takes("in"), gives("out")],
        ),
        gain(),
    ],
    [
        connection("strength", "inner.strength"),
        connection("a.y", "inner.in"),
        connection("inner.out", "b.u"),
    ],
    {"b.y": "Real"},
    connectors=[connector("strength", "parameter")],
    bindings=bindings(binding(_k(3, "strength"))),
)
TO_BOTH = parameter_mapping(entry("factor", K, linear(2)), entry("factor", "b"))
LENGTH = value("length", "Real", 2, unit="m")
AS_IT_IS = parameter_mapping(entry("length", "b", suppressUnitConversion="true"))


def _started(name: str, type: str, given: str, seen: str = "", seen_type: str = "") -> str:
    """echo b with a value for one of its inputs."""
    more = {"name": "Mode"} if type == "Enumeration" else {}
    inner = component(
        "b",
        "echo",
        takes(f"{name}_in", type, **more),
        gives(seen or f"{name}_out", seen_type or type, **more),
        bindings=bindings(binding(given)),
    )
    return whole([inner], [], {f"b.{seen or f'{name}_out'}": f"{type} Mode" if more else seen_type or type})


TRIPLE = {"expect": {"b.y": f"3*{U}"}, "tolerance": HOP}

CASES: tuple[Case, ...] = (
    *cases(
        "inline", "parameter values inside of the description", _system(bindings(binding(_k(3)))), **TRIPLE
    ),
    *cases(
        "file",
        "parameter values in an .ssv file",
        Package(
            _system(bindings(binding(source="resources/values.ssv"))),
            {"resources/values.ssv": _file(parameter_set(_k(3)))},
        ),
        **TRIPLE,
    ),
    *cases(
        "from-above",
        "parameter values of the system, for a component by its name",
        _system(outer=bindings(binding(_k(3, "b.k")))),
        **TRIPLE,
    ),
    *cases(
        "prefix",
        "the prefix of a binding is put before the names of its values",
        _system(outer=bindings(binding(_k(3), prefix="b."))),
        **TRIPLE,
    ),
    *cases(
        "higher-wins",
        "a value of the system goes before one of the component",
        _system(bindings(binding(_k(2))), bindings(binding(_k(3, "b.k")))),
        **TRIPLE,
    ),
    *cases(
        "later-wins",
        "of two bindings of one element the later one counts",
        _system(bindings(binding(_k(2)), binding(_k(3)))),
        **TRIPLE,
    ),
    *cases(
        "value-unit",
        "a value in another unit than its parameter: 0.01 m for an offset in mm",
        whole(
            [
                source(),
                gain(
                    "b", "gain_mm", unit="mm", bindings=bindings(binding(value("b", "Real", 0.01, unit="m")))
                ),
            ],
            [connection("a.y", "b.u")],
            {"b.y": "Real"},
        ),
        expect={"b.y": f"{U} + 10"},
        tolerance=HOP,
    ),
    *cases(
        "mapped",
        "a parameter mapping with another name and a LinearTransformation",
        _system(bindings(binding(FACTOR, mapping=_mapped(TO_K)))),
        **TRIPLE,
    ),
    *cases(
        "mapped-by-file",
        "values and mapping in files, .ssv and .ssm",
        Package(
            _system(
                bindings(
                    binding(source="resources/values.ssv", mapping=_mapped(source="resources/names.ssm"))
                )
            ),
            {
                "resources/values.ssv": _file(parameter_set(FACTOR)),
                "resources/names.ssm": _file(TO_K),
            },
        ),
        **TRIPLE,
    ),
    *cases(
        "parameter-connector",
        "a parameter of the system, connected to that of a component",
        CONNECTED,
        **TRIPLE,
    ),
    *cases(
        "system-input",
        "an input of the system that nobody drives keeps its value",
        START,
        expect={"b.y": "7 + 0*t"},
    ),
    *cases(
        "parameter-linear",
        "a LinearTransformation between a parameter of the system and that of a component",
        CONNECTED_LINEAR,
        expect={"b.y": f"7*{U}"},
        tolerance=0.1,
    ),
    *cases(
        "parameter-nested",
        "a parameter of the system through an inner system to a component",
        NESTED,
        expect={"b.y": f"3*{U}"},
        tolerance=0.15,
    ),
    *cases(
        "mapped-twice",
        "one value for two parameters, by a mapping",
        _system(bindings(binding(FACTOR, mapping=_mapped(TO_BOTH)))),
        expect={"b.y": f"3*{U} + 1.5"},
        tolerance=HOP,
    ),
    *cases(
        "mapped-suppressed",
        "a mapping that suppresses the conversion of units",
        whole(
            [gain("b", "gain_mm", unit="mm", bindings=bindings(binding(LENGTH, mapping=_mapped(AS_IT_IS))))],
            [],
            {"b.y": "Real"},
        ),
        expect={"b.y": "2 + 0*t"},
    ),
    *cases(
        "value-item",
        "a value for an enumeration, by the name of its item",
        _started("mode", "Enumeration", value("mode_in", "Enumeration", "fast")),
        expect={"b.mode_out": "3 + 0*t"},
    ),
    *cases(
        "value-large",
        "a value for an Int64 that is no double",
        _started("int64", "Int64", value("int64_in", "Int64", 2**53 + 1), "int64_rest", "Integer"),
        (3,),
        expect={"b.int64_rest": f"{(2**53 + 1) % 1000} + 0*t"},
    ),
    *cases(
        "value-types",
        "values for integers, Booleans and strings",
        ECHO,
        expect={"b.integer_out": "42 + 0*t", "b.boolean_out": "0*t", "b.string_size": "5 + 0*t"},
    ),
)
