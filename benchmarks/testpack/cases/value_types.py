"""Values of every type through a connection, and arrays of FMI 3."""

from benchmarks.testpack.case import Case, cases
from benchmarks.testpack.cases.common import whole
from benchmarks.testpack.models import FMI3_TYPES, SET
from benchmarks.testpack.render import (
    binding,
    bindings,
    component,
    connection,
    connector,
    gives,
    linear,
    size,
    takes,
    value,
)


def _through(name: str, type: str, seen: str, seen_type: str, /, **more: str) -> str:
    """echo a, whose input has a value of its own, → echo b; what b makes of it is seen."""
    outputs = dict.fromkeys((f"{name}_out", seen))
    kinds = {f"{name}_out": gives(f"{name}_out", type, **more)}
    shown = [kinds.get(o) or gives(o, seen_type) for o in outputs]
    return whole(
        [
            component("a", "echo_set", gives(f"{name}_out", type, **more)),
            component("b", "echo", takes(f"{name}_in", type, **more), *shown),
        ],
        [connection(f"a.{name}_out", f"b.{name}_in")],
        {f"b.{seen}": f"Enumeration {more['name']}" if seen_type == "Enumeration" else seen_type},
    )


def _number(name: str, type: str, fmi: tuple[int, ...]) -> list[Case]:
    """Numbers grow by one in each echo."""
    return cases(
        f"type-{name}",
        f"{type} from one FMU to the next",
        _through(name, type, f"{name}_out", type),
        fmi,
        expect={f"b.{name}_out": f"{SET[f'{name}_in']} + 2 + 0*t"},
    )


def _long(name: str, type: str) -> list[Case]:
    """Of 64 bits: what they leave when divided by 1000 shows each of them (the sign is that of C)."""
    sent = int(str(SET[f"{name}_in"])) + 1
    rest = abs(sent) % 1000 * (1 if sent > 0 else -1)
    return cases(
        f"type-{name}",
        f"{type} from one FMU to the next, with all its bits",
        _through(name, type, f"{name}_rest", "Integer"),
        (3,),
        expect={f"b.{name}_rest": f"{rest} + 0*t"},
    )


LENGTH = len(str(SET["string_in"]).encode())
SUM = sum(bytes.fromhex(str(SET["binary_in"])))
NUMBERS = [n for n in FMI3_TYPES if n not in ("binary", "int64", "uint64")]


def _vectors(second: str, more: str = "", dimension: int | str = 3) -> str:
    """vector3 a → another one b."""
    return whole(
        [
            component("a", "vector3", gives("y", "Real", size(3))),
            component("b", second, takes("u", "Real", size(dimension)), gives("total"), bindings=more),
        ],
        [connection("a.y", "b.u")],
        {"b.total": "Real"},
    )


SIZED = whole(
    [
        component(
            "b",
            "vector_n",
            connector("n", "structuralParameter", "UInt64"),
            takes("u", "Real", size(2)),
            gives("total"),
            bindings=bindings(binding(value("n", "UInt64", 2), value("u", "Real", "10 20", size(2)))),
        )
    ],
    [],
    {"b.total": "Real"},
)
GIVEN = bindings(binding(value("u", "Real", "10 20 30", size(3))))
ALONE = whole(
    [component("b", "vector3", takes("u", "Real", size(3)), gives("total"), bindings=GIVEN)],
    [],
    {"b.total": "Real"},
)


def _matrices(second: str) -> str:
    """A matrix of 2 × 3 to another one."""
    rows, columns = (2, 3) if second == "matrix" else (3, 2)
    return whole(
        [
            component("a", "matrix", gives("y", "Real", size(2) + size(3))),
            component("b", second, takes("u", "Real", size(rows) + size(columns)), gives("total")),
        ],
        [connection("a.y", "b.u")],
        {"b.total": "Real"},
    )


LINEAR = _vectors("vector3").replace('endConnector="u">', f'endConnector="u">{linear(2, 1)}')
UNSAID = whole(
    [
        component("a", "vector3", gives("y")),
        component("b", "vector3", takes("u"), gives("total")),
    ],
    [connection("a.y", "b.u")],
    {"b.total": "Real"},
)
ELEMENTS = whole(
    [component("b", "vector3", gives("y", "Real", size(3)), gives("total"))],
    [connection("b.y", "all")],
    {"b.total": "Real"},
    connectors=[gives("all", "Real", size(3))],
)

CASES: tuple[Case, ...] = (
    *_number("real", "Real", (2, 3)),
    *_number("integer", "Integer", (2, 3)),
    *cases(
        "type-boolean",
        "Boolean from one FMU to the next",
        _through("boolean", "Boolean", "boolean_out", "Boolean"),
        expect={"b.boolean_out": "1 + 0*t"},
    ),
    *cases(
        "type-enumeration",
        "Enumeration from one FMU to the next",
        _through("mode", "Enumeration", "mode_out", "Enumeration", name="Mode"),
        expect={"b.mode_out": "2 + 0*t"},
    ),
    *cases(
        "type-string",
        "String from one FMU to the next, not only ASCII: its length in bytes",
        _through("string", "String", "string_size", "Integer"),
        expect={"b.string_size": f"{LENGTH} + 0*t"},
    ),
    *[case for name in NUMBERS for case in _number(name, FMI3_TYPES[name], (3,))],
    *_long("int64", "Int64"),
    *_long("uint64", "UInt64"),
    *cases(
        "type-binary",
        "Binary from one FMU to the next, with a zero byte: the sum of its bytes",
        _through("binary", "Binary", "binary_sum", "Integer"),
        (3,),
        expect={"b.binary_sum": f"{SUM} + 0*t"},
    ),
    *cases(
        "array",
        "an array of fixed size from one FMU to the next",
        _vectors("vector3"),
        (3,),
        expect={"b.total": "12 + 0*t"},
    ),
    *cases(
        "array-sized",
        "an array of fixed size to one whose size is a structural parameter",
        _vectors("vector_n"),
        (3,),
        expect={"b.total": "12 + 0*t"},
    ),
    *cases(
        "array-linear",
        "a LinearTransformation for each element of an array",
        LINEAR,
        (3,),
        expect={"b.total": "24 + 0*t"},
    ),
    *cases(
        "array-unsaid",
        "arrays whose connectors do not state a size",
        UNSAID,
        (3,),
        expect={"b.total": "12 + 0*t"},
    ),
    *cases(
        "array-outside",
        "an array that is an output of the system",
        ELEMENTS,
        (3,),
        expect={"b.total": "9 + 0*t"},
    ),
    *cases(
        "matrix",
        "an array of two dimensions",
        _matrices("matrix"),
        (3,),
        expect={"b.total": "45 + 0*t"},
    ),
    *cases(
        "array-values",
        "values for all elements of an array",
        ALONE,
        (3,),
        expect={"b.total": "63 + 0*t"},
    ),
    *cases(
        "array-resized",
        "a value for the structural parameter, and values for as many elements",
        SIZED,
        (3,),
        expect={"b.total": "31 + 0*t"},
    ),
)
