"""What is recorded stays: through closing, a killed process, a full disk, an interrupt."""

import hashlib
import pickle
import resource
import signal as signals
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from records.record import BATCH_ROWS, Column, Record, RecordWriter, read, recording_path, stored
from specs.errors import InputError, RunError

COLUMNS = [Column("time", "s", "Time"), Column("slew", "rad", "Slew angle"), Column("p", "Pa", "Pressure")]
META = {"system": "reference", "seed": 3, "step_s": 0.02}


def rows(n: int) -> np.ndarray:
    time = np.arange(n) * 0.02
    return np.column_stack([time, np.sin(time), 1e7 * np.cos(time)])


def write(path: Path, n: int = 1000, pieces: int = 1, **meta: object) -> Path:
    with RecordWriter(path, COLUMNS, {**META, **meta}) as writer:
        for piece in np.array_split(rows(n), pieces):
            writer.append(piece)
    return path


def test_what_was_written_is_read(tmp_path):
    record = read(write(tmp_path / "run.parquet"))
    assert np.array_equal(np.column_stack([record.column(c.name) for c in COLUMNS]), rows(1000))
    assert record.names == ["time", "slew", "p"]
    assert record.units == {"time": "s", "slew": "rad", "p": "Pa"}
    assert record.meta == {
        **META,
        "complete": True,
        "reason": "",
        "format": 1,
        "run_hash": record.computed_hash(),
    }
    assert (len(record), record.complete, record.reason) == (1000, True, "")
    assert not recording_path(tmp_path / "run.parquet").exists()
    assert "slew" in record
    assert "boom" not in record


def test_any_parquet_reader_sees_units_and_values(tmp_path):
    table = pq.read_table(write(tmp_path / "run.parquet"))
    assert table.schema.field("slew").metadata == {b"unit": b"rad", b"description": b"Slew angle"}
    assert table.column("p")[0].as_py() == 1e7


def test_bytes_depend_on_rows_and_metadata_only(tmp_path):
    one = write(tmp_path / "one.parquet", pieces=1).read_bytes()
    assert write(tmp_path / "two.parquet", pieces=137).read_bytes() == one
    assert write(tmp_path / "three.parquet", seed=4).read_bytes() != one
    # keys in another order are the same metadata
    with RecordWriter(tmp_path / "four.parquet", COLUMNS, dict(reversed(META.items()))) as writer:
        writer.append(rows(1000))
    assert (tmp_path / "four.parquet").read_bytes() == one


def test_many_row_groups_join_in_order(tmp_path):
    record = read(write(tmp_path / "long.parquet", n=70_001, pieces=9))
    assert np.array_equal(record.time, np.arange(70_001) * 0.02)
    assert pq.ParquetFile(tmp_path / "long.parquet").num_row_groups == 3


def test_names_take_unit_and_description_from_the_signals(tmp_path):
    with RecordWriter(tmp_path / "run.parquet", ["time", "true_q_slew", "p_slew_a"], {}) as writer:
        writer.append(np.zeros((1, 3)))
    assert read(tmp_path / "run.parquet").units == {"time": "s", "true_q_slew": "rad", "p_slew_a": "Pa"}


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (["true_q_slew", "time"], "first column is 'time', not 'true_q_slew'"),
        (["time", "true_q_slw"], "true_q_slw.*true_q_slew"),
        (["time", "p_slew_a", "p_slew_a"], "given twice: p_slew_a"),
        ([], "not 'nothing'"),
    ],
)
def test_wrong_columns_are_refused_before_anything_is_written(tmp_path, columns, message):
    with pytest.raises(InputError, match=message):
        RecordWriter(tmp_path / "run.parquet", columns, {})
    assert list(tmp_path.iterdir()) == []


def test_a_column_that_is_not_there_names_the_nearest(tmp_path):
    record = Record.from_rows(COLUMNS, rows(3), META)
    with pytest.raises(InputError, match=r"no column 'slow'; did you mean slew"):
        record.column("slow")


def test_rows_that_do_not_fit_are_refused(tmp_path):
    with (
        RecordWriter(tmp_path / "run.parquet", COLUMNS, META) as writer,
        pytest.raises(ValueError, match=r"\(5, 2\) do not fit 3 columns"),
    ):
        writer.append(np.zeros((5, 2)))


def test_an_incomplete_run_says_why(tmp_path):
    writer = RecordWriter(tmp_path / "run.parquet", COLUMNS, META)
    writer.append(rows(10))
    writer.close(complete=False, reason="machine: doStep failed at 0.2 s")
    record = read(tmp_path / "run.parquet")
    assert (len(record), record.complete, record.reason) == (10, False, "machine: doStep failed at 0.2 s")


@pytest.mark.parametrize(("error", "reason"), [(KeyboardInterrupt(), "interrupted"), (RunError("no"), "no")])
def test_a_run_that_breaks_off_keeps_its_rows(tmp_path, error, reason):
    def run():
        with RecordWriter(tmp_path / "run.parquet", COLUMNS, META) as writer:
            writer.append(rows(333))
            raise error

    with pytest.raises(type(error)):
        run()
    record = read(tmp_path / "run.parquet")
    assert (len(record), record.complete, record.reason) == (333, False, reason)


def test_a_killed_process_loses_less_than_a_batch(tmp_path):
    path = tmp_path / "run.parquet"
    script = f"""
        import os, signal
        from tests.records.test_record import COLUMNS, META, RecordWriter, rows
        writer = RecordWriter({str(path)!r}, COLUMNS, META)
        writer.append(rows({2 * BATCH_ROWS}))
        writer.append(rows(17))
        os.kill(os.getpid(), signal.SIGKILL)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(script)], check=False)
    assert done.returncode == -signals.SIGKILL
    assert not path.exists()
    record = read(path)
    assert np.array_equal(record.column("slew"), rows(2 * BATCH_ROWS)[:, 1])
    assert not record.complete
    assert "not closed" in record.reason
    assert record.meta["seed"] == 3


@pytest.mark.parametrize("cut", [1, 100, 2000, 5000])
def test_a_recording_cut_off_anywhere_gives_its_whole_batches(tmp_path, cut):
    writer = RecordWriter(tmp_path / "run.parquet", COLUMNS, META)
    for batch in np.split(rows(4 * BATCH_ROWS), 4):
        writer.append(batch)
    recording = recording_path(tmp_path / "run.parquet")
    whole = recording.read_bytes()
    recording.write_bytes(whole[:-cut])
    record = read(recording)
    assert len(record) == 3 * BATCH_ROWS
    assert np.array_equal(record.time, rows(3 * BATCH_ROWS)[:, 0])


@pytest.fixture
def small_disk():
    """Let files grow to 40 kB only: the kernel then refuses to write, as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signals.signal(signals.SIGXFSZ, signals.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    signals.signal(signals.SIGXFSZ, handler)


def test_a_full_disk_is_said_and_keeps_what_was_recorded(tmp_path, small_disk):
    path = tmp_path / "run.parquet"
    writer = RecordWriter(path, COLUMNS, META)
    with pytest.raises(RunError, match=r"the disk is full.*stays readable"):
        writer.append(rows(10_000))
    with pytest.raises(RunError, match="the disk is full"):
        writer.append(rows(1))
    writer.close(complete=False, reason="disk full")  # said already: does not raise again
    record = read(path)
    assert len(record) > 0
    assert len(record) % BATCH_ROWS == 0
    assert np.array_equal(record.column("p"), rows(len(record))[:, 2])
    assert not record.complete


def test_a_disk_that_fills_up_on_closing_leaves_the_recording(tmp_path, small_disk, monkeypatch):
    writer = RecordWriter(tmp_path / "run.parquet", COLUMNS, META)
    writer.append(rows(500))
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
    with pytest.raises(RunError, match=r"cannot finish .*the disk is full"):
        writer.close()
    assert [p.name for p in tmp_path.iterdir()] == ["run.parquet.recording"]
    assert len(read(tmp_path / "run.parquet")) == 500


def test_a_real_full_file_system(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(disk)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("mounting a small tmpfs needs more rights than this test has")
    try:
        writer = RecordWriter(disk / "run.parquet", COLUMNS, META)
        with pytest.raises(RunError, match="the disk is full"):
            writer.append(rows(10_000))
        writer.close(complete=False, reason="disk full")
        assert len(read(disk / "run.parquet")) >= BATCH_ROWS
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_where_nothing_can_be_written_the_run_does_not_start(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(RunError, match=r"cannot record to .*file/run\.parquet"):
        RecordWriter(tmp_path / "file" / "run.parquet", COLUMNS, META)


def test_an_older_record_is_not_taken_for_the_new_run(tmp_path):
    path = write(tmp_path / "run.parquet")
    writer = RecordWriter(path, COLUMNS, META)
    writer.append(rows(BATCH_ROWS))
    assert len(read(path)) == BATCH_ROWS
    writer.close()


def damaged(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 3 : len(data) // 3 + 200] = bytes(200)
    path.write_bytes(data)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda p: p.unlink(), "no run record at"),
        (lambda p: p.write_bytes(b""), "damaged or not a run record"),
        (lambda p: p.write_bytes(b"time,slew\n0,1\n"), "damaged or not a run record"),
        (lambda p: p.write_bytes(p.read_bytes()[:-500]), "damaged or not a run record"),
        (damaged, "damaged or not a run record"),
        (lambda p: pq.write_table(pq.read_table(p).replace_schema_metadata({}), p), "carries no 'slewright'"),
        (lambda p: _raise_format(p), "format 99; this version reads up to 1"),
    ],
)
def test_a_bad_file_is_named(tmp_path, spoil, message):
    path = write(tmp_path / "run.parquet")
    spoil(path)
    with pytest.raises(InputError, match=message) as caught:
        read(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def _raise_format(path: Path) -> None:
    table = pq.read_table(path)
    meta = table.schema.metadata[b"slewright"].replace(b'"format":1', b'"format":99')
    pq.write_table(table.replace_schema_metadata({b"slewright": meta}), path)


@pytest.mark.parametrize("content", [b"", b"nonsense" * 100])
def test_a_recording_without_a_head_is_named(tmp_path, content):
    path = tmp_path / "run.parquet.recording"
    path.write_bytes(content)
    with pytest.raises(InputError, match="damaged or not a run record"):
        read(tmp_path / "run.parquet")


# ---- types, and the run hash ----

TYPED = [
    Column("time", "s", ""),
    Column("motor.mode", "1", "Mode", "int64"),
    Column("big", "1", "", "uint64"),
    Column("tool.on", "1", "", "bool"),
    Column("x", "m", ""),
]


def typed_rows(n: int) -> np.ndarray:
    cells = np.zeros((n, 5))
    cells[:, 0] = np.arange(n) * 0.02
    bits = cells.view(np.int64)
    bits[:, 1] = np.arange(n) - 2**62
    cells.view(np.uint64)[:, 2] = 2**64 - 1 - np.arange(n, dtype=np.uint64)
    bits[:, 3] = np.arange(n) % 3 == 0
    cells[:, 4] = np.where(np.arange(n) % 2, np.nan, -0.0)
    return cells


def write_typed(path: Path, n: int = 700) -> Record:
    with RecordWriter(path, TYPED, META) as writer:
        writer.append(typed_rows(n))
    return read(path)


def test_whole_numbers_and_booleans_keep_every_bit(tmp_path):
    record, n = write_typed(tmp_path / "run.parquet"), np.arange(700)
    for found in (record, Record.from_rows(TYPED, typed_rows(700), META)):
        assert np.array_equal(found.column("motor.mode"), n - 2**62)
        assert np.array_equal(found.column("big"), 2**64 - 1 - n.astype(np.uint64))
        assert np.array_equal(found.column("tool.on"), n % 3 == 0)
        kinds = [found.column(c.name).dtype for c in TYPED]
        assert kinds == [np.float64, np.int64, np.uint64, np.bool_, np.float64]
    assert record.table.schema.field("motor.mode").metadata[b"description"] == b"Mode"


def test_a_recording_keeps_the_types(tmp_path):
    writer = RecordWriter(tmp_path / "run.parquet", TYPED, META)
    writer.append(typed_rows(BATCH_ROWS))
    assert np.array_equal(read(tmp_path / "run.parquet").column("motor.mode"), np.arange(BATCH_ROWS) - 2**62)
    writer.close()


def test_a_type_that_has_no_cell_is_refused(tmp_path):
    with pytest.raises(
        InputError, match=r"column text of type String cannot be recorded; valid: float64, int64"
    ):
        RecordWriter(tmp_path / "run.parquet", [*COLUMNS, Column("text", "", "", "String")], META)


def test_the_run_hash_is_that_of_its_definition(tmp_path):
    """Computed here a second time, from what records/hashing.py says."""
    record = write_typed(tmp_path / "run.parquet")
    head = (
        '{"columns":[["time","float64","s"],["motor.mode","int64","1"],["big","uint64","1"],'
        '["tool.on","bool","1"],["x","float64","m"]],"meta":{"complete":true,"reason":"","seed":3,'
        '"step_s":0.02,"system":"reference"},"rows":700}'
    )
    values = [typed_rows(700)[:, i].tobytes() for i in range(5)]
    whole = hashlib.sha256(head.encode() + b"".join(hashlib.sha256(v).digest() for v in values))
    assert record.run_hash == whole.hexdigest() == record.computed_hash()


def test_the_run_hash_depends_on_what_was_run_only(tmp_path):
    one = read(write(tmp_path / "one.parquet")).run_hash
    assert len(one) == 64
    assert read(write(tmp_path / "two.parquet", pieces=99)).run_hash == one
    assert Record.from_rows(COLUMNS, rows(1000), META).run_hash == one
    assert read(write(tmp_path / "clock.parquet", measured={"seconds": 1.2})).run_hash == one
    table = read(write(tmp_path / "plain.parquet")).table
    pq.write_table(table, tmp_path / "plain.parquet", compression="none", row_group_size=77)
    assert read(tmp_path / "plain.parquet").computed_hash() == one


def test_the_run_hash_is_another_for_anything_else(tmp_path):
    one = Record.from_rows(COLUMNS, rows(1000), META).run_hash
    changed = rows(1000)
    changed[-1, -1] = np.nextafter(changed[-1, -1], 0.0)
    others = [
        Record.from_rows(COLUMNS, changed, META),
        Record.from_rows(COLUMNS, rows(999), META),
        Record.from_rows(COLUMNS, rows(1000), {**META, "seed": 4}),
        Record.from_rows(COLUMNS, rows(1000), {**META, "complete": False}),
        Record.from_rows([*COLUMNS[:2], Column("q", "Pa", "")], rows(1000), META),
        Record.from_rows([*COLUMNS[:2], Column("p", "bar", "")], rows(1000), META),
        Record.from_rows([*COLUMNS[:2], Column("p", "Pa", "", "int64")], rows(1000), META),
    ]
    hashes = [record.run_hash for record in others]
    assert len({one, *hashes}) == 1 + len(others)


def test_a_changed_record_is_told_by_its_hash(tmp_path):
    path = write(tmp_path / "run.parquet")
    table = read(path).table
    higher = table.set_column(1, table.schema.field(1), pa.array(table.column(1).to_numpy() + 1e-9))
    pq.write_table(higher, path)
    assert read(path).computed_hash() != read(path).run_hash


def test_wide_records_have_smaller_row_groups(tmp_path):
    columns = [COLUMNS[0], *(Column(f"c{i}", "1", "") for i in range(600))]
    with RecordWriter(tmp_path / "run.parquet", columns, {}) as writer:
        writer.append(np.arange(8000.0 * 601).reshape(8000, 601))
    file = pq.ParquetFile(tmp_path / "run.parquet")
    groups = [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)]
    assert groups == [6750, 1250]
    assert np.array_equal(read(tmp_path / "run.parquet").column("c599"), np.arange(8000) * 601.0 + 600)


def test_a_disk_that_fills_up_in_a_long_run_leaves_the_recording_whole(tmp_path, small_disk):
    """The Parquet file grows beside it: when that cannot go on, it makes room."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (1_600_000, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
    writer = RecordWriter(tmp_path / "run.parquet", COLUMNS, META)

    def run():
        for block in np.array_split(rows(100_000), 200):
            writer.append(block)

    with pytest.raises(RunError, match="the disk is full"):
        run()
    writer.close(complete=False, reason="disk full")
    assert [p.name for p in tmp_path.iterdir()] == ["run.parquet.recording"]
    record = read(tmp_path / "run.parquet")
    assert len(record) > 32_000
    assert np.array_equal(record.time, np.arange(len(record)) * 0.02)


def test_an_interrupt_while_a_group_is_written_loses_and_doubles_nothing(tmp_path, monkeypatch):
    writer = RecordWriter(tmp_path / "run.parquet", COLUMNS, META)
    with monkeypatch.context() as patch:
        patch.setattr("pyarrow.parquet.ParquetWriter.write_table", _interrupted)
        with pytest.raises(KeyboardInterrupt):
            writer.append(rows(33_000))
    writer.close(complete=False, reason="interrupted")
    assert np.array_equal(read(tmp_path / "run.parquet").time, rows(32_000)[:, 0])


def _interrupted(*_args: object, **_more: object) -> None:
    raise KeyboardInterrupt


def test_recording_and_reading_need_no_pandas(tmp_path):
    """Which pyarrow imports when it converts for numpy: a second of every process of a campaign."""
    script = f"""
        import sys
        from pathlib import Path
        from tests.records.test_record import TYPED, META, Record, read, typed_rows, write_typed
        record = write_typed(Path({str(tmp_path)!r}) / "run.parquet")
        again = Record.from_rows(TYPED, typed_rows(700), META)
        assert all((again.column(c.name) == record.column(c.name)).any() for c in TYPED)
        assert again.run_hash == record.computed_hash()
        assert "pandas" not in sys.modules
    """
    subprocess.run([sys.executable, "-c", textwrap.dedent(script)], check=True)


def test_a_record_just_written_is_read_when_it_is_needed(tmp_path):
    path = write(tmp_path / "run.parquet")
    whole, late = read(path), stored(path)
    assert late.meta == whole.meta
    moved = path.rename(tmp_path / "elsewhere.parquet")
    with pytest.raises(InputError, match=r"run\.parquet is damaged"):
        late.column("slew")
    moved.rename(path)
    assert np.array_equal(late.column("slew"), whole.column("slew"))
    assert (len(late), late.names, late.units) == (len(whole), whole.names, whole.units)
    path.unlink()
    assert late.computed_hash() == late.run_hash == pickle.loads(pickle.dumps(late)).run_hash
