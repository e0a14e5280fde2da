"""Values of every type, arrays, strings and binaries through the binding, in both FMI versions.

With the FMU in this process, and in one of its own.
"""

import ctypes
import gc
from collections.abc import Iterator
from dataclasses import replace

import pytest
from hypothesis import given, settings, strategies as st

from orchestrator.core import native
from orchestrator.fmi.instance import Instance
from orchestrator.fmi.variable import RANGES, Scalar, Value
from specs.errors import InputError, RunError
from tests.orchestrator.every import Every, every, references

TINY, HUGE = 5e-324, 1.7976931348623157e308
REALS: tuple[Scalar, ...] = (0.1, -0.0, TINY, -HUGE)
TEXTS: tuple[Scalar, ...] = ("", "a", "Zürich → 東京", "x" * 60, 'quotes " \n and \t')
# The last one differs from its neighbour only beyond the precision of a double.
WIDE: tuple[Scalar, ...] = (-5, 9007199254740993)


def samples(type_: str) -> tuple[Scalar, ...]:
    """Values of a type that show where it is cut."""
    if type_ in ("Real", "Float64"):
        return REALS
    if type_ == "Float32":
        return (0.5, -0.0, 1.401298464324817e-45, 3.4028234663852886e38)
    if type_ in ("Boolean", "Clock"):
        return (True, False)
    if type_ == "String":
        return TEXTS
    if type_ == "Binary":
        return (b"", b"\0", b"a\0b\0", bytes(range(60)))
    if type_ == "Enumeration":
        return WIDE
    low, high = RANGES[type_]
    return (low, high, 1, low + 1, high - 1)


@pytest.fixture(scope="module", params=[2, 3], ids=["FMI2", "FMI3"])
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Every:
    return every(request.param, tmp_path_factory.mktemp("every"), modes=False)


@pytest.fixture(scope="module")
def built3(tmp_path_factory: pytest.TempPathFactory) -> Every:
    return every(3, tmp_path_factory.mktemp("every"))


@pytest.fixture(scope="module", params=[False, True], ids=["here", "apart"])
def apart(request: pytest.FixtureRequest) -> bool:
    return request.param


@pytest.fixture
def instance(built: Every, apart: bool) -> Iterator[Instance]:
    with started(built, apart) as made:
        yield made


def started(built: Every, apart: bool = False, **start: int) -> Instance:
    """In step mode; `apart`: in a process of its own."""
    if apart and native.binaries().host is None:
        pytest.skip("FMUs in processes of their own are not supported here")
    instance = Instance(replace(built.component, start=start), isolated=apart, limit_s=20.0)
    instance.set_values(start)
    instance.enter_initialisation()
    instance.exit_initialisation()
    if instance.event_mode:
        instance.enter_step()
    return instance


def same(found: Value, expected: Value) -> bool:
    """Equal in type and value, -0.0 told from 0.0."""
    return repr(found) == repr(expected)


def test_each_type_comes_back_as_it_was(instance: Instance) -> None:
    for type_ in {t for t, _ in references(instance.model.fmi_version).values() if t != "Clock"}:
        for sample in samples(type_):
            instance.set_values({f"{type_}.in": sample})
            assert same(instance.values([f"{type_}.in"])[f"{type_}.in"], sample), type_
            instance.step(0.0, 0.1)
            assert same(instance.values([f"{type_}.out"])[f"{type_}.out"], sample), type_


def test_all_at_once(instance: Instance) -> None:
    """Groups of several types, and several variables in each."""
    names = [n for n in references(instance.model.fmi_version) if n in instance.model.variables]
    inputs = [n for n in names if n.endswith(".in")]
    told = {n: samples(instance.variable(n).type)[-1] for n in inputs}
    instance.set_values(told)
    instance.step(0.0, 0.1)
    found = instance.values(names)
    assert list(found) == names
    for name, value in told.items():
        assert same(found[name], value)
        assert same(found[name.replace(".in", ".out")], value)


def test_arrays_come_back_element_by_element(built3: Every, apart: bool) -> None:
    with started(built3, apart) as instance:
        for type_ in {t for t, _ in references(3).values() if t != "Clock"}:
            told = (samples(type_) * 3)[:3]
            instance.set_values({f"{type_}.array_in": told})
            instance.step(0.0, 0.1)
            found = instance.values([f"{type_}.array_out", f"{type_}.out", f"{type_}.array_in"])
            assert same(found[f"{type_}.array_in"], told)
            assert same(found[f"{type_}.array_out"], told)
            assert found[f"{type_}.out"] in (0, "", b"")


@pytest.mark.parametrize("size", [1, 2, 8])
def test_a_structural_parameter_sizes_arrays(built3: Every, apart: bool, size: int) -> None:
    told = {
        "Int16.array_in": tuple(range(size)),
        "Float64.array_in": tuple(0.5 + k for k in range(size)),
        "Binary.array_in": tuple(b"x" * k for k in range(size)),
    }
    with started(built3, apart, size=size) as instance:
        instance.set_values(told)
        instance.step(0.0, 0.1)
        assert instance.values(["size"])["size"] == size
        assert instance.values([n.replace("_in", "_out") for n in told]) == {
            n.replace("_in", "_out"): v for n, v in told.items()
        }
        assert instance.get("Float64.array_out", "Int16.out").shape == (size + 1,)


def test_a_structural_parameter_is_refused_after_configuration(built3: Every, apart: bool) -> None:
    with started(built3, apart) as instance, pytest.raises(RunError, match="not instantiated just now"):
        instance.set(size=2)


@given(
    reals=st.lists(st.floats(allow_nan=False), min_size=3, max_size=3),
    texts=st.lists(st.text(st.characters(blacklist_characters="\0", codec="utf-8"), max_size=15), min_size=3,
                   max_size=3),
    data=st.lists(st.binary(max_size=64), min_size=3, max_size=3),
    wide=st.lists(st.integers(*RANGES["UInt64"]), min_size=3, max_size=3),
)  # fmt: skip
@settings(deadline=None, max_examples=50)
def test_any_value_comes_back(
    built3: Every, apart: bool, reals: list[float], texts: list[str], data: list[bytes], wide: list[int]
) -> None:
    lists: dict[str, list[float] | list[str] | list[bytes] | list[int]] = {
        "Float64": reals,
        "String": texts,
        "Binary": data,
        "UInt64": wide,
    }
    told: dict[str, Value] = {f"{type_}.array_in": tuple(values) for type_, values in lists.items()}
    with started(built3, apart) as instance:
        instance.set_values(told)
        instance.step(0.0, 0.1)
        found = instance.values([name.replace("_in", "_out") for name in told])
        assert repr(list(found.values())) == repr(list(told.values()))


def test_numbers_pass_through_infinity_and_nan(instance: Instance) -> None:
    """Judging them is the core's business, not the binding's."""
    name = "Real" if instance.model.fmi_version == 2 else "Float32"
    for value in (float("inf"), float("-inf"), float("nan")):
        instance.set_values({f"{name}.in": value})
        assert same(instance.values([f"{name}.in"])[f"{name}.in"], value)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("Int8.in", 128),
        ("UInt32.in", -1),
        ("UInt64.in", 2**64),
        ("Int64.in", 0.5),
        ("Boolean.in", 2),
        ("String.in", "a\0b"),
        ("String.in", b"bytes"),
        ("Binary.in", "text"),
        ("Float64.in", "1.0"),
    ],
)
def test_what_a_type_cannot_hold_is_refused(built3: Every, apart: bool, name: str, value: Value) -> None:
    with (
        started(built3, apart) as instance,
        pytest.raises(InputError, match=rf"component every: .* is no value of {name}"),
    ):
        instance.set_values({name: value})


def test_the_core_cannot_tell_an_fmu_what_its_type_does_not_hold(built3: Every, apart: bool) -> None:
    """A connection or mapping may bring any number; it is never cut without a word."""
    from orchestrator.fmi.buffers import Values

    cases = (("UInt8.in", 256), ("Int16.in", -40000), ("UInt32.in", 2**32), ("Float32.in", 1e300))
    with started(built3, apart) as instance:
        for name, number in cases:
            values = Values(instance.component, [instance.variable(name)])
            if name == "Float32.in":
                values.cells[0].real = number
            else:
                values.cells[0].integer = int(number)
            with pytest.raises(RunError, match=r"does not fit the type \w+ of variable \d+"):
                instance.call("set", values.structure)
            assert instance.get(name)[0] == 0.0


def test_an_array_of_another_size_is_refused(built3: Every, apart: bool) -> None:
    with started(built3, apart) as instance:
        with pytest.raises(InputError, match=r"Int8.array_in has 3 elements, 2 values are given"):
            instance.set_values({"Int8.array_in": (1, 2)})
        with pytest.raises(InputError, match=r"Int8.in has 1 elements, 2 values are given"):
            instance.set_values({"Int8.in": (1, 2)})


def test_texts_are_no_numbers(instance: Instance) -> None:
    with pytest.raises(InputError, match=r"String.in is no number but a String"):
        instance.get("String.in")


def allocated() -> int:
    """Bytes that malloc has given out."""

    class MallInfo(ctypes.Structure):
        _fields_ = [(name, ctypes.c_size_t) for name in "abcdefg"] + [("uordblks", ctypes.c_size_t)] + [
            ("h", ctypes.c_size_t), ("i", ctypes.c_size_t)
        ]  # fmt: skip

    gc.collect()
    info = ctypes.CDLL(None).mallinfo2
    info.restype = MallInfo
    return info().uordblks


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallinfo2"), reason="needs glibc's count of malloc")
def test_no_memory_is_left_behind(built3: Every) -> None:
    def use(count: int) -> None:
        for _ in range(count):
            with started(built3) as instance:
                told: dict[str, Value] = {"String.array_in": ("x" * 60,) * 3, "Binary.in": b"y" * 60}
                instance.set_values(told)
                instance.step(0.0, 0.1)
                instance.values(["String.array_out", "Binary.out"])
                instance.free_state(instance.get_state())

    use(50)
    before = allocated()
    use(300)  # forgotten strings alone would be 100 kB
    assert allocated() - before < 30_000
