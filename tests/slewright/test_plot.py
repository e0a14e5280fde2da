"""`slewright plot`: one page of one or more records."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
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
