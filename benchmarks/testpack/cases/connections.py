"""Connections and what may happen on them."""

from benchmarks.testpack.case import Case, cases
from benchmarks.testpack.cases.common import HOP, U, gain, pair, source, whole
from benchmarks.testpack.render import component, connection, gives, linear, mapping, takes

COUNT = "whole(t/0.3)"
MIDDLES = (0.2, 0.5, 0.8)  # when what counts stands still for more than a step


def _echo(variable: str, type: str, inner: str, enumeration: tuple[str, str] = ("", "")) -> str:
    """source a → echo b, for one of the types."""
    given = {"Boolean": "on", "Integer": "count", "Enumeration": "mode"}[type]
    names = [{"name": n} if n else {} for n in enumeration]
    fmu = "echo_gear" if enumeration[1] == "Gear" else "echo"
    return whole(
        [
            component("a", "source", gives(given, type, **names[0])),
            component(
                "b",
                fmu,
                takes(f"{variable}_in", type, **names[1]),
                gives(f"{variable}_out", type, **names[1]),
            ),
        ],
        [connection(f"a.{given}", f"b.{variable}_in", inner)],
        {f"b.{variable}_out": f"Enumeration {enumeration[1]}" if type == "Enumeration" else type},
    )


BOOLEAN = mapping("Boolean", {"true": "false", "false": "true"})
INTEGER = mapping("Integer", {0: 10, 1: 20, 2: 30})
ENUMERATION = mapping("Enumeration", {"off": "off", "slow": "slow", "fast": "fast"})


def _fan_out(inner: str = "") -> str:
    return whole(
        [source(), component("b", "sum", takes("u1"), takes("u2"), gives("y"))],
        [connection("a.y", "b.u1"), connection("a.y", "b.u2", inner)],
        {"b.y": "Real"},
    )


OUTSIDE = whole([source()], [connection("a.y", "out", linear(2, 100))], {}, connectors=[gives("out")])
CHAIN = whole(
    [gain("d"), gain("c"), gain("b"), source()],
    [connection("a.y", "b.u"), connection("b.y", "c.u"), connection("c.y", "d.u")],
    {"d.y": "Real"},
)

CASES: tuple[Case, ...] = (
    *cases("plain", "a connection", pair(), expect={"b.y": U}, tolerance=HOP),
    *cases(
        "linear",
        "LinearTransformation factor 2, offset 100",
        pair(linear(2, 100)),
        expect={"b.y": f"2*{U} + 100"},
        tolerance=HOP,
    ),
    *cases(
        "backwards",
        "a connection written from the input to the output",
        pair(backwards=True),
        expect={"b.y": U},
        tolerance=HOP,
    ),
    *cases(
        "linear-backwards",
        "LinearTransformation on a connection written backwards: it acts in the direction of the signal",
        pair(linear(2, 100), backwards=True),
        expect={"b.y": f"2*{U} + 100"},
        tolerance=HOP,
    ),
    *cases(
        "linear-outside",
        "LinearTransformation on the way to an output of the system",
        OUTSIDE,
        expect={"out": f"2*{U} + 100"},
        tolerance=HOP,
    ),
    *cases(
        "fan-out",
        "one output to two inputs",
        _fan_out(),
        expect={"b.y": f"2*{U}"},
        tolerance=0.1,
    ),
    *cases(
        "fan-out-linear",
        "one output to two inputs, with a transformation on one of the connections",
        _fan_out(linear(10)),
        expect={"b.y": f"11*{U}"},
        tolerance=0.2,
    ),
    *cases(
        "boolean-mapping",
        "BooleanMappingTransformation: true to false and false to true",
        _echo("boolean", "Boolean", BOOLEAN),
        expect={"b.boolean_out": f"{COUNT} % 2"},
        times=MIDDLES,
    ),
    *cases(
        "integer-mapping",
        "IntegerMappingTransformation: 0, 1, 2 to 10, 20, 30",
        _echo("integer", "Integer", INTEGER),
        expect={"b.integer_out": f"pick({COUNT}, 11, 21, 31)"},
        times=MIDDLES,
    ),
    *cases(
        "enumeration-mapping",
        "EnumerationMappingTransformation between enumerations that number their items differently",
        _echo("mode", "Enumeration", ENUMERATION, ("Mode", "Gear")),
        expect={"b.mode_out": f"pick({COUNT}, 30, 10, 20)"},
        times=MIDDLES,
    ),
    *cases(
        "initial-outputs",
        "initial outputs are propagated through a chain declared against its direction",
        CHAIN,
        expect={"d.y": "5 + 0*t"},
        times=(0.0,),
        stop_s=0.8,
    ),
)
