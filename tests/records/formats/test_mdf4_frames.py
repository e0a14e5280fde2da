"""Frames of a CAN bus in MDF4: how a log is laid down changes nothing; what cannot be read is said."""

import random
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from records.formats import read_measurement
from specs.errors import InputError
from tests.records.formats.bus_mf4 import FLOAT, Frame, Layout, Mf4

DBC = """VERSION ""
BS_:
BU_: A
BO_ 256 Press: 8 A
 SG_ p : 0|16@1+ (0.5,0) [0|0] "bar" A
 SG_ n : 32|32@1+ (1,0) [0|0] "" A
BO_ 2147483904 Other: 8 A
 SG_ z : 0|16@1+ (1,0) [0|0] "" A
BO_ 259 Long: 64 A
 SG_ x : 480|32@1+ (1,0) [0|0] "" A
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "VFrameFormat" BO_ 2147483904 1;
"""
PARTS = Layout().parts


@pytest.fixture(scope="module")
def dbc(tmp_path_factory):
    path = tmp_path_factory.mktemp("dbc") / "bus.dbc"
    path.write_text(DBC)
    return path


def sent(count: int, buses: int, seed: int) -> list[Frame]:
    """Frames of three messages, of which two differ in the length of their identifier alone."""
    r, frames = random.Random(seed), []
    for k in range(count):
        for bus in range(1, buses + 1):
            time = 0.01 * k + 0.001 * bus
            frames += [
                Frame(time, 256, struct.pack("<HHI", r.randrange(2**16), 0, r.randrange(2**32)), bus=bus),
                Frame(time + 0.002, 256, struct.pack("<HHI", r.randrange(2**16), 0, 0), long=True, bus=bus),
                Frame(time + 0.004, 259, r.randbytes(64), bus=bus),
            ]
    return sorted(frames, key=lambda f: f.time)


def written(path: Path, *groups: tuple[list[Frame], Layout]) -> Path:
    file = Mf4()
    for frames, how in groups:
        file.frames(frames, how)
    return file.save(path)


layouts = st.builds(
    Layout,
    per_s=st.just(0), width=st.sampled_from([0, 64]), compressed=st.booleans(), whole=st.booleans(),
    prefix=st.sampled_from(["CAN_DataFrame", "CAN1.CAN_DataFrame"]), shift=st.sampled_from([0, 7]),
    parts=st.sampled_from(
        [PARTS, *(tuple(p for p in PARTS if p != left) for left in ("IDE", "DLC", "DataLength", "EDL"))]
    ),
) | st.sampled_from(
    [Layout(per_s=1000, unit="ms"), Layout(per_s=10**6, unit="us", width=0), Layout(per_s=10**9, unit="ns")]
)  # fmt: skip


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(1, 3), st.integers(1, 3), st.lists(layouts, min_size=3, max_size=3), st.integers(0, 2**32))
def test_a_log_is_the_same_however_it_is_laid_down(tmp_path, dbc, buses, groups, how, seed):
    frames = sent(12, buses, seed)
    r = random.Random(seed)
    of = [r.randrange(groups) for _ in frames]
    parts = [([f for f, g in zip(frames, of, strict=True) if g == k], how[k]) for k in range(groups)]
    plain = read_measurement(written(tmp_path / "plain.mf4", (frames, Layout())), dbc=dbc)
    found = read_measurement(written(tmp_path / "other.mf4", *(p for p in parts if p[0])), dbc=dbc)
    assert plain.start is not None
    assert set(found.channels) == set(plain.channels)
    assert len(found.channels) == 4 * buses
    for name, channel in plain.channels.items():
        np.testing.assert_array_equal(found[name].values, channel.values)
        np.testing.assert_allclose(found[name].time, channel.time, atol=1e-9)
    bus = f"Press.bus{buses}.p" if buses > 1 else "p"
    expected = [f.data for f in frames if f.identifier == 256 and not f.long and f.bus == buses]
    np.testing.assert_array_equal(plain[bus].values, [0.5 * struct.unpack_from("<H", d)[0] for d in expected])


def test_frames_of_several_groups_without_a_bus_are_kept_apart(tmp_path, dbc):
    parts = [p for p in PARTS if p != "BusChannel"]
    one, two = sent(9, 1, 1), sent(9, 1, 2)
    path = written(tmp_path / "b.mf4", (one, Layout("CAN1", parts=parts)), (two, Layout("CAN2", parts=parts)))
    found = read_measurement(path, dbc=dbc)
    for name, frames in (("CAN1", one), ("CAN2", two)):
        expected = [
            0.5 * struct.unpack_from("<H", f.data)[0] for f in frames if f.identifier == 256 and not f.long
        ]
        np.testing.assert_array_equal(found[f"Press.{name}.p"].values, expected)


@pytest.mark.parametrize(
    ("state", "parts", "said"),
    [
        ({"invalid": True}, PARTS, "CAN: dropped 6 frames that the file calls invalid"),
        ({"remote": True}, (*PARTS, "RTR"), "CAN: frames without data: left out 6 remote frames"),
    ],
)
def test_frames_that_are_no_values_are_dropped(tmp_path, dbc, state, parts, said):
    frames = [Frame(0.01 * k, 256, bytes([k] * 8), **(state if k % 5 == 4 else {})) for k in range(30)]
    found = read_measurement(written(tmp_path / "i.mf4", (frames, Layout(parts=parts))), dbc=dbc)
    np.testing.assert_array_equal(found["p"].values, [0.5 * 257 * k for k in range(30) if k % 5 != 4])
    assert said in found.repairs


@pytest.mark.parametrize("width", [0, 4])
def test_what_a_frame_states_and_the_file_lacks_is_absent(tmp_path, dbc, width):
    frames = [Frame(0.01 * k, 256, bytes([k] * 4), stated=8) for k in range(10)]
    found = read_measurement(written(tmp_path / "s.mf4", (frames, Layout(width=width))), dbc=dbc)
    assert list(found.channels) == ["p"]
    assert "CAN: 10 frames are longer than what the file holds of them" in found.repairs


def test_identifiers_that_do_not_say_how_long_they_are_are_said(tmp_path, dbc):
    frames = [Frame(0.01 * k, 256, bytes(8)) for k in range(5)]
    path = written(tmp_path / "l.mf4", (frames, Layout(parts=[p for p in PARTS if p != "IDE"])))
    said = "CAN: identifiers do not say whether they have 29 bits: taken so beyond 7FF"
    assert said in read_measurement(path, dbc=dbc).repairs


@pytest.mark.parametrize(
    ("parts", "reason"),
    [
        (["ID", "DataLength"], "they have no CAN_DataFrame.DataBytes"),
        (["DataLength", "DataBytes"], "they have no CAN_DataFrame.ID"),
        (["ID", "DataBytes"], "they have neither CAN_DataFrame.DataLength nor CAN_DataFrame.DLC"),
    ],
)
def test_frames_that_lack_a_part_are_refused_by_its_name(tmp_path, dbc, parts, reason):
    path = written(tmp_path / "p.mf4", (sent(2, 1, 0), Layout(parts=parts)))
    with pytest.raises(
        InputError, match=rf"holds no data frame .* CAN: 6 frames left out, {reason}"
    ) as caught:
        read_measurement(path, dbc=dbc)
    assert str(caught.value).count("p.mf4") == 1


@pytest.mark.parametrize("kind", ["LIN_Frame", "FLX_Frame", "ETH_Frame", "CAN_ErrorFrame", "CAN_RemoteFrame"])
def test_groups_of_other_frames_are_named(tmp_path, dbc, kind):
    path = written(tmp_path / "o.mf4", (sent(2, 1, 0), Layout(prefix=kind)))
    with pytest.raises(InputError, match=rf"holds no data frame of a CAN bus.*; CAN: left out, {kind}: 6"):
        read_measurement(path, dbc=dbc)


def test_channels_beside_frames_are_left_out_with_a_dbc_and_read_without_one(tmp_path, dbc):
    file = Mf4()
    file.frames(sent(5, 2, 0), Layout())
    clock = file.channel("t", 0, 8, FLOAT, clock=True)
    file.group([clock, file.channel("load", 8, 8, FLOAT)], struct.pack("<4d", 0, 1, 2, 3), 2, 16, "Plain")
    path = file.save(tmp_path / "m.mf4")
    said = "Plain: left out, 2 samples of channels, no frames; they are read without --dbc"
    assert said in read_measurement(path, dbc=dbc).repairs
    plain = read_measurement(path)
    np.testing.assert_array_equal(plain["load"].values, [1, 3])


def test_frames_at_one_time_ask_for_a_dbc(tmp_path):
    frames = [Frame(0.01 * k, 256 + i, bytes(8)) for k in range(4) for i in range(2)]
    path = written(tmp_path / "t.mf4", (frames, Layout()))
    with pytest.raises(
        InputError, match=r"holds no samples; CAN: frames of a CAN bus, left out, .*; --dbc FILE"
    ):
        read_measurement(path)


@pytest.mark.parametrize("suffix", [".mdf", ".dat"])
def test_a_dbc_is_for_every_suffix_of_mdf(tmp_path, dbc, suffix):
    path = written(tmp_path / f"x{suffix}", (sent(5, 1, 0), Layout()))
    assert set(read_measurement(path, dbc=dbc).channels) == {"p", "n", "z", "x"}
    with pytest.raises(InputError, match=rf"--protocol j1939: .*{suffix} with --dbc"):
        read_measurement(path, protocol="j1939")


def test_a_clock_that_starts_again_in_one_of_two_groups_is_refused(tmp_path, dbc):
    again = [*sent(40, 1, 1), *sent(40, 1, 2)]
    between = [Frame(f.time + 0.005, f.identifier, f.data, f.long) for f in sent(40, 1, 3)]
    path = written(tmp_path / "j.mf4", (again, Layout("A")), (between, Layout("B")))
    with pytest.raises(InputError, match="the clock jumps back"):
        read_measurement(path, dbc=dbc)


def test_samples_that_the_file_does_not_count_are_said_and_those_it_lacks_refused(tmp_path, dbc):
    frames = sent(10, 1, 0)
    path = written(tmp_path / "few.mf4", (frames, Layout(counted=20)))
    for options in ({"dbc": dbc}, {}):
        said = "CAN: 10 samples behind the 20 that it states are not read"
        assert said in read_measurement(path, **options).repairs
        many = written(tmp_path / "many.mf4", (frames, Layout(counted=35)))
        with pytest.raises(InputError, match="CAN states 35 samples, of which 30 are there"):
            read_measurement(many, **options)


@pytest.mark.parametrize("width", [8, 0])
@pytest.mark.parametrize("decoded", [True, False])
def test_damaged_places_are_refused_before_memory_is_read(tmp_path, dbc, width, decoded):
    frames = [Frame(0.01 * k, 256, bytes(8)) for k in range(20)]
    path = written(tmp_path / "d.mf4", (frames, Layout(width=width)))
    data = bytearray(path.read_bytes())
    if width:
        at = data.find(struct.pack("<II", 18, 64))  # where its bytes stand in the record
        struct.pack_into("<I", data, at, 60_000)
    else:
        at = data.find(b"##DT") + 24 + 27 * 10 + 18  # where the bytes of frame 11 stand
        struct.pack_into("<Q", data, at, 2**63)
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"CAN_DataFrame.DataBytes of CAN .*beyond its (record|data)"):
        read_measurement(path, dbc=dbc if decoded else None)
