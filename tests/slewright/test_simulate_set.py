"""`simulate --set`: numbers in the type of what they set, arrays, and states at the start."""

from pathlib import Path

import pytest

from records.record import read
from tests.conftest import Command
from tests.orchestrator.every import every
from tests.orchestrator.exchange import exchange


def run(command: Command, fmu: Path, *settings: str) -> tuple[str, Path]:
    """What `simulate` says on stderr, and its record."""
    out = fmu.with_suffix(".parquet")
    given = [word for setting in settings for word in ("--set", setting)]
    done = command("simulate", fmu, "--stop", "0.2", "--step", "0.1", "--out", out, *given)
    assert done.returncode in (0, 2)
    return done.stderr, out


@pytest.mark.parametrize(
    ("setting", "column", "value"),
    [
        ("UInt64.in=18446744073709551615", "UInt64.out", 18446744073709551615),
        ("Int64.in=-9223372036854775808", "Int64.out", -9223372036854775808),
        ("Boolean.in=true", "Boolean.out", True),
        ("Int16.array_in=1,-2,3", "Int16.array_out[2]", -2),
        ("Float64.array_in=1 2.5 3", "Float64.array_out[2]", 2.5),
    ],
)
def test_an_input_takes_what_its_type_holds(
    slewright_here: Command, tmp_path: Path, setting: str, column: str, value: float
) -> None:
    said, out = run(slewright_here, every(3, tmp_path).path, setting)
    assert out.exists(), said
    assert read(out).column(column).tolist()[-1] == value


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("UInt8.in=300", "input UInt8.in is 300.0 at tick 0; valid: whole numbers of 0 … 255 (UInt8)"),
        ("Int32.in=0.5", "valid: whole numbers of -2147483648 … 2147483647 (Int32)"),
        ("Boolean.in=2", "valid: whole numbers of 0 … 1 (Boolean)"),
        ("Int16.array_in=1,2", "input Int16.array_in has 3 elements, not 2"),
        ("String.in=2", "input String.in is of type String; only numbers can be set"),
    ],
)
def test_what_an_input_cannot_hold_is_refused(
    slewright_here: Command, tmp_path: Path, setting: str, words: str
) -> None:
    said, out = run(slewright_here, every(3, tmp_path).path, setting)
    assert words in said
    assert not out.exists()


@pytest.mark.parametrize("version", [2, 3])
def test_a_state_begins_where_it_is_set(slewright_here: Command, tmp_path: Path, version: int) -> None:
    _, out = run(slewright_here, exchange(version, tmp_path), "exchange.x=1.5")
    assert read(out).column("x")[0] == 1.5


def test_what_is_calculated_cannot_be_set(slewright_here: Command, tmp_path: Path) -> None:
    said, _ = run(slewright_here, exchange(3, tmp_path), "exchange.y=1")
    assert (
        "exchange.y is of causality output, not a parameter, and has no start value that can be set" in said
    )


def test_of_one_fmu_the_component_goes_without_saying(slewright_here: Command, tmp_path: Path) -> None:
    _, out = run(slewright_here, exchange(3, tmp_path), "x=1.5")
    assert read(out).column("x")[0] == 1.5
    said, _ = run(slewright_here, exchange(3, tmp_path), "mew=1")
    assert "--set mew=1: the system has no input or parameter of that name; valid: kind, mu, u; " in said
    said, _ = run(slewright_here, exchange(3, tmp_path), "mu=1", "exchange.mu=2")
    assert "--set exchange.mu is given twice" in said
