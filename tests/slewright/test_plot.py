"""`slewright plot`: one page of one or more records."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from records.record import Column, Record, RecordWriter
from records.report.signals import MOST_POINTS, chosen, differences, render
from specs.errors import InputError
from tests.conftest import Command

COLUMNS = (
    Column("time", "s", ""),
    Column("angle", "deg", ""),
    Column("speed", "deg/s", ""),
    Column("on", "1", ""),
)


def record(rows: int = 101, offset: float = 0.0) -> Record:
    t = np.linspace(0.0, 10.0, rows)
    return Record.from_rows(COLUMNS, np.stack([t, np.sin(t) + offset, np.cos(t), t > 5], axis=1), {})


def figures(page: str) -> list[dict[str, Any]]:
    found = re.search(r"<script type='application/json' id='figures'>(.*?)</script>", page, re.DOTALL)
    assert found
    return json.loads(found[1])


def test_a_panel_for_each_unit_and_a_line_for_each_record() -> None:
    drawn = figures(render({"a": record(), "b": record(51)}, ["angle", "speed"], True))
    assert [f["layout"]["yaxis"]["title"]["text"] for f in drawn] == [
        "[deg]",
        "[deg/s]",
        "[difference in deg]",
        "[difference in deg/s]",
    ]
    assert [line["name"] for line in drawn[0]["data"]] == ["angle, a", "angle, b"]


def test_no_peak_of_a_long_record_is_lost() -> None:
    t = np.arange(100_001) * 1e-3
    values = np.where(np.arange(len(t)) == 54_321, 7.0, 0.0)
    long = Record.from_rows(COLUMNS, np.stack([t, values, t, t], axis=1), {})
    line = figures(render({"a": long}, ["angle"], False))[0]["data"][0]
    assert len(line["x"]) <= MOST_POINTS + 2
    assert max(line["y"]) == 7.0
    assert line["x"][line["y"].index(7.0)] == 54.321


def test_differences_are_those_at_the_first_records_times() -> None:
    (found,) = differences({"a": record(), "b": record(101, 0.25)}, ["angle"])
    assert found["max"] == pytest.approx(0.25)
    assert found["rms"] == pytest.approx(0.25)
    (other,) = differences({"a": record(), "b": record(100_001)}, ["angle"])
    assert other["max"] < 1e-6
    assert other["rows"] == 101


def test_columns_are_chosen_by_name_or_pattern() -> None:
    assert chosen({"a": record()}, []) == ["angle", "speed", "on"]
    assert chosen({"a": record()}, ["s*", "angle"]) == ["speed", "angle"]
    with pytest.raises(InputError, match="no record has a column 'angel'; did you mean"):
        chosen({"a": record()}, ["angel"])


def test_a_peak_beside_missing_values_is_kept_and_so_is_the_gap() -> None:
    values = np.where(np.arange(100_001) == 54_321, -1.0, -5.0)
    values[50_000:60_000:2] = np.nan
    t = np.arange(len(values)) * 1e-3
    long = Record.from_rows(COLUMNS, np.stack([t, values, t, t], axis=1), {})
    line = figures(render({"a": long}, ["angle"], False))[0]["data"][0]
    assert -1.0 in line["y"]
    assert None in line["y"]


def test_a_single_row_is_seen() -> None:
    drawn = figures(render({"a": record(1)}, ["angle"], False))
    assert drawn[0]["data"][0]["mode"] == "lines+markers"
    assert figures(render({"a": record(2)}, ["angle"], False))[0]["data"][0]["mode"] == "lines"


def of_one(unit: str, values: list[float], start: float = 0.0) -> Record:
    time = np.arange(len(values)) + start
    return Record.from_rows([Column("time", "s", ""), Column("y", unit, "")], np.stack([time, values], 1), {})


def test_other_units_are_converted_or_refused() -> None:
    records = {"a": of_one("deg", [180.0, 90.0]), "b": of_one("rad", [np.pi, np.pi / 2])}
    assert differences(records, ["y"])[0]["max"] < 1e-12
    drawn = figures(render(records, ["y"], False))
    assert drawn[0]["data"][1]["y"] == pytest.approx([180.0, 90.0])
    with pytest.raises(InputError, match="column y is in m in one record and in deg in another"):
        differences({"a": of_one("deg", [1.0, 2.0]), "b": of_one("m", [1.0, 2.0])}, ["y"])


def test_what_cannot_be_compared_is_no_difference_of_zero() -> None:
    (found,) = differences({"a": of_one("m", [1.0, 2.0]), "b": of_one("m", [1.0, 2.0], 10.0)}, ["y"])
    assert found["rows"] == 0
    assert np.isnan(found["max"])


def test_columns_that_are_no_numbers_are_left_out() -> None:
    table = record().table.append_column("name", pa.array(["a"] * 101))
    assert chosen({"a": Record(table, {})}, []) == ["angle", "speed", "on"]
    with pytest.raises(InputError, match="a: there is no column of numbers beside the time"):
        chosen({"a": Record(table.select(["time", "name"]), {})}, [])
    with pytest.raises(InputError, match="a: there is no column time of numbers"):
        chosen({"a": Record(pa.table({"time": ["a"], "y": [1.0]}), {})}, [])


def test_the_command(slewright: Command, tmp_path: Path) -> None:
    for name, offset in (("a", 0.0), ("b", 0.5)):
        with RecordWriter(tmp_path / f"{name}.parquet", COLUMNS, {}) as writer:
            table = record(101, offset)
            writer.append(np.stack([table.column(c.name).astype(float) for c in COLUMNS], axis=1))
    first, second = tmp_path / "a.parquet", tmp_path / "b.parquet"
    done = slewright(
        "plot", str(first), "angle", "--with", str(second), "--difference", "--json", str(tmp_path / "f.json")
    )
    assert done.returncode == 0, done.stderr
    assert "<h1>a, b</h1>" in (tmp_path / "a.html").read_text()
    assert json.loads((tmp_path / "f.json").read_text())["differences"][0]["max"] == pytest.approx(0.5)
    refused = slewright("plot", str(first), "--difference")
    assert refused.returncode == 2
    assert "--difference needs a second record" in refused.stderr
    for name, unit in (("far", COLUMNS[1]), ("other", Column("y", "deg", ""))):
        with RecordWriter(tmp_path / f"{name}.parquet", [COLUMNS[0], unit], {}) as writer:
            writer.append(np.array([[50.0, 1.0], [51.0, 2.0]]))
        refused = slewright("plot", str(first), "--difference", "--with", str(tmp_path / f"{name}.parquet"))
        assert refused.returncode == 2
        assert "in common" in refused.stderr
    refused = slewright("plot", str(tmp_path / "f.json"))
    assert refused.returncode == 2
    assert "slewright convert makes one" in refused.stderr
