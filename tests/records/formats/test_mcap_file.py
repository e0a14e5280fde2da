"""MCAP: what mcap's own reader reads of our files, and what we read of other people's JSON topics."""

import json
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from records.formats import read_measurement, write_measurement
from records.measurement import Channel, Measurement
from specs.errors import InputError
from tests.records.formats.samples import START, recording

BEGIN_NS = 1_740_826_800_000_000_000  # 2025-03-01T11:00:00Z


def test_mcaps_reader_reads_what_is_written(tmp_path):
    sent = recording()
    write_measurement(sent, tmp_path / "w.mcap")
    with (tmp_path / "w.mcap").open("rb") as file:
        messages = list(make_reader(file, validate_crcs=True).iter_messages())
    for name, channel in sent.channels.items():
        mine = [
            (schema, m.log_time, json.loads(m.data))
            for schema, _, m in messages
            if name in json.loads(m.data)
        ]
        schema = mine[0][0]
        assert schema is not None
        stated = json.loads(schema.data)["properties"][name]
        assert stated["unit"] == channel.unit
        assert [row[name] for _, _, row in mine] == channel.values.tolist()
        zero = round(START.timestamp() * 1e6) * 1000
        assert [stamp - zero for _, stamp, _ in mine] == [round(1e9 * t) for t in channel.time]


def save(path: Path, topics: dict, compression=CompressionType.ZSTD, **options) -> Path:
    """Write {topic: (encoding, schema, metadata, [(ns after the beginning, data)])}."""
    with path.open("wb") as file:
        writer = Writer(file, compression=compression, **options)
        writer.start()
        sent = []
        for topic, (encoding, schema, metadata, messages) in topics.items():
            number = writer.register_schema(topic, "jsonschema", json.dumps(schema).encode()) if schema else 0
            channel = writer.register_channel(topic, encoding, number, metadata)
            sent += [(stamp, channel, data) for stamp, data in messages]
        for stamp, channel, data in sorted(sent, key=lambda s: s[0]):
            writer.add_message(channel, BEGIN_NS + stamp, data, BEGIN_NS + stamp)
        writer.finish()
    return path


def rows(count: int, period_ns: int, make) -> list[tuple[int, bytes]]:
    return [(period_ns * i, json.dumps(make(i)).encode()) for i in range(count)]


SCHEMA = {
    "type": "object",
    "properties": {
        "angle": {"type": "number", "unit": "deg"},
        "load": {"type": "object", "properties": {"mass": {"type": "number", "unit": "t"}}},
    },
}


def test_nested_fields_units_rates_and_topics_in_other_encodings(tmp_path):
    path = save(
        tmp_path / "r.mcap",
        {
            "/drive/slew": (
                "json",
                SCHEMA,
                {},
                rows(100, 20_000_000, lambda i: {"angle": i, "load": {"mass": 2}}),
            ),
            "/p": ("json", None, {"unit": "bar"}, rows(20, 100_000_000, lambda i: {"value": i, "text": "x"})),
            "/camera": ("protobuf", None, {}, [(0, b"\x00\x01")]),
        },
    )
    found = read_measurement(path, names={"drive.slew.angle": "q_slew", "p": "p_slew_a"})
    assert found.start == datetime.fromtimestamp(BEGIN_NS / 1e9, UTC)
    assert set(found.channels) == {"q_slew", "drive.slew.load.mass", "p_slew_a"}
    np.testing.assert_allclose(found["q_slew"].values, np.radians(np.arange(100)))
    np.testing.assert_allclose(found["q_slew"].time, np.arange(100) * 0.02, atol=1e-12)
    np.testing.assert_allclose(found["p_slew_a"].values, 1e5 * np.arange(20))
    np.testing.assert_allclose(found["p_slew_a"].time, np.arange(20) * 0.1, atol=1e-12)
    assert found["drive.slew.load.mass"].unit == "t"
    assert "topic /camera: left out, it is in protobuf" in found.repairs


def test_fields_that_come_and_go_and_nulls_are_absent(tmp_path):
    make = lambda i: {"a": i, **({"b": True} if i % 2 else {}), "c": None if i < 5 else 0.5}  # noqa: E731
    found = read_measurement(save(tmp_path / "r.mcap", {"/t": ("json", None, {}, rows(10, 10**8, make))}))
    assert found["t.a"].values.dtype == np.int64
    assert found["t.b"].values.tolist() == [True] * 5
    np.testing.assert_allclose(found["t.b"].time, [0.1, 0.3, 0.5, 0.7, 0.9])
    assert len(found["t.c"].time) == 5


@pytest.mark.parametrize("options", [{"use_chunking": False}, {"chunk_size": 2000}])
@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.ZSTD, CompressionType.LZ4])
def test_a_file_without_footer_gives_all_whole_messages(tmp_path, options, compression):
    path = save(
        tmp_path / "r.mcap",
        {"/t": ("json", None, {}, rows(1000, 20_000_000, lambda i: {"value": i}))},
        compression,
        **options,
    )
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 3])
    found = read_measurement(path)
    kept = len(found["t"].time)
    assert 50 < kept < 1000
    assert found["t"].values.tolist() == list(range(kept))
    assert found.repairs[0] == "the file was not closed, it has no footer: read as far as it is whole"


def test_a_damaged_chunk_is_dropped_said_and_leaves_a_gap(tmp_path):
    path = save(
        tmp_path / "r.mcap",
        {"/t": ("json", None, {}, rows(1000, 20_000_000, lambda i: {"value": i}))},
        CompressionType.NONE,
        chunk_size=2000,
    )
    data = path.read_bytes()
    path.write_bytes(data.replace(b'{"value": 500}', b'{"value": 599}'))
    found = read_measurement(path)
    assert 599 in found["t"].values
    assert (found["t"].values == 599).sum() == 1
    assert "dropped a damaged chunk" in found.repairs[0]
    assert "kept as a gap" in found.repairs[1]


def test_messages_that_are_no_json_are_refused_with_their_place(tmp_path):
    path = save(tmp_path / "r.mcap", {"/t": ("json", None, {}, [(0, b'{"a": 1}'), (10, b"{a}")])})
    with pytest.raises(InputError, match=r"r\.mcap: message 2 of /t is not JSON"):
        read_measurement(path)


@pytest.mark.parametrize(
    ("topics", "said"),
    [
        ({}, "holds no messages"),
        ({"/a": ("ros1", None, {}, [(0, b"1")])}, "its encodings: ros1"),
        ({"/a": ("json", None, {}, [(0, b'{"text": "x"}')])}, "holds no samples"),
    ],
)
def test_files_without_samples_are_refused(tmp_path, topics, said):
    with pytest.raises(InputError, match=rf"r\.mcap .*{said}"):
        read_measurement(save(tmp_path / "r.mcap", topics))


def test_numbers_that_json_does_not_know_are_absent(tmp_path):
    time = np.arange(5) * 0.1
    sent = Measurement({"x": Channel("x", "m", time, np.array([0, np.nan, 2, np.inf, 4.0]))}, START)
    write_measurement(sent, tmp_path / "w.mcap")
    found = read_measurement(tmp_path / "w.mcap")
    assert found["x"].values.tolist() == [0, 2, 4]


def test_times_before_1970_are_refused(tmp_path):
    sent = Measurement(recording().channels, datetime(1969, 1, 1, tzinfo=UTC))
    with pytest.raises(InputError, match="before 1970"):
        write_measurement(sent, tmp_path / "w.mcap")


@pytest.mark.parametrize(
    ("cells", "kind", "expected"),
    [
        ([True, None, True, False], "b", [True, True, False]),
        ([1, True, 2, None, 2**53 + 1], "i", [1, 1, 2, 2**53 + 1]),
        ([2**63, 5, None, 2**64 - 1, 0], "u", [2**63, 5, 2**64 - 1, 0]),
        ([1, 2, 3, 0.5], "f", [1, 2, 3, 0.5]),
        ([-1, 1, 1, 2**63], "f", [-1, 1, 1, 2.0**63]),
        ([None, None, None, None, 7], "i", [7]),
        ([0.5, 1, 1, 10**400], "f", [0.5, 1, 1]),
    ],
)
@pytest.mark.parametrize("block", [1, 2, 3, 1000])
def test_a_field_has_the_type_that_holds_all_of_it_however_it_is_cut(
    tmp_path, monkeypatch, cells, kind, expected, block
):
    monkeypatch.setattr("records.formats.mcap_topics.BLOCK", block)
    sent = [(10**6 * k, json.dumps({"n": v, "k": k}).encode()) for k, v in enumerate(cells)]
    save(tmp_path / "t.mcap", {"/a": ("json", None, {}, sent)})
    found = read_measurement(tmp_path / "t.mcap")
    assert found["a.n"].values.dtype.kind == kind
    assert found["a.n"].values.tolist() == expected
    assert len(found["a.k"].values) == len(cells)


def test_json_that_is_nested_too_deeply_is_refused(tmp_path):
    save(tmp_path / "t.mcap", {"/a": ("json", None, {}, [(0, b'{"a":' * 100_000 + b"1" + b"}" * 100_000)])})
    with pytest.raises(InputError, match="message 1 of /a is not JSON"):
        read_measurement(tmp_path / "t.mcap")


def test_messages_of_a_topic_that_only_a_damaged_chunk_declares(tmp_path):
    messages = rows(400, 10**6, lambda k: {"v": k})
    save(tmp_path / "t.mcap", {"/a": ("json", None, {}, messages)}, CompressionType.NONE, chunk_size=2000)
    data = bytearray((tmp_path / "t.mcap").read_bytes())
    at = data.find(b'{"v": 3}')
    data[at] ^= 1
    (tmp_path / "t.mcap").write_bytes(data)
    with pytest.raises(InputError, match=r"no messages.*damaged chunk"):
        read_measurement(tmp_path / "t.mcap")


@pytest.mark.parametrize(
    "message", [b'{"x": 1, "x": 2}', b'{"b.c": 1, "b": {"c": 2}}', b'{"a": {"x": 1, "x": 1}}']
)
def test_json_with_a_name_that_stands_twice_is_refused(tmp_path, message):
    save(tmp_path / "t.mcap", {"/a": ("json", None, {}, [(0, message)])})
    with pytest.raises(InputError, match=r"message 1 of /a has '(x|b\.c)' twice"):
        read_measurement(tmp_path / "t.mcap")


@pytest.mark.parametrize("length", [2**33, 2**62])
def test_a_length_that_is_damaged_asks_for_no_memory(tmp_path, length):
    """A chunk that says it holds more than the file does."""
    path = save(tmp_path / "t.mcap", {"/a": ("json", None, {}, [(0, b'{"a": 1}')])}, CompressionType.NONE)
    data = path.read_bytes()
    at = data.index(b"\x06", 8) + 9 + 8 + 8 + 8 + 4 + 4  # behind a chunk's head, times, size, sum and method
    path.write_bytes(data[:at] + length.to_bytes(8, "little") + data[at + 8 :])
    with pytest.raises(InputError, match="holds no messages"):
        read_measurement(path)
