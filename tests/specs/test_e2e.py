"""The end-to-end protection against another CRC library and the properties the profile promises."""

import pytest
from crccheck.crc import Crc8Base
from hypothesis import given, strategies as st

from specs.e2e import LAST_COUNT, crc, protect, start
from specs.signals import definition

DATA = st.binary(min_size=8, max_size=8)
ID = st.integers(0, 0xFFFF)


class Profile1(Crc8Base):
    """SAE J1850 with the start and final values of E2E profile 1."""

    _poly, _initvalue, _xor_output = 0x1D, 0x00, 0x00


def test_the_known_example() -> None:
    """Data ID 0x123, counter and data 0, both bytes of the ID: CRC 0xCC (as autosar-e2e 1.0.0 gives it)."""
    data = bytearray(8)
    protect(data, 0x123, 0)
    assert data.hex() == "cc" + 7 * "00"


@given(data=DATA, data_id=ID, count=st.integers(0, LAST_COUNT))
def test_crc_agrees_with_another_library(data: bytes, data_id: int, count: int) -> None:
    sent = bytearray(data)
    protect(sent, data_id, count)
    assert sent[0] == Profile1.calc(data_id.to_bytes(2, "little") + bytes(sent[1:]))
    assert (sent[1] & 0x0F, sent[1] >> 4, sent[2:]) == (count, data[1] >> 4, data[2:])


@given(data=DATA, data_id=ID, bit=st.integers(0, 63), width=st.integers(1, 8), pattern=st.integers(0, 127))
def test_every_burst_of_eight_bits_is_found(data: bytes, data_id: int, bit: int, width: int, pattern: int):
    sent = bytearray(data)
    protect(sent, data_id, 3)
    burst = (1 | pattern << 1) & (1 << width) - 1
    damaged = int.from_bytes(sent, "big") ^ burst << bit & (1 << 64) - 1
    got = damaged.to_bytes(8, "big")
    assert got[0] != crc(start(data_id), got)


@pytest.mark.parametrize("name", definition().bus.messages)
def test_a_message_is_not_taken_for_another(name: str) -> None:
    """The start values tell our data IDs apart, whatever the data."""
    messages = definition().bus.messages.values()
    starts = {m.name: start(m.data_id) for m in messages if m.data_id is not None}
    assert [other for other, value in starts.items() if value == starts[name]] == [name]
