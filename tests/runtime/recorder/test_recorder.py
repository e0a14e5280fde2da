"""Recordings: whole, cut anywhere, on a full or slow disk, read by others, repeated bit for bit."""

from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from deployment.faults.disks import FullDisk
from records.formats import read_measurement
from runtime.image import INPUT, Flag
from runtime.recorder.feed import DISK_FULL, TIMING
from runtime.recorder.mend import mend
from runtime.recorder.message import places, schema
from runtime.recorder.reader import Recording, Tick
from runtime.recorder.recorder import Recorder
from runtime.recorder.replay import check_identity, identity, replay
from runtime.recorder.segments import Disk, Folder
from runtime.ring import Ring
from specs.errors import InputError
from tests.runtime.stand_in import Lockstep, StandIn

ME = identity(core="c0de", specs="1")
LIMIT = 64 << 20


@pytest.fixture
def ring(tmp_path: Path) -> Iterator[Ring]:
    ring = Ring.create(tmp_path / "ring", 1 << 20)
    yield ring
    ring.close()


def recorder(
    ring: Ring, folder: Path, segment_ticks: int = 200, disk: Disk | None = None, limit: int = LIMIT
):
    return Recorder(ring, Folder(folder, limit), ME, segment_ticks, disk or Disk())


def recorded(ring: Ring, folder: Path, ticks: int, **options) -> Path:
    """A closed recording of the stand-in."""
    run, writer = Lockstep(ring), recorder(ring, folder, **options)
    for _ in range(0, ticks, 100):
        run.run(100)
        writer.work()
    writer.close()
    return folder


def test_an_entry_comes_back_from_its_message():
    entry = np.random.default_rng(1).integers(0, 256, places().entry_bytes, np.uint8)
    pad = TIMING.size + (INPUT.dtype.fields or {})["pad"][1]
    entry[pad : pad + INPUT.dtype["pad"].itemsize] = 0  # the image's padding is not recorded
    entry[-8:] = 0
    message = places().message(entry.tobytes())
    assert places().entry(message) == entry.tobytes()
    assert places().entry(message[:-1]) is None
    assert places().entry(b"\x11" + message[1:]) is None


def test_an_independent_reader_sees_every_signal(ring: Ring, tmp_path: Path):
    """Google's Protocol Buffers and the MCAP library's own reader, with the file's own schema."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    path = Recording(recorded(ring, tmp_path / "out", 200)).files()[0]
    with path.open("rb") as file:
        found = [(s, c, m) for s, c, m in make_reader(file).iter_messages(topics=["/tick"])]
    kind, topic, message = found[70]
    assert kind is not None
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(kind.data).file:
        pool.Add(file)
    tick: Any = message_factory.GetMessageClass(pool.FindMessageTypeByName(kind.name)).FromString(
        message.data
    )
    wanted = Lockstep(ring)
    wanted.run(71)
    assert (tick.tick, tick.output_tick, tick.count) == (70, 70, 71)
    assert tick.q_slew == wanted.inputs["value"][INPUT.at("q_slew")]
    assert tick.u_slew == wanted.core.sum
    assert (tick.q_boom_age, tick.q_boom_status, tick.q_slew_status) == (-1, 1, 0)
    assert topic.metadata["unit:q_slew"] == "rad"
    assert len(kind.data) == len(schema())


def test_our_converter_reads_it_with_names_and_units(ring: Ring, tmp_path: Path):
    path = Recording(recorded(ring, tmp_path / "out", 200)).files()[0]
    found = read_measurement(path)
    wanted = Lockstep(ring)
    wanted.run(200)
    assert found.channels["q_slew"].unit == "rad"
    assert found.channels["q_slew"].values[-1] == wanted.inputs["value"][INPUT.at("q_slew")]
    assert len(found.channels["u_slew"].values) == 200
    assert np.allclose(np.diff(found.channels["u_slew"].time), 0.02)
    assert "state" not in found.channels


def test_a_replay_repeats_every_segment_bit_for_bit(ring: Ring, tmp_path: Path):
    recording = Recording(recorded(ring, tmp_path / "out", 1000))
    assert len(recording.files()) == 5
    assert replay(recording, StandIn()).ticks == 1000
    for path in recording.files():
        result = replay(Recording(path), StandIn())
        assert (result.ticks, result.first, result.gaps, result.left_out) == (200, None, 0, 0)


def test_a_replay_names_the_first_tick_and_signal_that_differ(ring: Ring, tmp_path: Path):
    class Other(StandIn):
        def step(self, inputs, tick):
            if tick == 437:
                self.gain = 0.2500001
            return super().step(inputs, tick)

    result = replay(Recording(recorded(ring, tmp_path / "out", 600)), Other())
    assert result.first is not None
    assert (result.first.tick, result.first.name) == (437, "u_slew")


def test_a_replay_sees_a_state_that_differs_before_an_output_does(ring: Ring, tmp_path: Path):
    class Other(StandIn):
        def step(self, inputs, tick):
            self.steps += tick == 60
            return super().step(inputs, tick)

    result = replay(Recording(recorded(ring, tmp_path / "out", 600)), Other())
    assert result.first is not None
    assert str(result.first) == "tick 100: the state before it differs"


def test_a_recording_of_another_version_is_refused(ring: Ring, tmp_path: Path):
    found = Recording(recorded(ring, tmp_path / "out", 100)).metadata()
    check_identity(found, ME)
    with pytest.raises(InputError, match="another control core: c0de, not beef"):
        check_identity(found, identity(core="beef", specs="1"))
    with pytest.raises(InputError, match="another set of signals: 0000"):
        check_identity({**found, "layout": "0000"}, ME)


def test_a_file_cut_anywhere_opens_and_loses_less_than_a_second(ring: Ring, tmp_path: Path):
    """The bytes that had reached the disk when each tick ended, cut at many places in between."""
    run, writer = Lockstep(ring), recorder(ring, tmp_path / "out", segment_ticks=10_000)
    sizes = []  # (bytes on the disk, ticks run)
    for ticks in range(5, 405, 5):
        run.run(5)
        writer.work()
        sizes.append((writer.folder.segments()[0].stat().st_size, ticks))
    whole = writer.folder.segments()[0].read_bytes()
    cut = tmp_path / "cut.mcap"
    for size, ticks in sizes:
        cut.write_bytes(whole[:size])
        kept = sum(isinstance(item, Tick) for item in Recording(cut).items())
        assert ticks - kept < 50
    for size in [*range(9, 1200, 97), *range(1200, len(whole), 977), len(whole) - 1]:
        cut.write_bytes(whole[:size])
        on_disk = max((ticks for there, ticks in sizes if there <= size), default=0)
        assert sum(isinstance(item, Tick) for item in Recording(cut).items()) >= on_disk - 49


def test_a_damaged_chunk_is_left_out_and_the_replay_goes_on_at_the_next_snapshot(ring: Ring, tmp_path: Path):
    recording = Recording(recorded(ring, tmp_path / "out", 500, segment_ticks=10_000))
    path = recording.files()[0]
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    result = replay(recording, StandIn())
    assert result.first is None
    assert result.gaps == 1
    assert 400 <= result.ticks < 500
    assert "damaged" in result.notes[0]


def test_an_unclosed_segment_is_closed_by_the_next_recorder(ring: Ring, tmp_path: Path):
    run, writer = Lockstep(ring), recorder(ring, tmp_path / "out", segment_ticks=10_000)
    run.run(300)
    writer.work()
    (path,) = writer.folder.segments()
    cut = path.read_bytes()[:-7]
    path.write_bytes(cut)  # killed: no footer, and the last chunk is not whole
    with pytest.raises(Exception, match=r"."):
        make_reader(BytesIO(cut)).get_summary()
    recorder(ring, tmp_path / "out")
    summary = make_reader(BytesIO(path.read_bytes())).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count > 250
    assert not mend(path)
    assert replay(Recording(path), StandIn()).ticks >= 251


def test_the_disk_used_is_bounded(ring: Ring, tmp_path: Path):
    run = Lockstep(ring)
    writer = recorder(ring, tmp_path / "out", segment_ticks=50, limit=(1 << 20) + 150_000)
    largest = 0
    for _ in range(40):
        run.run(50)
        writer.work()
        largest = max(largest, sum(p.stat().st_size for p in writer.folder.segments()))
    writer.close()
    paths = writer.folder.segments()
    assert largest < (1 << 20) + 150_000
    assert paths[0].name != "segment-00000000.mcap"
    assert replay(Recording(tmp_path / "out"), StandIn()).first is None


def test_a_full_disk_shows_in_the_flags_and_touches_nothing_else(ring: Ring, tmp_path: Path):
    disk = FullDisk()
    run, writer = Lockstep(ring), recorder(ring, tmp_path / "out", disk=disk)
    run.run(100)
    writer.work()
    disk.full = True
    for _ in range(5):
        run.run(100)
        writer.work()
    assert ring.note == DISK_FULL
    assert run.feed.flags(600) & Flag.DISK_FULL
    assert (run.core.steps, ring.lost, ring.waiting) == (600, 0, 0)
    disk.full = False
    run.run(100)
    writer.work()
    writer.close()
    assert not run.feed.flags(700) & Flag.DISK_FULL
    result = replay(Recording(tmp_path / "out"), StandIn())
    assert (result.first, result.gaps) == (None, 1)
    assert result.ticks >= 150


def test_a_recorder_that_hangs_costs_entries_not_ticks(ring: Ring, tmp_path: Path):
    """A wait for the disk that does not end: the queue fills, ticks go on, the flag comes up."""
    run, writer = Lockstep(ring), recorder(ring, tmp_path / "out")
    run.run(100)
    writer.work()
    assert run.feed.flags(100) == 0
    run.run(3000)
    assert run.core.steps == 3100
    assert ring.lost > 0
    assert run.feed.flags(3100) == Flag.RECORDER_LOST
    writer.work()
    run.run(100)
    writer.work()
    writer.close()
    assert run.feed.flags(3200) == 0
    result = replay(Recording(tmp_path / "out"), StandIn())
    assert (result.first, result.gaps) == (None, 1)
    assert result.ticks + ring.lost >= 3200


def test_what_is_no_recording_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match="there is no file"):
        Recording(tmp_path / "none.mcap").files()
    with pytest.raises(InputError, match="holds no recording"):
        Recording(tmp_path).files()
    other = tmp_path / "other.mcap"
    other.write_bytes(b"PK\x03\x04 this is something else")
    with pytest.raises(InputError, match="is not MCAP"):
        Recording(other).metadata()
