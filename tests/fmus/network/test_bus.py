"""The bus FMU, driven by hand: how long frames take, who wins, and what nodes are told of faults."""

import random
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest
from fmpy.validation import validate_fmu

from fmus.network.bus import build_bus, definition_of_bus, main
from orchestrator.fmi.instance import Instance
from orchestrator.fmi.variable import Value
from orchestrator.system.check import load_system
from specs.errors import InputError, RunError
from tests.fmus.network import operations as op

RATE, STEP_S = 250_000, 0.0001
DATA = bytes(range(8))


class Bus:
    """An instance with three nodes; `step` gives what each was sent, by node."""

    def __init__(self, path: Path, parameters: Mapping[str, Value]) -> None:
        self.system = load_system(path)
        self.instance = Instance(next(iter(self.system.components.values())))
        self.instance.set_values({"bit_rate": RATE, **parameters})
        self.instance.enter_initialisation()
        self.instance.exit_initialisation()
        self.instance.update_discrete()
        self.instance.enter_step()
        self.ticks = 0

    def give(self, contents: Mapping[int, bytes]) -> None:
        """Operations of nodes, all at this instant."""
        self.instance.enter_event()
        for node, content in contents.items():
            self.instance.set_values({f"Node{node}.Rx_Data": content})
            self.instance.set_values({f"Node{node}.Rx_Clock": True})
        self.instance.update_discrete()
        self.instance.enter_step()

    def step(self) -> dict[int, bytes]:
        """One step, and what the nodes got at its end."""
        event = self.instance.step(self.ticks * STEP_S, STEP_S).event
        self.ticks += 1
        if not event:
            return {}
        self.instance.enter_event()
        clocks = self.instance.values([f"Node{n}.Tx_Clock" for n in (1, 2, 3)])
        found = self.instance.values([f"Node{n}.Tx_Data" for n in (1, 2, 3) if clocks[f"Node{n}.Tx_Clock"]])
        self.instance.update_discrete()
        self.instance.enter_step()
        return {int(name[4]): content for name, content in found.items()}  # type: ignore[misc]

    def until(self, time_s: float) -> list[tuple[float, int, bytes]]:
        """(time, node, content) of everything sent until then."""
        got = []
        while self.ticks * STEP_S < time_s - 1e-9:
            got += [(self.ticks * STEP_S, node, content) for node, content in self.step().items()]
        return got


@pytest.fixture(scope="module")
def path() -> Path:
    return build_bus(Path(tempfile.mkdtemp()) / "can_bus.fmu", 3)


@pytest.fixture
def bus(path: Path, request: pytest.FixtureRequest) -> Iterator[Bus]:
    made = Bus(path, getattr(request, "param", {}))
    yield made
    made.instance.free()


def arrivals(got: list[tuple[float, int, bytes]], node: int) -> list[tuple[float, int]]:
    """(time, identifier) of the frames that a node received."""
    return [(time, i) for time, n, content in got if n == node for i, _ in op.frames(content)]


def test_it_is_a_valid_fmu(path: Path) -> None:
    assert validate_fmu(str(path)) == []


def test_a_frame_takes_as_long_as_its_bits(path: Path) -> None:
    numbers = random.Random(1)
    for _ in range(30):
        bus = Bus(path, {})
        identifier, data = numbers.getrandbits(29), numbers.randbytes(numbers.randrange(9))
        if numbers.random() < 0.3:
            identifier, data = 0, bytes(len(data))  # the most stuff bits
        bus.give({1: op.transmit(identifier, data)})
        got = bus.until(0.001)
        took = op.bits(identifier, data) / RATE
        assert bus.instance.get("longest_wait")[0] == pytest.approx(took, abs=1e-9)
        ((time, seen),) = arrivals(got, 2)
        assert seen == identifier
        assert 0.0 <= time - took < STEP_S + 1e-9
        assert arrivals(got, 1) == []
        confirmed = [i for _, n, content in got if n == 1 for i in op.identifiers(content, op.CONFIRM)]
        assert confirmed == [identifier]
        bus.instance.free()


def test_the_smallest_identifier_wins_and_all_take_turns(bus: Bus) -> None:
    bus.give({1: op.transmit(0x300, DATA) + op.transmit(0x100, DATA), 2: op.transmit(0x200, DATA)})
    got = bus.until(0.003)
    assert [i for _, i in arrivals(got, 3)] == [0x100, 0x200, 0x300]
    ends, at = [], 0.0
    for identifier in (0x100, 0x200, 0x300):
        at += op.bits(identifier, DATA) / RATE
        ends.append(at)
        at += 3 / RATE  # intermission
    for (time, _), end in zip(arrivals(got, 3), ends, strict=True):
        assert 0.0 <= time - end < STEP_S + 1e-9
    assert bus.instance.get("longest_wait")[0] == pytest.approx(ends[-1], abs=1e-8)


def test_a_standard_frame_wins_over_an_extended_one_with_the_same_beginning(bus: Bus) -> None:
    bus.give({1: op.transmit(0x123 << 18, DATA), 2: op.transmit(0x123, DATA, extended=False)})
    assert [i for _, i in arrivals(bus.until(0.003), 3)] == [0x123, 0x123 << 18]


def test_who_asks_for_it_gets_lost_frames_back(bus: Bus) -> None:
    bus.give({2: op.behaviour(op.DISCARD)})
    bus.give({1: op.transmit(0x100, DATA), 2: op.transmit(0x200, DATA), 3: op.transmit(0x300, DATA)})
    got = bus.until(0.003)
    assert [i for _, n, content in got if n == 2 for i in op.identifiers(content, op.LOST)] == [0x200]
    assert [i for _, i in arrivals(got, 1)] == [0x300]
    assert bus.instance.get("arbitrations_lost").tolist() == [1]


@pytest.mark.parametrize("bus", [{"delay": 0.0015}], indirect=True)
def test_frames_may_come_later_than_they_end(bus: Bus) -> None:
    bus.give({1: op.transmit(0x100, DATA)})
    ((time, _),) = arrivals(bus.until(0.004), 2)
    assert 0.0 <= time - op.bits(0x100, DATA) / RATE - 0.0015 < STEP_S + 1e-9


@pytest.mark.parametrize(
    "bus", [{"error_probability": 1.0, "fault_until": 0.0009, "fault_identifier": 0x100}], indirect=True
)
def test_a_spoiled_frame_is_told_to_all_and_sent_again(bus: Bus) -> None:
    bus.give({1: op.transmit(0x100, DATA), 2: op.transmit(0x200, DATA)})
    got = bus.until(0.004)
    errors = [(n, a) for _, n, content in got for code, a in op.read(content) if code == op.BUS_ERROR]
    assert sorted(n for n, _ in errors) == [1, 2, 3]
    assert {n: (a[4], a[5], a[6]) for n, a in errors} == {1: (4, 2, 1), 2: (4, 1, 0), 3: (4, 1, 0)}
    (first, second) = arrivals(got, 3)
    assert [first[1], second[1]] == [0x100, 0x200]
    length = op.bits(0x100, DATA)
    assert 0.0 <= first[0] - (2 * length + 23) / RATE < STEP_S + 1e-9


@pytest.mark.parametrize("bus", [{"drop_probability": 1.0, "fault_identifier": 0x100}], indirect=True)
def test_a_dropped_frame_is_confirmed_and_received_by_nobody(bus: Bus) -> None:
    bus.give({1: op.transmit(0x100, DATA) + op.transmit(0x200, DATA)})
    got = bus.until(0.003)
    assert [i for _, i in arrivals(got, 2)] == [0x200]
    assert [i for _, n, c in got if n == 1 for i in op.identifiers(c, op.CONFIRM)] == [0x100, 0x200]


@pytest.mark.parametrize("bus", [{"drop_probability": 0.3, "seed": 7}], indirect=True)
def test_faults_are_drawn_as_often_as_asked_and_the_same_again(path: Path, bus: Bus) -> None:
    def run(one: Bus) -> list[tuple[float, int]]:
        got = []
        for number in range(200):
            one.give({1: op.transmit(number + 1, b"")})
            got += one.until(one.ticks * STEP_S + 0.0005)
        return arrivals(got, 2)

    first, other = run(bus), Bus(path, {"drop_probability": 0.3, "seed": 7})
    assert 200 * 0.7 - 3 * 6.5 < len(first) < 200 * 0.7 + 3 * 6.5  # three standard deviations
    assert run(other) == first
    other.instance.free()


def test_nodes_that_are_off_get_nothing_and_alone_nobody_is_confirmed(bus: Bus) -> None:
    off = op.operation(op.STATUS, b"\x03")
    bus.give({2: off, 3: off})
    bus.give({1: op.transmit(0x100, DATA), 2: op.transmit(0x50, DATA)})
    assert bus.until(0.002) == []
    assert bus.instance.get("frames").tolist() == [1]


def test_wake_up_goes_to_the_others_and_nonsense_comes_back(bus: Bus) -> None:
    canfd = op.operation(0x11, b"\x00" * 11)
    bus.give({1: op.operation(op.WAKEUP), 3: canfd})
    got = {node: list(op.read(content)) for node, content in bus.step().items()}
    assert got[2] == [(op.WAKEUP, b"")]
    assert [(op.WAKEUP, b""), (op.FORMAT_ERROR, len(canfd).to_bytes(2, "little") + canfd)] == got[3]
    bus.give({2: b"\x10\x00\x00\x00\xff\xff\x00\x00short"})
    ((code, _),) = op.read(bus.step()[2])
    assert code == op.FORMAT_ERROR


def test_a_node_at_another_rate_ends_the_run(bus: Bus) -> None:
    bus.give({1: op.baudrate(RATE)})
    with pytest.raises(RunError, match="node 2 is set to 500000 bit/s, the bus to 250000 bit/s"):
        bus.give({2: op.baudrate(500_000)})


def test_its_state_is_all_of_it(path: Path, bus: Bus) -> None:
    bus.give({1: op.transmit(0x100, DATA), 2: op.transmit(0x200, DATA)})
    bus.until(0.0004)
    state = bus.instance.get_state()
    stored = bus.instance.serialize_state(state)
    first = bus.until(0.003)
    other = Bus(path, {})
    other.ticks = 4
    other.instance.set_state(other.instance.deserialize_state(stored))
    assert other.until(0.003) == first
    assert len(arrivals(first, 3)) == 2
    bus.instance.free_state(state)
    other.instance.free()


def test_a_bus_for_no_number_of_nodes_is_refused() -> None:
    with pytest.raises(InputError, match="a bus for 1 nodes; valid: 2 … 16"):
        definition_of_bus(1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "a file and a whole number"),
        (["b.fmu", "three"], "a file and a whole number"),
        (["b.fmu", "1"], "a bus for 1 nodes; valid: 2 … 16"),
        (["b.txt", "3"], "valid: FILE.fmu"),
        (["nowhere/b.fmu", "3"], "in a folder that there is"),
    ],
)
def test_wrong_arguments_are_refused(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
    arguments: list,
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
