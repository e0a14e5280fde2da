"""The generated DBC, read by cantools: it says of every signal what signals.toml says."""

import cantools
import pytest
from cantools.database import Database
from hypothesis import given, strategies as st

from specs import dbc
from specs.signals import definition, signals

SPEC = definition()
ON_CAN = {name: s for name, s in signals().items() if s.can}


@pytest.fixture(scope="module")
def database() -> Database:
    return _parse()


def _parse() -> Database:
    loaded = cantools.database.load_string(dbc.render(), "dbc", strict=True)
    assert isinstance(loaded, Database)
    return loaded


DATABASE = _parse()


def test_all_messages_and_signals_are_there(database: Database) -> None:
    found = {s.name: m.name for m in database.messages for s in m.signals}
    wanted = {name: s.can.message for name, s in ON_CAN.items() if s.can}
    assert found == wanted | {f"{m}_{part}": m for m in SPEC.bus.messages for part in ("crc", "counter")}


@pytest.mark.parametrize("name", SPEC.bus.messages)
def test_protection_is_described(name: str, database: Database) -> None:
    found = database.get_message_by_name(name)
    assert found.dbc
    attributes = {key: a.value for key, a in found.dbc.attributes.items()}
    assert attributes["E2EProfile"] == dbc.PROFILE
    assert attributes["E2EDataID"] == SPEC.bus.messages[name].data_id
    crc, counter = (found.get_signal_by_name(f"{name}_{part}") for part in ("crc", "counter"))
    assert (crc.start, crc.length, counter.start, counter.length) == (0, 8, 8, 4)
    for field, kind in ((crc, "MessageChecksum"), (counter, "MessageCounter")):
        assert field.dbc
        assert dbc.SIGNAL_TYPES[int(field.dbc.attributes["SigType"].value)] == kind


@pytest.mark.parametrize("name", SPEC.bus.messages)
def test_message_frame(name: str, database: Database) -> None:
    wanted, found = SPEC.bus.messages[name], database.get_message_by_name(name)
    assert found.is_extended_frame
    assert found.protocol == "j1939"
    assert found.frame_id == wanted.frame_id < 1 << 29
    assert found.frame_id >> 26 == wanted.priority
    assert found.frame_id >> 8 & 0x3FFFF == wanted.pgn
    assert found.frame_id & 0xFF == SPEC.bus.nodes[wanted.sender]
    assert found.length == 8
    assert found.cycle_time == wanted.cycle_ms
    assert found.senders == [wanted.sender]
    assert found.receivers == set(wanted.receivers)


@pytest.mark.parametrize("name", ON_CAN)
def test_signal_place_and_meaning(name: str, database: Database) -> None:
    wanted = ON_CAN[name]
    assert wanted.can
    found = database.get_message_by_name(wanted.can.message).get_signal_by_name(name)
    assert (found.start, found.length, found.byte_order) == (
        wanted.can.start,
        wanted.can.length,
        wanted.can.byte_order,
    )
    assert found.is_signed == wanted.can.signed
    assert (found.scale, found.offset) == (wanted.can.scale, wanted.can.offset)
    assert (found.minimum, found.maximum) == (wanted.min, wanted.max)
    assert (found.unit or "1") == wanted.unit
    assert found.comment == wanted.description
    assert len(name) <= 32


@given(share=st.floats(0.0, 1.0))
def test_round_trip_within_half_a_count(share: float) -> None:
    for message in DATABASE.messages:
        spec = [ON_CAN[s.name] for s in message.signals if s.name in ON_CAN]
        values = {s.name: 0.0 for s in message.signals} | {
            s.name: (s.min or 0.0) + share * ((s.max or 0.0) - (s.min or 0.0)) for s in spec
        }
        frame = message.encode(values, strict=True)
        decoded = message.decode_simple(frame, decode_choices=False)
        for s in spec:
            assert s.can
            assert decoded[s.name] == pytest.approx(values[s.name], abs=0.5 * s.can.scale * (1 + 1e-6)), (
                s.name
            )


def test_zero_and_start_values_survive_exactly(database: Database) -> None:
    for s in ON_CAN.values():
        message = database.get_message_by_name(s.can.message if s.can else "")
        for value in (0.0, s.start):
            if (s.min or 0.0) <= value <= (s.max or 0.0):
                lowest = {
                    s.name: 0.0 if s.name not in ON_CAN else ON_CAN[s.name].min for s in message.signals
                }
                values = {name: low or 0.0 for name, low in lowest.items()} | {s.name: value}
                decoded = message.decode_simple(message.encode(values), decode_choices=False)
                assert decoded[s.name] == pytest.approx(value, abs=1e-9), s.name


def test_start_value_attributes_are_raw(database: Database) -> None:
    slew = database.get_message_by_name("SlewCommand").get_signal_by_name("u_slew")
    assert slew.raw_initial == 32000
    assert slew.initial == 0


def test_not_available_lies_outside_every_range() -> None:
    for s in ON_CAN.values():
        assert s.can
        not_available = ((1 << s.can.length) - 1) * s.can.scale + s.can.offset
        assert not_available > (s.max or 0.0) + s.can.scale / 2, s.name


def test_enumerations_are_named(database: Database) -> None:
    status = database.get_message_by_name("ControllerStatus")
    values = {s.name: 0 for s in status.signals} | {"control_mode": 3, "target_reached": 1}
    decoded = status.decode_simple(status.encode(values))
    assert decoded["control_mode"] == "automatic"
    assert decoded["target_reached"] == "on"
    assert decoded["fault_code"] == "none"
    flag = status.get_signal_by_name("target_reached")
    assert flag.choices is not None
    assert {int(k): str(v) for k, v in flag.choices.items()} == {
        0: "off",
        1: "on",
        2: "error",
        3: "not_available",
    }


def test_says_what_it_was_generated_from() -> None:
    text = dbc.render()
    assert "Generated from specs/signals.toml" in text
    assert text.isascii()
