"""Values of every type of FMI 3 on connections, end to end: what one FMU shows arrives at the other."""

import tempfile
from pathlib import Path

import pytest

from fmus.toolchain import compiler
from fmus.toolchain.build import SHIM
from orchestrator.fmi.variable import FMI3_TYPES
from orchestrator.run.simulate import simulate
from tests.orchestrator.ssp.test_bindings import bindings, inline, value
from tests.orchestrator.ssp.test_transformations import mapping
from tests.orchestrator.systems import HERE, component, connection, connector, load, refused, ssd
from tests.verification.comparison.paper import paper

TYPES = [t for t in FMI3_TYPES if t not in ("Clock", "Enumeration")]
NUMBERS = [t for t in TYPES if t not in ("String", "Binary")]
LARGE = {"Float64": "-1.25e300", "Float32": "0.1", "Boolean": "true", "UInt64": str(2**53), "Int8": "-128"}


def start(type_: str, size: int) -> tuple[str, str]:
    """Start attribute and element of a variable."""
    if type_ in ("String", "Binary"):
        return "", '<Start value=""/>' * size
    zero = "false" if type_ == "Boolean" else "0"
    return f' start="{" ".join([zero] * size)}"', ""


def variables(name: str, type_: str, k: int, size: int = 1, declared: str = "") -> str:
    """Parameter `name`, output name_shown of its value, input name_in and output name_out of its value."""
    attribute, element = start(type_, size)
    if type_ == "Enumeration":
        attribute = f' start="{1 if declared == "Gear" else 0}"'
    dimension = f'<Dimension start="{size}"/>' if size > 1 else ""
    declared = f' declaredType="{declared}"' if declared else ""
    return "".join(
        f'<{type_} name="{n}" valueReference="{10 * k + i}" causality="{c}"{v}{declared}'
        f"{attribute if i in (0, 2) else ''}>{dimension}{element if i in (0, 2) else ''}</{type_}>"
        for i, (n, c, v) in enumerate((
            (name, "parameter", ' variability="fixed"'),
            (f"{name}_shown", "output", ' variability="discrete"'),
            (f"{name}_in", "input", ' variability="discrete"'),
            (f"{name}_out", "output", ' variability="discrete"'),
        ))
    )  # fmt: skip


MODEL = "".join(
    [
        '<Int32 name="length" valueReference="5" causality="output"/>',
        *(variables(t.lower(), t, k) for k, t in enumerate(TYPES, 1)),
        variables("gear", "Enumeration", 17, declared="Gear"),
        variables("lever", "Enumeration", 18, declared="Lever"),
        *(variables(f"{t.lower()}s", t, 20 + k, 3) for k, t in enumerate(("Float64", "Int16", "Boolean"))),
    ]
)


@pytest.fixture(scope="module")
def echo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU of echo3.c."""
    target = compiler.host()
    with tempfile.TemporaryDirectory() as scratch:
        thing = Path(scratch) / "echo.o"
        compiler.compile_object(HERE / "echo3.c", thing, target.name, [f"-I{SHIM}"])
        linked = compiler.link_shared([thing], Path(scratch) / f"echo{target.suffix}", target.name)
        library = linked.read_bytes()
    return paper(tmp_path_factory.mktemp("echo"), "echo", MODEL, library=library)


def passed(
    folder: Path, echo: Path, name: str, given: str, inner: str = "", target: str = "", more: str = ""
) -> list[list[float]]:
    """Rows of the record where `giver` shows a parameter, `taker` passes it on, and both are seen."""
    target = target or name
    text = ssd(
        [
            component("giver", "echo", connector(f"{name}_shown", "output", ""),
                      inner=bindings(inline(given))),
            component("taker", "echo", connector(f"{target}_in", "input", ""),
                      connector(f"{target}_out", "output", ""), connector("length", "output", "")),
        ],
        [
            connection(f"giver.{name}_shown", f"taker.{target}_in", inner),
            connection("taker.length", "length"),
            *([] if more else [connection(f"taker.{target}_out", "seen")]),
        ],
        [connector("length", "output", ""), connector("seen", "output", "")],
        version="2.0",
    )  # fmt: skip
    record = simulate(load(folder, text, {"echo": echo}), 3)
    return [record.column(n).tolist() for n in record.names if n != "time"]


@pytest.mark.parametrize("type_", NUMBERS)
def test_numbers_of_every_type_arrive_as_they_are(tmp_path: Path, echo: Path, type_: str) -> None:
    text = LARGE.get(type_, "100")
    rows = passed(tmp_path, echo, type_.lower(), value(type_.lower(), type_, text))
    expected = 1.0 if text == "true" else float(text)
    assert rows[-1][-1] == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize(
    ("type_", "text", "size", "first"), [("String", "ä word", 7, 0xC3), ("Binary", "ff00", 2, 255)]
)
def test_strings_and_binaries_arrive(
    tmp_path: Path, echo: Path, type_: str, text: str, size: int, first: int
) -> None:
    rows = passed(tmp_path, echo, type_.lower(), value(type_.lower(), type_, text), more="unseen")
    assert rows[0][-1] == size + 1000 * first


def test_arrays_arrive_element_by_element(tmp_path: Path, echo: Path) -> None:
    for name, type_, text, expected in (
        ("float64s", "Float64", "1.5 -2 3", [1.5, -2.0, 3.0]),
        ("int16s", "Int16", "7 -8 9", [7, -8, 9]),
        ("booleans", "Boolean", "true false true", [1, 0, 1]),
    ):
        rows = passed(tmp_path, echo, name, value(name, type_, text, dimensions=(3,)))
        assert [row[-1] for row in rows[1:]] == expected


def test_transformations_change_what_arrives(tmp_path: Path, echo: Path) -> None:
    for name, type_, text, inner, target, expected in (
        ("float64", "Float64", "3", '<ssc:LinearTransformation factor="2" offset="1"/>', "", 7.0),
        ("float64s", "Float64", "1 2 3", '<ssc:LinearTransformation factor="2"/>', "", 6.0),
        ("boolean", "Boolean", "true", mapping("Boolean", ("true", "false"), ("false", "true")), "", 0),
        ("int32", "Int32", "3", mapping("Integer", (3, -4)), "", -4),
        ("int32", "Int32", "5", mapping("Integer", (3, -4)), "", 5),
        ("int16s", "Int16", "3 1 3", mapping("Integer", (3, -4)), "", -4),
        (
            "gear",
            "Enumeration",
            "high",
            mapping("Enumeration", ("low", "slow"), ("high", "fast")),
            "lever",
            5,
        ),
        ("gear", "Enumeration", "high", "", "int64", 2),
        ("int32", "Int32", "9", mapping("Integer", (9, 5)), "lever", 5),
    ):
        sizes = (3,) if name.endswith("s") else ()
        rows = passed(tmp_path, echo, name, value(name, type_, text, dimensions=sizes), inner, target)
        assert rows[-1][-1] == expected, (name, inner)


def test_partial_tables_pass_what_they_do_not_hold(tmp_path: Path, echo: Path) -> None:
    """An integer that a mapping into an enumeration does not name, but that is one of its values."""
    rows = passed(tmp_path, echo, "int32", value("int32", "Int32", "1"), mapping("Integer", (9, 5)), "lever")
    assert rows[-1][-1] == 1


def test_an_input_and_its_alias_have_one_source(tmp_path: Path) -> None:
    fmu = paper(
        tmp_path,
        "alias",
        '<Float64 name="u" valueReference="1" causality="input" start="0"><Alias name="also"/></Float64>'
        '<Float64 name="y" valueReference="2" causality="output"/>',
    )
    connectors = [connector("u", "input"), connector("also", "input"), connector("y", "output")]
    links = [connection("a.y", "a.u"), connection("a.y", "a.also")]
    text = ssd([component("a", "alias", *connectors)], links, version="2.0")
    message = refused(tmp_path, text, {"alias": fmu})
    assert (
        "line 13: a.also has a second source: it is an alias of u, which is connected in line 12" in message
    )
    one = load(tmp_path, text.replace(links[0], ""), {"alias": fmu})
    assert not [w for w in one.warnings if "is not connected" in w]


# ---- what would not arrive as it is ----


def between(source: str, target: str) -> str:
    """Two FMUs, an output of the one connected to an input of the other, nothing said of types."""
    parts = [
        component("a", "one", connector(source, "output", "")),
        component("b", "two", connector(target, "input", "")),
    ]
    return ssd(parts, [connection(f"a.{source}", f"b.{target}")], version="2.0")


def plain(folder: Path) -> dict[str, Path]:
    """FMUs with an output and an input of some types."""
    fmus = {}
    for name, causality, extra in (("one", "output", ""), ("two", "input", ' start="0"')):
        elements = "".join(
            f'<{t} name="{t.lower()}" valueReference="{i}" causality="{causality}"{extra}/>'
            for i, t in enumerate(("Float64", "Float32", "Int8", "UInt8", "Int64"))
        )
        if name == "one":
            elements += '<Int64 name="few" valueReference="9" causality="output" min="-3" max="100"/>'
        fmus[name] = paper(folder, name, elements)
    return fmus


def test_integers_need_room(tmp_path: Path) -> None:
    fmus = plain(tmp_path)
    for source, target in (("int8", "int64"), ("uint8", "int64"), ("few", "int8")):
        assert load(tmp_path, between(source, target), fmus).links
    for source, target, words in (
        (
            "int64",
            "int8",
            "… 9223372036854775807) does not fit b.int8 (Int8, -128 … 127)",
        ),
        ("int8", "uint8", "a.int8 (Int8, -128 … 127) does not fit b.uint8 (UInt8, 0 … 255)"),
        ("few", "uint8", "a.few (Int64, -3 … 100) does not fit b.uint8"),
        ("int8", "float64", "a.int8 (integer) does not fit b.float64 (real)"),
    ):
        assert words in refused(tmp_path, between(source, target), fmus)


def test_rounding_is_warned_of(tmp_path: Path) -> None:
    fmus = plain(tmp_path)
    assert any("a.float64 is rounded to single precision for b.float32" in w
               for w in load(tmp_path, between("float64", "float32"), fmus).warnings)  # fmt: skip
    assert not [w for w in load(tmp_path, between("float32", "float64"), fmus).warnings if "rounded" in w]


def test_media_types_that_differ_are_warned_of(tmp_path: Path, echo: Path) -> None:
    text = ssd(
        [component(n, "echo", connector(f"binary_{e}", kind, "Binary", "", (), **{"mime-type": t}))
         for n, e, kind, t in (("a", "shown", "output", "image/png"), ("b", "in", "input", "text/plain"))],
        [connection("a.binary_shown", "b.binary_in")],
        version="2.0",
    )  # fmt: skip
    assert any("a.binary_shown is image/png, but b.binary_in is text/plain" in w
               for w in load(tmp_path, text, {"echo": echo}).warnings)  # fmt: skip
