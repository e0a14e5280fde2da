"""Shadow mode: nothing leaves, whatever is tried; what the operator did is kept beside what the core saw."""

from pathlib import Path

import can
import numpy as np
import pytest

from deployment.hil.panel import CALM
from runtime.can.native import NativePort
from runtime.can.port import WAYS_OUT, mute
from runtime.can.transmit import Transmitter
from runtime.configuration import read
from runtime.control import ControlCore
from runtime.image import INPUT, OUTPUT, Status
from runtime.recorder.seen import DTYPE, NAMES, VALVES, new, places
from runtime.scan import Scan
from runtime.shadow import COMMANDS, Listener, Overheard, StandIn, Withheld, silent
from specs.errors import InputError
from specs.signals import signal
from tests.runtime.bundles import core

MODE = OUTPUT.at("control_mode")
NUMBER = {text: n for n, text in signal("control_mode").values.items()}
AUTOMATIC, FAULT = NUMBER["automatic"], NUMBER["fault"]


class Recording:
    """A bus that keeps what is sent."""

    def __init__(self) -> None:
        self.sent: list[tuple[int, bytes]] = []

    def recv_raw(self) -> None:
        return None

    def send_raw(self, identifier: int, data: bytes) -> None:
        self.sent.append((identifier, data))


class Shown:
    """A port that keeps what it is given to show."""

    def __init__(self) -> None:
        self.seen: list[np.ndarray] = []

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """All is there: the sensors at rest, the machine ready, the operator with a hand on the joystick."""
        inputs["age"], inputs["status"] = 0, Status.OK
        value = inputs["value"]
        for name, x in {
            **CALM,
            "automatic_allowed": 0.0,
            "joystick_slew": 0.7,
            "operator_enable": 1.0,
        }.items():
            value[INPUT.index[name]] = x
        value[INPUT.index["machine_heartbeat"]] = tick // 5 % 251
        value[INPUT.index["planner_heartbeat"]] = tick // 5 % 251
        self.machine(value, tick)

    def machine(self, value: np.ndarray, tick: int) -> None:
        """Sensors; their noise never rests."""
        rest = {
            "q_boom": 1.2,
            "q_stick": -1.6,
            "target_x": 2.0,
            "target_y": 8.0,
            "target_z": 4.0,
            "target_valid": 1,
        }
        for name, x in rest.items():
            value[INPUT.index[name]] = x
        for i, s in enumerate(INPUT.signals):
            if s.name.startswith(("qd_", "imu_")) and not s.name.endswith("heartbeat"):
                value[i] = 1e-4 * (tick % 3)

    def send(self, outputs: np.ndarray, tick: int) -> None:
        self.seen.append(outputs.copy())

    def flags(self) -> int:
        return 0

    def received_ns(self) -> int:
        return 0


def run(ticks: int, made: ControlCore | None = None, change=None) -> tuple[Recording, Shown, StandIn, list]:
    made = made or core("pd")
    bus, shown, overheard = Recording(), Shown(), Overheard()
    stand_in = StandIn(overheard)
    outputs: list[np.ndarray] = []
    step = made.step

    def watched(inputs: np.ndarray, tick: int) -> np.ndarray:
        found = step(inputs, tick)
        outputs.append(found.copy())
        return found

    made.step = watched  # type: ignore[method-assign]
    ports = silent([NativePort(bus, made.library, None, overheard), shown], Shown, NativePort, stand_in)  # type: ignore[arg-type]
    scan = Scan(made, ports)
    for tick in range(ticks):
        if change:
            change(shown, tick)
        scan.cycle(tick, tick)
    return bus, shown, stand_in, outputs


def test_no_frame_leaves_while_the_controller_commands():
    bus, _, _, outputs = run(100)
    assert max(abs(o["value"][OUTPUT.index["u_slew"]]) for o in outputs) > 0.1  # it would have moved
    assert outputs[-1]["value"][MODE] == AUTOMATIC
    assert outputs[-1]["value"][OUTPUT.index["control_enable"]] == 1.0
    assert bus.sent == []


def test_without_shadow_mode_the_same_port_does_send():
    bus, made = Recording(), core("pd")
    scan = Scan(made, [NativePort(bus, made.library), Shown()])  # type: ignore[arg-type]
    scan.cycle(0, 0)
    assert bus.sent


def test_commands_are_withheld_from_who_reads_them():
    _, shown, _, outputs = run(60)
    places_of = [OUTPUT.at(n) for n in COMMANDS]
    assert all((o["value"][places_of] == 0.0).all() for o in shown.seen)
    assert all((o["status"][places_of] == Status.NOT_AVAILABLE).all() for o in shown.seen)
    assert shown.seen[-1]["value"][MODE] == outputs[-1]["value"][MODE]


def test_a_muted_bus_refuses_every_way_out():
    with can.Bus(interface="virtual", channel="shadow") as bus, can.Bus("shadow", "virtual") as other:
        muted = mute(bus)
        for name in WAYS_OUT:
            with pytest.raises(can.CanOperationError, match="nothing is sent"):
                getattr(muted, name)(can.Message(arbitration_id=1, data=b"x"))
        assert other.recv(timeout=0.05) is None


def test_the_stand_in_acknowledges_a_fault_only_once_its_cause_has_gone():
    def stop(shown: Shown, tick: int) -> None:
        pressed = 30 <= tick < 40
        plain = Shown.machine
        shown.machine = lambda value, t: (  # type: ignore[method-assign]
            plain(shown, value, t), value.__setitem__(INPUT.index["emergency_stop"], float(pressed))
        )  # fmt: skip

    *_, outputs = run(60, change=stop)
    modes = [int(o["value"][MODE]) for o in outputs]
    assert modes[29] == AUTOMATIC
    assert set(modes[31:40]) == {FAULT}
    assert modes[-1] == AUTOMATIC


def test_what_the_operator_did_is_kept_as_it_came():
    *_, stand_in, outputs = run(20)
    seen = dict(zip(NAMES, stand_in.seen["value"].tolist(), strict=True))
    assert seen["joystick_slew"] == 0.7
    assert seen["automatic_allowed"] == 0.0
    assert dict(zip(NAMES, stand_in.seen["status"].tolist(), strict=True))["u_slew"] == Status.NEVER
    assert len(outputs) == 20


def test_valve_commands_of_somebody_else_are_overheard():
    overheard = Overheard()
    values = [0.25 if s.name == "u_slew" else 0.0 for s in OUTPUT.signals]
    for frame_id, data in Transmitter("Controller", OUTPUT.index).due(values, 0):
        overheard.take(frame_id, data, 0)
    overheard.fill(INPUT.new(), 1)
    assert set(VALVES) <= overheard.index.keys()
    assert overheard.image["value"][overheard.index["u_slew"]] == pytest.approx(0.25, abs=1e-4)
    assert overheard.image["status"][overheard.index["u_slew"]] == Status.OK


def test_an_entry_comes_back_from_its_message():
    entry = new()
    entry["tick"], entry["value"], entry["age"] = 7, np.arange(len(NAMES)), 3
    back = places().entry(places().message(entry.tobytes()))
    assert back is not None
    assert np.frombuffer(back, DTYPE, 1)[0] == entry


def test_ports_keep_their_way_in():
    port = Shown()
    assert Listener(port).receive == port.receive
    assert Withheld(port).flags == port.flags


CONFIGURATION = """bundle = "x"
shadow = true
[can]
interface = "slewright"
channel = "bus"
"""


def test_the_configuration_wants_a_recorder(tmp_path: Path):
    file = tmp_path / "machine.toml"
    file.write_text(CONFIGURATION)
    with pytest.raises(InputError, match="shadow mode without \\[recorder\\]"):
        read(file)
    file.write_text(CONFIGURATION + '[recorder]\nfolder = "r"\n[retain]\nfolder = "kept"\n')
    found = read(file)
    assert found.shadow
    assert found.retain is None  # what it meets is not kept for a machine that is driven
