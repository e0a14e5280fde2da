"""The faults of CANopen devices, as table.py has those of all others."""

from deployment.faults.table import (
    AGAIN_MS,
    DEBOUNCE_MS,
    SENSOR_MS,
    SHOWN_FAULT_MS,
    TICK_MS,
    Fault,
    stops,
)
from specs.canopen import definition

LOST_MS = float(definition().bus.lost_ms)
DOUBTED_MS = 16 * TICK_MS  # runtime/core/canopen.c
ANSWER_MS = 2 * TICK_MS  # of devices to SYNC, and until that is taken
CANOPEN = (
    stops("canopen_sensor_lost", "an encoder falls silent, PDOs and heartbeat", SENSOR_MS, "sensor_timeout"),
    stops(
        "canopen_valve_lost",
        "a valve falls silent",
        LOST_MS,
        "machine_not_ready",
    ),
    stops(
        "canopen_heartbeat_lost",
        "an encoder's heartbeat stops, its PDOs go on",
        LOST_MS,
        "sensor_timeout",
    ),
    stops(
        "canopen_restarted",
        "an encoder starts anew and goes on by itself, set up by nobody",
        TICK_MS,
        "sensor_timeout",
    ),
    stops(
        "canopen_emergency",
        "an encoder or a valve sends an emergency (EMCY)",
        DEBOUNCE_MS,
        *("sensor_error", "machine_not_ready"),
    ),
    stops("canopen_short_pdo", "an encoder's PDOs are too short", SENSOR_MS, "sensor_timeout"),
    stops("canopen_second_sender", "another node sends an encoder's PDO, too", DOUBTED_MS, "two_senders"),
    stops("canopen_bus_off", "the controller goes off the devices' bus", TICK_MS, "bus_off"),
    stops("canopen_other_master", "another node sends SYNC or a command", TICK_MS, "other_controller"),
    Fault(
        "canopen_eds_mismatch",
        "a maker's EDS lacks an object, or has it otherwise",
        "refused at the start, the object named",
        0.0,
        "inside",
    ),
    stops(
        "canopen_unplugged",
        "an encoder is switched off (real bus, real master)",
        SENSOR_MS + ANSWER_MS + SHOWN_FAULT_MS,
        "sensor_timeout",
        level="process",
    ),
    Fault(
        "canopen_wrong_identity",
        "another device is there in an encoder's place",
        "refused, the reason said; the right one is set up again",
        0.0,
        "process",
    ),
    Fault(
        "canopen_killed",
        "the process of CANopen is killed",
        "started again; devices left alone; automatic goes on",
        AGAIN_MS,
        "process",
    ),
)
