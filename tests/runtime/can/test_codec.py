"""The codec against cantools, message by message, and a DBC that does not match."""

from typing import Any

import cantools
from hypothesis import given, settings, strategies as st

from runtime.can.codec import codecs, received_by, sent_by
from runtime.image import INPUT, OUTPUT, Status
from specs.generate import FOLDER

DBC = FOLDER / "slewright.dbc"
DATABASE: Any = cantools.database.load_file(DBC)
CODECS = codecs()
NAMES = st.sampled_from(sorted(CODECS))


@settings(max_examples=300)
@given(NAMES, st.binary(min_size=8, max_size=8))
def test_unpacking_agrees_with_cantools(name: str, data: bytes) -> None:
    codec, message = CODECS[name], DATABASE.get_message_by_name(name)
    raw = message.decode_simple(data, scaling=False, decode_choices=False)
    for field, (value, status) in zip(codec.fields, codec.unpack(data), strict=True):
        limit = field.place.raw_limits[1]
        assert (status in (Status.OK, Status.RANGE) and value != 0.0) or raw[field.name] > limit or value == 0
        if status == Status.OK:
            scaled = message.decode_simple(data, decode_choices=False)[field.name]
            assert value == scaled
            assert (field.signal.min or 0.0) - field.place.scale <= value
        if raw[field.name] == field.top:
            assert status == Status.NOT_AVAILABLE
        if status == Status.ERROR:
            top = raw[field.name] >> (field.place.length - 8) if field.place.length in (8, 16, 32) else 0xFE
            assert top == 0xFE


@settings(max_examples=300)
@given(NAMES, st.data(), st.integers(0, 14))
def test_packing_agrees_with_cantools(name: str, data: st.DataObject, count: int) -> None:
    codec, message = CODECS[name], DATABASE.get_message_by_name(name)
    values = [data.draw(st.floats(f.signal.min or 0.0, f.signal.max or 0.0)) for f in codec.fields]
    frame = codec.pack(values, count)
    assert codec.count(frame) == count
    wanted = {f.name: v for f, v in zip(codec.fields, values, strict=True)}
    wanted |= {f"{name}_crc": frame[0], f"{name}_counter": count}
    assert frame == message.encode(wanted, padding=True, strict=False)
    for field, value, (again, status) in zip(codec.fields, values, codec.unpack(frame), strict=True):
        assert status == Status.OK
        assert abs(again - value) <= 0.5001 * field.place.scale


@settings(max_examples=200)
@given(NAMES, st.data())
def test_no_number_and_out_of_range_go_out_as_error(name: str, data: st.DataObject) -> None:
    codec = CODECS[name]
    bad = st.one_of(st.just(float("nan")), st.just(float("inf")), st.floats(1e9, 1e12))
    frame = codec.pack([data.draw(bad) for _ in codec.fields], 3)
    assert {status for _, status in codec.unpack(frame)} == {Status.ERROR}


@settings(max_examples=300)
@given(NAMES, st.binary(min_size=8, max_size=8), st.integers(0, 63))
def test_one_wrong_bit_is_found(name: str, data: bytes, bit: int) -> None:
    codec = CODECS[name]
    sent = codec.pack([value for value, _ in codec.unpack(data)], 5)
    got = int.from_bytes(sent, "little") ^ 1 << bit
    assert codec.count(got.to_bytes(8, "little")) is None


def test_a_short_frame_and_count_fifteen_are_wrong() -> None:
    codec = CODECS["SlewCommand"]
    frame = codec.pack([0.0] * len(codec.fields), 15)
    assert codec.count(frame) is None
    assert codec.count(codec.pack([0.0] * len(codec.fields), 2)[:7]) is None


def test_the_images_hold_what_the_controller_reads_and_sends() -> None:
    assert {f.name for c in received_by("Controller") for f in c.fields} == set(INPUT.index)
    assert {f.name for c in sent_by("Controller") for f in c.fields} == set(OUTPUT.index)
    urgency = [c.message.frame_id for c in sent_by("Controller")]
    assert urgency == sorted(urgency)
