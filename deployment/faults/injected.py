"""Faults on the bus and in the input image, at random moments of a drive."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from deployment.faults import devices
from deployment.faults.client import LostClient, TakenOver
from deployment.faults.drive import AUTOMATIC, Drive, Frame, Moment, Run, mode_number
from deployment.faults.interfaces import Followed, Lost
from deployment.faults.table import TICK_MS, Fault, Outcome
from runtime.can.codec import Codec, Field, codecs
from runtime.can.transmit import Transmitter
from runtime.can.wire import BUS_OFF, CONTROLLER, ERROR, REMOTE, RX_OVERFLOW
from runtime.image import INPUT, NODE, OUTPUT
from specs.e2e import COUNTER_BITS, LAST_COUNT
from specs.signals import definition

NEEDED = ("imu_cabin_rate_z", "q_slew", "q_boom", "q_stick", "qd_boom", "qd_stick")  # by every controller
RESTLESS = ("imu_cabin_rate_z", "qd_boom", "qd_stick")  # their noise never lets them repeat a value for long
JOYSTICK = ("joystick_slew", "joystick_boom", "joystick_stick")
AXES = [OUTPUT.index[n] for n in ("u_slew", "u_boom", "u_stick")]
MODE, CODE = OUTPUT.index["control_mode"], OUTPUT.index["fault_code"]
NAMES = definition().signals["fault_code"].values
FAULT = mode_number("fault")
BABBLE = 104  # frames of the lowest identifier that a tick has room for
MARGIN_TICKS = 10  # beyond the limit, to see by how much it was missed
Random = np.random.Generator


@dataclass
class Disturbance:
    """What happens to the frames and to the image of the k-th tick of the fault; None: nothing."""

    frames: Callable[[Sequence[Frame], int], Sequence[Frame]] | None = None
    twist: Callable[[int, np.ndarray], None] | None = None
    state: Callable[[bytes], bytes] | None = None  # the core's, once
    counted: Callable[[Run], bool] = lambda run: True  # where nothing else is to happen


def inject(fault: Fault, drive: Drive, moment: Moment, random: Random, outcome: Outcome) -> None:
    """One injection of `fault` at `moment`."""
    run = Run(drive, moment)
    disturbance = MAKERS[fault.name](random) if fault.name in MAKERS else _of_port(fault.name, drive, random)
    if disturbance.state:
        drive.core.restore(disturbance.state(moment.core))
    ticks = round(fault.limit_ms / TICK_MS) + MARGIN_TICKS
    neutral = None
    for k in range(ticks):
        tick = moment.tick + k
        frames = drive.frames[tick] if tick < len(drive.frames) else drive.frames[-1]
        if disturbance.frames:
            frames = disturbance.frames(frames, k)
        outputs = run.step(frames, tick, partial(disturbance.twist, k) if disturbance.twist else None)
        why = _wrong(fault, outputs["value"])
        if why:
            outcome.add(moment.tick, None, why)
            return
        stopped = outputs["value"][MODE] == FAULT and not outputs["value"][AXES].any()
        neutral = (k if neutral is None else neutral) if stopped else None
    if fault.codes:
        said = NAMES[int(outputs["value"][CODE])]
        why = f"named {said}" if fault.named and said != fault.named else ""
        outcome.add(moment.tick, None if neutral is None else (neutral + 1) * TICK_MS, why)
        return
    counted = disturbance.counted(run) and outputs["value"][MODE] == AUTOMATIC
    outcome.add(moment.tick, TICK_MS if counted else None, "" if counted else "not counted, or not automatic")


def _wrong(fault: Fault, value: np.ndarray) -> str:
    """What must not be in any output during the fault."""
    if not (np.abs(value[AXES]) <= 1.0).all():
        return f"commands {value[AXES].tolist()}"
    if value[MODE] == FAULT and NAMES[int(value[CODE])] not in fault.codes:
        return f"fault code {NAMES[int(value[CODE])]}"
    return ""


def _of_port(name: str, drive: Drive, random: Random) -> Disturbance:
    """Of what comes through another port than the controller's CAN."""
    return Disturbance(twist=OF_PORTS[name](drive.core.library, random))


# ---- frames ----


def _codec_of(name: str) -> Codec:
    place = definition().signals[name].can
    return codecs()[place.message if place else ""]


def _field(name: str) -> tuple[Codec, Field]:
    codec = _codec_of(name)
    return codec, next(f for f in codec.fields if f.name == name)


def _without(*messages: int) -> Disturbance:
    return Disturbance(lambda frames, k: [f for f in frames if f[0] not in messages])


def _changed(codec: Codec, change: Callable[[bytearray, int], None], protect: bool = True) -> Disturbance:
    """The codec's message with its bytes changed, its checksum right again if `protect`."""

    def disturb(frames: Sequence[Frame], k: int) -> list[Frame]:
        found = []
        for identifier, data in frames:
            if identifier == codec.message.frame_id:
                changed = bytearray(data)
                change(changed, k)
                if protect:
                    changed[0] = codec.checksum(changed)
                data = bytes(changed)
            found.append((identifier, data))
        return found

    return Disturbance(disturb)


def _set(data: bytearray, at: Field, raw: int) -> None:
    bits = int.from_bytes(data, "little") & ~(at.top << at.place.start) | raw << at.place.start
    data[:] = bits.to_bytes(len(data), "little")


def _get(data: bytearray, at: Field) -> int:
    return int.from_bytes(data, "little") >> at.place.start & at.top


def _raw(names: Sequence[str], which: Callable[[Field, Random], int]) -> Callable[[Random], Disturbance]:
    """A field of one of the signals says a certain raw number."""

    def make(random: Random) -> Disturbance:
        codec, at = _field(str(random.choice(names)))
        raw = which(at, random)
        return _changed(codec, lambda data, k: _set(data, at, raw))

    return make


def _outside(at: Field, random: Random) -> int:
    """A number above what the signal's range comes to, and below what says error."""
    first = round((at.limits[1] - at.place.offset) / at.place.scale) + 1
    return int(random.integers(first, at.error))


def _stuck(random: Random) -> Disturbance:
    codec, at = _field(str(random.choice(RESTLESS)))
    held: list[int] = []

    def change(data: bytearray, k: int) -> None:
        if not held:
            held.append(_get(data, at))
        _set(data, at, held[0])

    return _changed(codec, change)


def _flipped(random: Random) -> Disturbance:
    codec = _codec_of(str(random.choice(NEEDED)))

    def change(data: bytearray, k: int) -> None:
        for bit in random.choice(8 * len(data), random.integers(1, 4), replace=False):
            data[bit // 8] ^= 1 << bit % 8

    return _changed(codec, change, protect=False)


def _same_count(random: Random) -> Disturbance:
    codec, count = _codec_of(str(random.choice(NEEDED))), int(random.integers(0, LAST_COUNT + 1))
    at = COUNTER_BITS.start // 8

    def change(data: bytearray, k: int) -> None:
        data[at] = data[at] & 0xF0 | count

    return _changed(codec, change)


def _babble(random: Random) -> Disturbance:
    return Disturbance(lambda frames, k: [(0, random.bytes(8)) for _ in range(BABBLE)])


def _other_controller(random: Random) -> Disturbance:
    """Its commands, now and then."""
    other, every = Transmitter(NODE, OUTPUT.index), int(random.integers(1, 20))
    values = OUTPUT.new()["value"].tolist()
    values[OUTPUT.index["u_slew"]] = float(random.uniform(-1.0, 1.0))
    return Disturbance(lambda frames, k: [*frames, *([] if k % every else other.due(values, k))])


def _bus_off(random: Random) -> Disturbance:
    return Disturbance(lambda frames, k: [] if k else [(ERROR | BUS_OFF, bytes(8))])


def _overflow(random: Random) -> Disturbance:
    gone = int(random.integers(1, 4))
    told = (ERROR | CONTROLLER, bytes([0, RX_OVERFLOW, 0, 0, 0, 0, 0, 0]))

    def disturb(frames: Sequence[Frame], k: int) -> Sequence[Frame]:
        return [told] if k == 0 else [] if k < gone else frames

    return Disturbance(disturb, counted=lambda run: run.port.lost == 1)


def _remote(random: Random) -> Disturbance:
    """Remote frames with identifiers of ours and of others, as many as there is room for."""
    known = [c.message.frame_id for c in codecs().values()]
    often = int(random.integers(1, 20))

    def disturb(frames: Sequence[Frame], k: int) -> list[Frame]:
        wanted = random.choice(known, often).tolist()
        return [*((REMOTE | i, bytes(int(random.integers(0, 9)))) for i in wanted), *frames]

    return Disturbance(disturb, counted=lambda run: run.port.remote > 0 and run.port.wrong == 0)


def _second_sender(random: Random) -> Disturbance:
    """Another node sends the same message, its counter anywhere, once in each cycle, before or after."""
    codec = _codec_of(str(random.choice((*NEEDED, "machine_ready", "operator_enable"))))
    return _also(codec, random, int(random.integers(0, LAST_COUNT + 1)), lambda data: None)


def _forged_status(random: Random) -> Disturbance:
    """The machine reports the emergency stop open; another node, one counter ahead, denies it."""
    codec, at = _field("emergency_stop")
    real = _pressed(random).frames
    forged = _also(codec, random, 1, lambda data: _set(data, at, 0)).frames
    assert real is not None  # noqa: S101
    assert forged is not None  # noqa: S101
    return Disturbance(lambda frames, k: forged(real(frames, k), k))


def _also(codec: Codec, random: Random, ahead: int, change: Callable[[bytearray], None]) -> Disturbance:
    """Each frame of a message twice: the second one changed, its counter so far ahead, its checksum right."""
    first = bool(random.integers(2))
    at = COUNTER_BITS.start // 8

    def disturb(frames: Sequence[Frame], k: int) -> list[Frame]:
        found = []
        for identifier, data in frames:
            both = [(identifier, data)]
            if identifier == codec.message.frame_id:
                other = bytearray(data)
                other[at] = other[at] & 0xF0 | ((other[at] & 0x0F) + ahead) % (LAST_COUNT + 1)
                change(other)
                other[0] = codec.checksum(other)
                both.append((identifier, bytes(other)))
            found += reversed(both) if first else both
        return found

    return Disturbance(disturb)


def _messages_of(node: str) -> list[int]:
    return [c.message.frame_id for c in codecs().values() if c.message.sender == node]


def _pressed(random: Random) -> Disturbance:
    codec, at = _field("emergency_stop")
    return _changed(codec, lambda data, k: _set(data, at, 1))


# ---- the image ----


def _nan(random: Random) -> Disturbance:
    place = INPUT.index[str(random.choice(NEEDED))]

    def twist(k: int, image: np.ndarray) -> None:
        image["value"][place] = np.nan

    return Disturbance(twist=twist)


def _nan_state(random: Random) -> Disturbance:
    """The blocks' states are at the end of the core's; what looks like a number there becomes none."""

    def spoil(state: bytes) -> bytes:
        found = np.frombuffer(state, np.float64).copy()
        blocks = found[len(found) // 2 :]
        blocks[(np.abs(blocks) > 1e-9) & (np.abs(blocks) < 1e9)] = np.nan
        return found.tobytes()

    return Disturbance(state=spoil)


def _overrun(random: Random) -> Disturbance:
    def twist(k: int, image: np.ndarray) -> None:
        image["overruns"] = k + 1

    return Disturbance(twist=twist)


MAKERS: dict[str, Callable[[Random], Disturbance]] = {
    "sensor_timeout": lambda random: _without(_codec_of(str(random.choice(NEEDED))).message.frame_id),
    "sensor_stuck": _stuck,
    "sensor_range": _raw(NEEDED, _outside),
    "sensor_error": _raw(NEEDED, lambda at, random: at.error),
    "sensor_not_available": _raw(NEEDED, lambda at, random: at.absent),
    "joystick_error": _raw(JOYSTICK, lambda at, random: at.error),
    "joystick_not_available": _raw(JOYSTICK, lambda at, random: at.absent),
    "checksum_wrong": _flipped,
    "counter_wrong": _same_count,
    "babbling_node": _babble,
    "bus_off": _bus_off,
    "other_controller": _other_controller,
    "remote_frames": _remote,
    "second_sender": _second_sender,
    "forged_status": _forged_status,
    "receive_overflow": _overflow,
    "operator_lost": lambda random: _without(*_messages_of("Operator")),
    "machine_lost": lambda random: _without(_codec_of("machine_ready").message.frame_id),
    "planner_lost": lambda random: _without(*_messages_of("Planner")),
    "emergency_stop": _pressed,
    "sensor_nan": _nan,
    "modbus_client_lost": lambda random: Disturbance(twist=LostClient(random)),
    "modbus_taken_over": lambda random: Disturbance(twist=TakenOver(random)),
    "policy_nan": _nan_state,
    "task_overrun": _overrun,
}
OF_PORTS: dict[str, Callable[..., Callable[[int, np.ndarray], None]]] = {
    **devices.MAKERS,
    "interface_client_lost": Lost,
    "interface_followed": Followed,
}
