"""Who writes, when it takes effect, and what ends it; no sockets."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from runtime.modbus.cells import HOLDING, TARGETS
from runtime.modbus.holding import (
    CLAIM,
    COMMIT,
    GUESSES,
    HEARTBEAT,
    LAPSE_NS,
    PLACES,
    UNNAMED,
    Event,
    Holding,
    Refusal,
    decode,
    encode,
)
from specs.signals import definition, signal
from specs.wire import MODBUS_HEADER, ModbusPlace

FIRST = len(MODBUS_HEADER)
BODY = definition().modbus.tables["holding"].length
NAMES = [s.name for s in HOLDING]
MS = 1_000_000


@dataclass(eq=False)
class Somebody:
    """A client."""

    writes: bool = True
    peer: str = "here"


class Desk:
    """The table, the last published state, and a clock."""

    def __init__(self) -> None:
        self.state = np.zeros((), TARGETS)
        self.holding = Holding(self.publish)
        self.now = 1000 * MS

    def publish(self, state: np.ndarray) -> None:
        self.state = state.copy()

    def write(self, client: Somebody, address: int, *values: int) -> Refusal | None:
        return self.holding.write(client, address, list(values), self.now)

    def values(self) -> dict[str, float]:
        return dict(zip(NAMES, self.state["value"].tolist(), strict=True))


def body(**values: float) -> list[int]:
    """Registers of all targets."""
    registers = [0] * (FIRST + BODY)
    for s, place in zip(HOLDING, PLACES, strict=True):
        registers[place.address : place.registers.stop] = encode(place, values.get(s.name, s.start))
    return registers[FIRST:COMMIT]


def number(desk: Desk) -> int:
    """The writer's, as a register shows it."""
    return desk.holding.owner.number if desk.holding.owner else 0


@pytest.fixture
def desk() -> Desk:
    return Desk()


def test_values_take_effect_together_when_committed(desk: Desk) -> None:
    one = Somebody()
    assert desk.write(one, FIRST, *body(target_x=7.5, target_valid=1, pace=0.5)) is None
    assert desk.values()["target_x"] == 0.0
    assert desk.state["commits"] == 0
    assert desk.write(one, COMMIT, 1) is None
    assert desk.values()["target_x"] == 7.5
    assert desk.values()["pace"] == 0.5
    assert desk.state["commits"] == 1
    assert desk.write(one, COMMIT, 1) is None  # the same number commits nothing
    assert desk.state["commits"] == 1


def test_half_of_a_float_is_never_seen(desk: Desk) -> None:
    one, place = Somebody(), PLACES[NAMES.index("target_x")]
    desk.write(one, FIRST, *body(target_x=1.0), 1)
    high, low = encode(place, -3.14159)
    for address, word in ((place.address, high), (place.address + 1, low)):
        desk.write(one, address, word)
        assert desk.values()["target_x"] == 1.0
    desk.write(one, COMMIT, 2)
    assert desk.values()["target_x"] == pytest.approx(-3.14159, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("target_x", float("nan")),
        ("target_y", float("inf")),
        ("target_z", 25.1),
        ("pace", -0.1),
        ("load_told", 1e9),
    ],
)
def test_nonsense_is_refused_whole(desk: Desk, name: str, value: float) -> None:
    one = Somebody()
    desk.write(one, FIRST, *body(target_x=2.0), 1)
    before = list(desk.holding.registers)
    assert desk.write(one, FIRST, *body(**{"target_x": 3.0, name: value}), 2) == Refusal.VALUE
    assert desk.holding.registers == before
    assert desk.values()["target_x"] == 2.0
    assert desk.holding.refused == 1


def test_flags_and_heartbeat_have_their_range(desk: Desk) -> None:
    one = Somebody()
    assert desk.write(one, HEARTBEAT, 251) == Refusal.VALUE
    desk.write(one, PLACES[NAMES.index("target_valid")].address, 2)
    assert desk.write(one, COMMIT, 1) == Refusal.VALUE


def test_header_and_what_lies_beyond_cannot_be_written(desk: Desk) -> None:
    one = Somebody()
    assert desk.write(one, 0, 1) == Refusal.ADDRESS
    assert desk.write(one, FIRST - 1, 1, 2) == Refusal.ADDRESS
    assert desk.write(one, FIRST + BODY, 1) == Refusal.ADDRESS
    assert desk.write(one, FIRST + BODY - 1, 1, 2) == Refusal.ADDRESS


def test_a_role_that_does_not_write(desk: Desk) -> None:
    assert desk.write(Somebody(writes=False), HEARTBEAT, 1) == Refusal.FUNCTION
    assert desk.holding.owner is None


def test_one_writes_the_others_are_told_busy(desk: Desk) -> None:
    one, other = Somebody(), Somebody()
    assert desk.write(one, HEARTBEAT, 1) is None
    assert desk.write(other, HEARTBEAT, 2) == Refusal.BUSY
    assert desk.write(other, CLAIM, 7) == Refusal.BUSY
    assert number(desk) == UNNAMED
    assert desk.write(other, CLAIM, UNNAMED) == Refusal.VALUE


def test_a_writer_without_a_number_ends_with_its_connection(desk: Desk) -> None:
    one, other = Somebody(), Somebody()
    desk.write(one, FIRST, *body(target_x=2.0, planner_heartbeat=1), 1)
    desk.holding.left(one)
    desk.holding.beat(desk.now)
    assert (desk.state["owner"], desk.state["commits"], desk.state["heartbeat_ns"]) == (0, 0, 0)
    assert desk.write(other, HEARTBEAT, 1) is None


@pytest.mark.parametrize("peer", ["here", "elsewhere"])
def test_a_writer_with_a_number_comes_back(desk: Desk, peer: str) -> None:
    one, again, other = Somebody(), Somebody(peer=peer), Somebody()
    desk.write(one, CLAIM, 42)
    desk.write(one, FIRST, *body(target_x=2.0, planner_heartbeat=1), 1)
    first = desk.state["owner"].item()
    assert desk.write(again, CLAIM, 42) == Refusal.BUSY  # the old connection is there, and beats
    desk.holding.left(one)
    assert desk.state["owner"] == first
    assert desk.write(other, HEARTBEAT, 9) == Refusal.BUSY
    assert desk.write(again, HEARTBEAT, 2) == Refusal.BUSY  # it has not said who it is
    assert desk.write(again, CLAIM, 42) is None
    assert desk.write(again, HEARTBEAT, 2) is None
    same = peer == "here"
    assert (desk.state["commits"], desk.values()["target_x"]) == ((1, 2.0) if same else (0, 0.0))
    assert (desk.state["owner"] == first) == same, "a takeover from elsewhere is another writer"
    assert desk.write(one, HEARTBEAT, 3) == Refusal.BUSY


def test_no_register_shows_the_secret_and_few_guesses_are_free(desk: Desk) -> None:
    one, other = Somebody(), Somebody()
    desk.write(one, CLAIM, 42)
    assert number(desk) not in (0, 42)
    assert 42 not in desk.holding.registers[FIRST:]
    desk.holding.left(one)
    assert [desk.write(other, CLAIM, guess) for guess in (1, 2, 3)] == [Refusal.BUSY] * GUESSES
    assert desk.write(Somebody(), CLAIM, 42) == Refusal.BUSY
    desk.now += LAPSE_NS
    assert desk.write(other, CLAIM, 7) is None


def test_what_happens_to_the_right_is_told(desk: Desk) -> None:
    told: list[tuple[Event, object]] = []
    desk.holding = Holding(desk.publish, tell=lambda event, client, why: told.append((event, client)))
    one, again, other = Somebody(), Somebody(), Somebody(peer="elsewhere")
    desk.write(one, CLAIM, 42)
    desk.write(other, CLAIM, 42)
    desk.holding.left(one)
    desk.write(again, CLAIM, 42)
    desk.holding.left(again)
    desk.write(other, CLAIM, 42)
    desk.now += LAPSE_NS
    desk.holding.lapse(desk.now)
    desk.write(other, HEARTBEAT, 1)
    desk.holding.left(other)
    desk.write(one, CLAIM, 1)
    desk.write(one, CLAIM, 0)
    assert told == [
        (Event.CLAIMED, one), (Event.REFUSED, other), (Event.BACK, again), (Event.TAKEN, other),
        (Event.LAPSED, other), (Event.CLAIMED, other), (Event.LEFT, other), (Event.CLAIMED, one),
        (Event.GIVEN_BACK, one),
    ]  # fmt: skip


FLOATS = [(s, p) for s, p in zip(HOLDING, PLACES, strict=True) if p.type == "float32"]


@settings(max_examples=200)
@given(st.sampled_from(FLOATS), st.integers(0, 40_000))
def test_the_wrong_word_order_is_never_read_as_next_to_nothing(which, steps: int) -> None:
    s, place = which
    value = float(np.float32(min(s.min + steps * s.can.scale, s.max)))
    desk, words = Desk(), body(**{s.name: value})
    assert desk.write(Somebody(), FIRST, *words, 1) is None
    if abs(value) >= s.can.scale:
        at = place.address - FIRST
        words[at : at + 2] = words[at : at + 2][::-1]
        desk = Desk()
        refused = desk.write(Somebody(), FIRST, *words, 2) is not None
        assert refused or words == body(**{s.name: value}) or abs(desk.values()[s.name]) >= s.can.scale


def test_a_small_number_is_one(desk: Desk) -> None:
    assert (
        desk.write(
            Somebody(), FIRST, *body(target_x=7.0, target_y=float(np.float32(7 * np.cos(np.pi / 2)))), 1
        )
        is None
    )


def test_a_commit_that_commits_nothing_is_refused(desk: Desk) -> None:
    one = Somebody()
    assert desk.write(one, COMMIT, 0) == Refusal.VALUE
    assert desk.write(one, FIRST, *body(target_x=2.0), 0) == Refusal.VALUE
    assert desk.write(one, FIRST, *body(target_x=2.0), 1) is None
    assert desk.write(one, FIRST, *body(target_x=2.0), 1) is None  # sent twice
    assert desk.write(one, FIRST, *body(target_x=3.0), 1) == Refusal.VALUE
    assert desk.values()["target_x"] == 2.0


def test_a_heartbeat_that_stands_still_ends_it(desk: Desk) -> None:
    one, other = Somebody(), Somebody()
    desk.write(one, CLAIM, 42)
    desk.write(one, FIRST, *body(target_x=2.0, planner_heartbeat=1), 1)
    for beat in range(2, 6):
        desk.now += LAPSE_NS - 1
        assert desk.write(one, HEARTBEAT, beat) is None
        assert desk.write(one, HEARTBEAT, beat) is None  # the same number is no heartbeat
    assert desk.write(other, HEARTBEAT, 1) == Refusal.BUSY
    desk.now += LAPSE_NS
    assert desk.write(other, FIRST, *body(target_x=4.0)) is None
    desk.holding.beat(desk.now)
    assert number(desk) == UNNAMED
    assert desk.state["commits"] == 0, "what the one before committed must not live on another's heartbeat"
    assert desk.values()["target_x"] == 0.0


def test_giving_back(desk: Desk) -> None:
    one, other = Somebody(), Somebody()
    desk.write(one, CLAIM, 42)
    assert desk.write(other, CLAIM, 0) == Refusal.BUSY
    assert desk.write(one, COMMIT, 1, 0) == Refusal.VALUE  # 0 stands alone
    assert desk.write(one, CLAIM, 0) is None
    assert desk.holding.owner is None
    assert desk.write(other, CLAIM, 43) is None


def test_claim_values_and_commit_in_one_request(desk: Desk) -> None:
    assert desk.write(Somebody(), FIRST, *body(target_x=5.0, planner_heartbeat=3), 1, 42) is None
    assert (desk.values()["target_x"], number(desk), desk.state["heartbeat_ns"]) == (5.0, 1, desk.now)


@settings(max_examples=50)
@given(st.floats(width=32, allow_nan=False), st.sampled_from(["high_first", "low_first"]))
def test_floats_go_and_come(value: float, order) -> None:
    place = ModbusPlace(table="holding", address=1, type="float32", word_order=order)
    assert decode(place, [0, *encode(place, value)]) == value


@pytest.mark.parametrize(("sort", "value"), [("uint16", 65535), ("int16", -3), ("uint32", 0xFEDC_BA98)])
def test_whole_numbers_go_and_come(sort, value: int) -> None:
    place = ModbusPlace(table="holding", address=0, type=sort)
    assert decode(place, encode(place, value)) == value


REQUESTS = st.lists(
    st.tuples(
        st.integers(0, 2),  # who
        st.integers(0, FIRST + BODY + 1),
        st.lists(st.sampled_from([0, 1, 2, 42, 250, 251, 0x4000, 0x7FC0, 0xFFFF]), min_size=1, max_size=16),
        st.sampled_from([0, 10 * MS, LAPSE_NS]),
    ),
    max_size=30,
)


@settings(max_examples=30)
@given(REQUESTS)
def test_whatever_is_written_what_counts_is_in_range_and_of_one_writer(requests) -> None:
    desk, clients = Desk(), [Somebody(), Somebody(), Somebody(writes=False)]
    for who, address, values, pause in requests:
        desk.now += pause
        before = desk.holding.owner and desk.holding.owner.client
        lapsed = desk.holding.owner and desk.now - desk.holding.owner.since_ns >= LAPSE_NS
        refusal = desk.write(clients[who], address, *values)
        if before not in (None, clients[who]) and not lapsed:
            assert refusal is not None
        if desk.state["commits"]:
            for name, value in desk.values().items():
                low, high = signal(name).min, signal(name).max
                assert low is not None
                assert high is not None
                assert low <= value <= high
