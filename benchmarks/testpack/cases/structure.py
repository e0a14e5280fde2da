"""How systems are put together: systems in systems, signal dictionaries, names."""

from benchmarks.testpack.case import Case, Package, cases
from benchmarks.testpack.cases.common import HOP, U, gain, source, whole
from benchmarks.testpack.render import (
    NAMESPACES,
    VERSION,
    XML,
    binding,
    bindings,
    component,
    connection,
    gives,
    linear,
    lines,
    ssd,
    system,
    takes,
    value,
)

INNER = system(
    "inner",
    [gain("b", "gain_double")],
    [connection("in", "b.u"), connection("b.y", "out")],
    [takes("in"), gives("out")],
)
PLUGS = (takes("in"), gives("out"))


def _around(element: str, outer: str = "") -> str:
    """source a → the system `inner` → gain c."""
    return whole(
        [source(), element, gain("c")],
        [connection("a.y", "inner.in"), connection("inner.out", "c.u")],
        {"c.y": "Real"},
        bindings=outer,
    )


PASSED_ON = _around(system("inner", [gain("b")], [connection("in", "out")], [takes("in"), gives("out")]))
UNITS_NESTED = whole(
    [
        source(),
        gain("d", "gain_m", unit="m"),
        system(
            "inner",
            [gain("b", "gain_m", unit="m")],
            [connection("in", "b.u"), connection("b.y", "out", linear(1, 2000))],
            [takes("in", unit="mm"), gives("out", unit="mm")],
        ),
        gain("c", "gain_m", unit="m"),
    ],
    [connection("a.y", "d.u"), connection("d.y", "inner.in"), connection("inner.out", "c.u")],
    {"c.y": "Real"},
)
DOUBLE = {"expect": {"c.y": f"2*{U}"}, "tolerance": HOP}
DEEP = system(
    "inner",
    [
        system(
            "core",
            [gain("b", "gain_double")],
            [connection("in", "b.u"), connection("b.y", "out")],
            [takes("in"), gives("out")],
        )
    ],
    [connection("in", "core.in"), connection("core.out", "out")],
    [takes("in"), gives("out")],
)
SSD_TYPE, SSP_TYPE = "application/x-ssp-definition", "application/x-ssp-package"
DICTIONARY = lines(
    f'<ssb:SignalDictionary {NAMESPACES} version="{VERSION}" name="bus">',
    '<ssb:DictionaryEntry name="signal"><ssc:Real/></ssb:DictionaryEntry>',
    "</ssb:SignalDictionary>",
)


def _bus(content: str) -> str:
    """source a and gain b meet in a signal of a dictionary."""
    holder = lines("<ssd:SignalDictionaries>", content, "</ssd:SignalDictionaries>")
    reference = lines(
        '<ssd:SignalDictionaryReference name="bus" dictionary="bus">',
        "<ssd:Connectors>",
        '<ssd:Connector name="signal" kind="inout"><ssc:Real/></ssd:Connector>',
        "</ssd:Connectors>",
        "</ssd:SignalDictionaryReference>",
    )
    return whole(
        [source(), reference, gain()],
        [connection("a.y", "bus.signal"), connection("bus.signal", "b.u")],
        {"b.y": "Real"},
        dictionaries=holder,
    )


INLINE_BUS = lines('<ssd:SignalDictionary name="bus">', DICTIONARY, "</ssd:SignalDictionary>")
FILE_BUS = '<ssd:SignalDictionary name="bus" source="resources/bus.ssb"/>'


def _names(values: str = "") -> str:
    return whole(
        [source("Quelle ä"), component("Verstärker", "verstärker", takes("größe"), gives("grösse·k"))],
        [connection("Quelle ä.y", "Verstärker.größe")],
        {"Verstärker.grösse·k": "Real"},
        bindings=values,
    )


UNCONNECTED = whole([component("b", "gain_half", takes("u"), gives("y"))], [], {"b.y": "Real"})

CASES: tuple[Case, ...] = (
    *cases("nested", "a system inside of the system", _around(INNER), **DOUBLE),
    *cases("nested-twice", "a system in a system in the system", _around(DEEP), **DOUBLE),
    *cases(
        "nested-ssd",
        "a component that is a system of another .ssd",
        Package(
            _around(component("inner", "resources/inner.ssd", *PLUGS, type=SSD_TYPE)),
            {"resources/inner.ssd": ssd(INNER).replace("resources/", "")},
            fmus=("gain_double",),
        ),
        **DOUBLE,
    ),
    *cases(
        "nested-ssp",
        "a component that is a system of an .ssp",
        Package(
            _around(component("inner", "resources/inner.ssp", *PLUGS, type=SSP_TYPE)),
            {"resources/inner.ssp": Package(ssd(INNER))},
        ),
        **DOUBLE,
    ),
    *cases(
        "nested-values",
        "a value for a component of an inner system, by its path",
        _around(INNER, bindings(binding(value("inner.b.k", "Real", 5)))),
        expect={"c.y": f"5*{U}"},
        tolerance=0.5,
    ),
    *cases(
        "bus",
        "a signal dictionary inside of the description",
        _bus(INLINE_BUS),
        expect={"b.y": U},
        tolerance=HOP,
    ),
    *cases(
        "bus-file",
        "a signal dictionary in an .ssb file",
        Package(_bus(FILE_BUS), {"resources/bus.ssb": f"{XML}\n{DICTIONARY}\n"}),
        expect={"b.y": U},
        tolerance=HOP,
    ),
    *cases(
        "twice",
        "one FMU used twice, with a value of its own for each",
        whole(
            [
                source(),
                gain("b", bindings=bindings(binding(value("k", "Real", 2)))),
                gain("c", bindings=bindings(binding(value("k", "Real", 3)))),
            ],
            [connection("a.y", "b.u"), connection("b.y", "c.u")],
            {"b.y": "Real", "c.y": "Real"},
        ),
        expect={"b.y": f"2*{U}", "c.y": f"6*{U}"},
        tolerance=0.2,
    ),
    *cases(
        "twice-plain",
        "one FMU used twice",
        whole(
            [source(), gain("b"), gain("c")],
            [connection("a.y", "b.u"), connection("b.y", "c.u")],
            {"b.y": "Real", "c.y": "Real"},
        ),
        expect={"b.y": U, "c.y": U},
        tolerance=0.1,
    ),
    *cases(
        "names",
        "names of systems, components, files and variables that are not ASCII",
        _names(),
        expect={"Verstärker.grösse·k": f"3*{U}"},
        tolerance=HOP,
    ),
    *cases(
        "names-values",
        "a value for a parameter whose name is not ASCII",
        _names(bindings(binding(value("Verstärker.k₁", "Real", 4)))),
        expect={"Verstärker.grösse·k": f"4*{U}"},
        tolerance=HOP,
    ),
    *cases(
        "passed-on", "an inner system that passes its input on", PASSED_ON, expect={"c.y": U}, tolerance=HOP
    ),
    *cases(
        "units-nested",
        "a system between two FMUs in metres, whose own connectors are in millimetres",
        UNITS_NESTED,
        expect={"c.y": f"{U} + 2"},
        tolerance=HOP,
    ),
    *cases(
        "unconnected",
        "an input without a connection keeps its start value",
        UNCONNECTED,
        expect={"b.y": "1 + 0*t"},
    ),
)
