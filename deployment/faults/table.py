"""The faults: what is injected, what must come of it, and within which time."""

from dataclasses import dataclass, field
from typing import Any

from runtime.image import TICK_S, timeout_ticks
from specs.parameters import load
from specs.signals import definition, signal

TICK_MS = 1000.0 * TICK_S
_gate = {name: p.value for name, p in load("gate").items()}
RAMP_MS = TICK_MS * -(-1.0 // (_gate["gate_fall"] * TICK_S))  # full stroke to neutral
DEBOUNCE_MS = 1000.0 * _gate["input_debounce"]
STUCK_MS = 1000.0 * _gate["input_stuck"]
OVERRUNS_MS = TICK_MS * _gate["overruns_allowed"]
# A CRC-8 misses one in 256 frames with three flipped bits (its Hamming distance is 3): then bridging begins
# anew.
MISSED_FRAME_MS = DEBOUNCE_MS + TICK_MS
SENSOR_MS = TICK_MS * timeout_ticks(signal("q_slew"))
PLANNER_MS = TICK_MS * timeout_ticks(signal("planner_heartbeat"))
MACHINE_MS = TICK_MS * timeout_ticks(signal("machine_ready"))
MACHINE_CYCLE_MS = float(definition().bus.messages["MachineStatus"].cycle_ms)
# Of the plant: commands of 100 ms age count as lost, seen in its next period; one period of the kill itself.
COMMAND_MS = TICK_MS * (timeout_ticks(signal("u_slew")) + 2)
# Of a real client, seen on the machine's bus: mode and fault come with the next ControllerStatus; a period of
# each side's cycle.
SHOWN_FAULT_MS = definition().bus.messages["ControllerStatus"].cycle_ms + 2 * TICK_MS
SEEN_MS = 1100.0  # a helper's absence shows within a second
SHOWN_MS = (
    SEEN_MS + definition().bus.messages["ControllerDetail"].cycle_ms
)  # and on the bus in its next message


AGAIN_MS = (
    2000.0  # a process that ended is started again: its supervisor looks every 0.1 s, and waits 1 s at most
)
# Of two senders: the third counter that cannot be, and the doubt that right frames took away meanwhile.
DOUBTED_MS = 4 * MACHINE_CYCLE_MS


@dataclass(frozen=True)
class Fault:
    """`limit_ms`: from the fault's first tick to the reaction, which is neutral commands or as said."""

    name: str
    what: str
    reaction: str
    limit_ms: float
    level: str = "bus"  # bus, image, inside, fmu, process
    codes: tuple[str, ...] = ()  # one of these fault codes must be latched
    named: str = ""  # and this one be shown in the end


def stops(name: str, what: str, ms: float, *codes: str, level: str = "bus", named: str = "") -> Fault:
    """A fault that must latch FAULT and bring all commands to neutral `ms` and the ramp after it."""
    reaction = f"FAULT ({' or '.join(codes)}), commands neutral"
    return Fault(name, what, reaction, ms + TICK_MS + RAMP_MS, level, codes, named)


BUS = (
    stops("sensor_timeout", "a sensor message stops", SENSOR_MS, "sensor_timeout"),
    stops("sensor_stuck", "a sensor repeats its value for ever", STUCK_MS, "sensor_stuck"),
    stops("sensor_range", "a sensor value outside its range", DEBOUNCE_MS, "sensor_range"),
    stops("sensor_error", "a sensor says error (0xFE..)", DEBOUNCE_MS, "sensor_error"),
    stops("sensor_not_available", "a sensor says not available (0xFF..)", DEBOUNCE_MS, "sensor_error"),
    stops("joystick_error", "a joystick axis says error", DEBOUNCE_MS, "operator_timeout"),
    stops("joystick_not_available", "a joystick axis says not available", DEBOUNCE_MS, "operator_timeout"),
    stops(
        "checksum_wrong",
        "bits of a sensor message flip",
        SENSOR_MS + MISSED_FRAME_MS,
        "sensor_checksum",
        "sensor_timeout",
    ),
    stops(
        "counter_wrong",
        "a sensor message repeats its counter",
        SENSOR_MS,
        "sensor_checksum",
        "sensor_timeout",
    ),
    stops(
        "babbling_node",
        "a node fills the bus with the lowest identifier",
        SENSOR_MS,
        *("operator_timeout", "machine_timeout", "sensor_timeout"),
    ),
    stops("bus_off", "the controller's CAN controller goes off the bus", 0.0, "bus_off"),
    stops("other_controller", "somebody else sends the controller's commands", 0.0, "other_controller"),
    Fault(
        "remote_frames",
        "remote frames of any identifier",
        "counted, else ignored; automatic goes on",
        TICK_MS,
    ),
    stops(
        "second_sender",
        "another node sends the same message, any counter",
        DOUBTED_MS,
        *("two_senders", "machine_timeout"),
        named="two_senders",
    ),
    stops(
        "forged_status",
        "another node denies an open emergency stop",
        DOUBTED_MS,
        *("two_senders", "emergency_stop", "machine_timeout"),
    ),
    Fault(
        "receive_overflow",
        "frames of up to 60 ms are lost in the receive queue",
        "bridged and counted; automatic goes on",
        TICK_MS,
    ),
    stops("operator_lost", "the operator's message stops", SENSOR_MS, "operator_timeout"),
    stops("machine_lost", "the machine's status stops", MACHINE_MS, "machine_timeout"),
    stops("planner_lost", "the planner's messages stop (CAN)", PLANNER_MS, "target_timeout"),
    stops("emergency_stop", "the emergency stop is pressed", MACHINE_CYCLE_MS, "emergency_stop"),
)
IMAGE = (
    stops("sensor_nan", "a sensor value is NaN", DEBOUNCE_MS, "sensor_range", level="image"),
    stops(
        "modbus_client_lost",
        "the client's heartbeat stops, or its connection ends",
        PLANNER_MS,
        "target_timeout",
        level="image",
    ),
    stops(
        "modbus_taken_over",
        "another peer takes over with the writer's number, and commits at once",
        0.0,
        "target_timeout",
        level="image",
    ),
    stops(
        "interface_client_lost",
        "a client of OPC UA or ROS 2 gives no sign of life, or its session ends",
        PLANNER_MS,
        "target_timeout",
        level="image",
    ),
    stops(
        "interface_followed",
        "such a client leaves, and another one asks at once and goes on",
        0.0,
        "target_timeout",
        level="image",
    ),
    stops(
        "policy_nan", "the controller's state becomes NaN", 4 * TICK_MS, "controller_failed", level="image"
    ),
    stops("task_overrun", "every cycle ends too late", OVERRUNS_MS, "task_overrun", level="image"),
)
INSIDE = (
    Fault(
        "policy_overrun",
        "a policy tick computes for 25 ms",
        "counted; next tick late, phase kept",
        2 * TICK_MS,
        "inside",
    ),
    Fault("clock_step", "the time of day jumps by up to a year", "nothing changes", 0.0, "inside"),
    Fault(
        "disk_full",
        "the recorder's disk refuses writes",
        "flag disk full; no tick touched",
        SEEN_MS,
        "inside",
    ),
    Fault(
        "slow_fsync",
        "the recorder's disk hangs for 2 to 8 s",
        "flag recorder lost; no tick lost",
        SEEN_MS,
        "inside",
    ),
    Fault("policy_wrong_shape", "a policy of other shapes", "refused at the start", 0.0, "inside"),
    Fault(
        "modbus_nonsense", "a client writes nonsense, commits it", "refused, or within ranges", 0.0, "inside"
    ),
    Fault(
        "modbus_word_order",
        "a target's registers in the wrong order",
        "refused, or another value, never near 0",
        0.0,
        "inside",
    ),
    Fault("modbus_commit", "a commit of 0, or of the last number anew", "refused", 0.0, "inside"),
    Fault(
        "modbus_guessing", "others try the writer's number", "busy, none of their writes done", 0.0, "inside"
    ),
    Fault(
        "interface_second_client",
        "others ask over OPC UA and ROS 2 while one commands",
        "refused; its target stays",
        0.0,
        "inside",
    ),
    Fault("interface_nonsense", "a client asks for what is out of range", "refused whole", 0.0, "inside"),
    Fault(
        "interface_stale", "an interface's process hangs, goes on later", "its claim is over", 0.0, "inside"
    ),
    Fault("idle_places", "connections that do nothing take all places", "they make room", 0.0, "inside"),
    Fault(
        "power_cut",
        "power goes at a random write, sync or rename",
        "last or last but one values",
        0.0,
        "inside",
    ),
    Fault("bundle_changed", "a byte of a bundle's file changes", "refused at the start", 0.0, "inside"),
)
PROCESS = (
    Fault(
        "control_killed",
        "the control process is killed",
        "plant side neutral by timeout",
        COMMAND_MS,
        "process",
    ),
    stops(
        "modbus_client_gone",
        "the client's process dies (real server)",
        PLANNER_MS + SHOWN_FAULT_MS,
        "target_timeout",
        level="process",
    ),
    Fault(
        "modbus_reading_flood",
        "2,000 reads in one go beside a writer",
        "automatic goes on",
        0.0,
        "process",
    ),
    Fault(
        "modbus_second_writer",
        "a second client claims with the writer's number, and writes",
        "busy; automatic goes on",
        0.0,
        "process",
    ),
    Fault(
        "modbus_idle_connections",
        "twice as many idle connections as places",
        "automatic goes on; another client is answered",
        0.0,
        "process",
    ),
    Fault("modbus_flooding", "20 clients flat out", "no overrun, mode unchanged", 0.0, "process"),
    Fault(
        "recorder_killed", "the recorder is killed", "flag recorder lost, started again", SHOWN_MS, "process"
    ),
    Fault(
        "modbus_killed",
        "the Modbus process is killed",
        "flag Modbus lost, started again",
        SHOWN_MS,
        "process",
    ),
    Fault(
        "opcua_half_open",
        "60 OPC UA connections that say nothing",
        "automatic goes on; another client is answered",
        0.0,
        "process",
    ),
    Fault(
        "opcua_storm",
        "60 OPC UA clients that come and go",
        "automatic goes on; another client is answered",
        0.0,
        "process",
    ),
    Fault(
        "opcua_malformed",
        "malformed OPC UA messages",
        "automatic goes on; another client is answered",
        0.0,
        "process",
    ),
    Fault(
        "foxglove_slow_reader",
        "5 viewers that ask for everything and read nothing",
        "automatic goes on; another viewer is served",
        0.0,
        "process",
    ),
    Fault(
        "foxglove_malformed",
        "malformed WebSocket frames",
        "automatic goes on; another viewer is served",
        0.0,
        "process",
    ),
    Fault(
        "ros2_flood",
        "2,000 ROS 2 targets in one go beside a planner",
        "refused; automatic goes on",
        0.0,
        "process",
    ),
    Fault(
        "ros2_second_writer",
        "a ROS 2 publisher asks while a planner commands",
        "refused; automatic goes on",
        0.0,
        "process",
    ),
    Fault("ros2_stale", "ROS 2 targets with stamps of 5 s ago", "refused; automatic goes on", 0.0, "process"),
    Fault(
        "ros2_wrong_type", "a ROS 2 publisher of another type", "refused; automatic goes on", 0.0, "process"
    ),
    Fault(
        "foxglove_killed",
        "the process of Foxglove is killed",
        "started again; automatic goes on",
        AGAIN_MS,
        "process",
    ),
    Fault(
        "opcua_killed",
        "the process of OPC UA is killed",
        "started again; automatic goes on",
        AGAIN_MS,
        "process",
    ),
    Fault(
        "ros2_killed",
        "the process of ROS 2 is killed",
        "started again; automatic goes on",
        AGAIN_MS,
        "process",
    ),
)


@dataclass
class Outcome:
    """What `injected` faults of one kind came to."""

    fault: Fault
    injected: int = 0
    caught: int = 0
    worst_ms: float = 0.0
    missed: list[str] = field(default_factory=list)

    def add(self, tick: int, ms: float | None, why: str = "") -> None:
        """One injection; `ms` is None if the reaction did not come."""
        self.injected += 1
        if ms is not None:
            self.worst_ms = max(self.worst_ms, ms)
        if ms is not None and ms <= self.fault.limit_ms and not why:
            self.caught += 1
        else:
            self.missed.append(f"tick {tick}: {why or (f'{ms:.0f} ms' if ms is not None else 'no reaction')}")

    def figures(self) -> dict[str, Any]:
        """As `slewright faults --json` writes it."""
        return {
            "injected": self.injected,
            "caught": self.caught,
            "worst_reaction_ms": self.worst_ms,
            "limit_ms": self.fault.limit_ms,
            "reaction": self.fault.reaction,
            "missed": self.missed[:5],
        }
