"""Run records and other tools' Parquet as recordings."""

from datetime import UTC, datetime
from decimal import Decimal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from records import record
from records.formats import read_measurement, write_measurement
from records.recording import RecordWriter, recording_path
from specs.errors import InputError
from tests.records.formats.samples import one_rate
from tests.records.synthetic import plausible


def test_a_run_record_is_a_recording_with_its_units(tmp_path):
    made = plausible("reference")
    path = tmp_path / "run.parquet"
    with RecordWriter(path, [*made.names], made.meta) as writer:
        writer.append(np.column_stack([made.column(n) for n in made.names]))
    found = read_measurement(path)
    assert found.repairs == ()
    assert list(found.channels) == made.names[1:]
    for name in found.channels:
        assert found[name].unit == made.units[name]
        np.testing.assert_array_equal(found[name].values, made.column(name))


def test_what_is_written_is_a_run_record(tmp_path):
    path = tmp_path / "w.parquet"
    sent = one_rate()
    write_measurement(sent, path)
    found = record.read(path)
    assert found.units == {"time": "s", **{n: c.unit for n, c in sent.channels.items()}}
    assert found.column("brake_released").dtype == bool
    assert found.computed_hash() == found.run_hash
    assert found.meta["start"] == "2025-03-01T12:30:00.123456+02:00"
    assert found.meta["converted_from"] == "machine.mf4"


def test_a_recording_that_was_never_closed(tmp_path):
    path = tmp_path / "run.parquet"
    writer = RecordWriter(path, ["time", "q_slew"], {})
    writer.append(np.column_stack([np.arange(400) * 0.02, np.arange(400.0)]))
    writer.flush()
    for name in (path, recording_path(path)):
        found = read_measurement(name)
        assert found.repairs == (
            "incomplete: the recording was not closed: the process ended or the disk was full",
        )
        assert len(found["q_slew"].time) == 400
    writer.close()


def foreign(tmp_path, columns: dict, units: dict[str, str] | None = None):
    table = pa.table(columns)
    fields = [
        f.with_metadata({"unit": units[f.name]}) if units and f.name in units else f for f in table.schema
    ]
    path = tmp_path / "theirs.parquet"
    pq.write_table(table.cast(pa.schema(fields)), path)
    return path


def test_other_tools_tables_with_units_nulls_and_whole_numbers(tmp_path):
    path = foreign(
        tmp_path,
        {
            "time_ms": pa.array([0, 20, 40, 60], pa.int32()),
            "q_slew": pa.array([0.0, 90.0, None, 180.0], pa.float32()),
            "p_slew_a [bar]": pa.array([1.0, 2.0, 3.0, 4.0]),
            "count": pa.array([1, 2, 3, 4], pa.int16()),
            "flag": pa.array([True, None, False, True]),
            "text": pa.array(["a", "b", "c", "d"]),
        },
        {"q_slew": "deg"},
    )
    found = read_measurement(path)
    np.testing.assert_allclose(found["q_slew"].time, [0, 0.02, 0.06])
    np.testing.assert_allclose(found["q_slew"].values, np.radians([0, 90, 180]))
    np.testing.assert_allclose(found["p_slew_a"].values, [1e5, 2e5, 3e5, 4e5])
    assert found["count"].values.dtype == np.int64
    assert found["flag"].values.tolist() == [1, 0, 1]
    assert "text: left out, a column of string holds no numbers" in found.repairs


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_time_stamps_of_every_resolution_give_time_and_start(tmp_path, unit):
    stamps = [datetime(2025, 3, 1, 12, 0, second, tzinfo=UTC) for second in (1, 2, 4)]
    path = foreign(
        tmp_path, {"timestamp": pa.array(stamps, pa.timestamp(unit, "Europe/Zurich")), "p": [1.0, 2, 3]}
    )
    found = read_measurement(path)
    assert found.start == stamps[0]
    assert found["p"].time.tolist() == [0, 1, 3]


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"a": [1.0], "b": [2.0]}, "no time column"),
        ({"time": ["x"], "p": [2.0]}, "'x' is neither a number nor a date"),
        ({"time": pa.array([], pa.float64()), "p": pa.array([], pa.float64())}, "no rows"),
        ({"time": [0.0, 1.0], "p": ["a", "b"]}, "holds no samples"),
        ({"time": [0.0, 1.0, 1.0, 2.0], "p": [0.0, 1.0, 2.0, 3.0]}, "two values at one time: row 3 at 1 s"),
        ({"time": [0.0, 1.0, 0.5, 0.6], "p": [0.0, 1.0, 2.0, 3.0]}, "jumps back by 0.5 s at row 3 at 0.5 s"),
    ],
)
def test_tables_that_cannot_be_read_are_refused(tmp_path, columns, said):
    with pytest.raises(InputError, match=rf"theirs\.parquet.*{said}"):
        read_measurement(foreign(tmp_path, columns))


@pytest.mark.parametrize("kind", [pa.int64(), pa.uint64(), pa.decimal128(19, 0), pa.decimal128(20, 0)])
def test_large_whole_numbers_stay_exact_where_others_are_absent(tmp_path, kind):
    top = 2**64 - 1 if kind in (pa.uint64(), pa.decimal128(20, 0)) else 2**63 - 1
    cells = [2**53 + 1, None, top, 3]
    held = pa.array(cells, kind) if not pa.types.is_decimal(kind) else pa.array(
        [None if c is None else Decimal(c) for c in cells], kind
    )  # fmt: skip
    pq.write_table(pa.table({"time": [0.0, 1.0, 2.0, 3.0], "n": held}), tmp_path / "t.parquet")
    found = read_measurement(tmp_path / "t.parquet")["n"]
    assert [int(v) for v in found.values] == [2**53 + 1, top, 3]
    assert found.time.tolist() == [0, 2, 3]


def test_an_index_that_counts_the_rows_is_no_time(tmp_path):
    pq.write_table(pa.table({"p": [1.0, 2.0], "__index_level_0__": [0, 1]}), tmp_path / "t.parquet")
    with pytest.raises(InputError, match="no time column"):
        read_measurement(tmp_path / "t.parquet")
