"""What is abnormal, since when and why: a list in which an alarm stays until it is gone and was acknowledged.

Alarms are told from what the control process shows, ten times a second; the same is done with a recording.
"""

import threading
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from runtime.image import INPUT, OUTPUT, Flag, Status
from specs.signals import definition, signal, signals

HISTORY = 200  # alarms that are over and kept to be looked at
HELD_S = 0.3  # an input must have been wrong for so long
SERIOUS = (Status.TIMEOUT, Status.ERROR, Status.NOT_AVAILABLE, Status.CHECKSUM, Status.RANGE, Status.STUCK)


class Level(StrEnum):
    """How urgent: critical stops the machine, warning limits it, note is to be known."""

    CRITICAL = "critical"
    WARNING = "warning"
    NOTE = "note"


@dataclass
class Alarm:
    """One occurrence; times in seconds of the day's clock (or of the recording)."""

    number: int
    key: str
    level: Level
    text: str
    cause: str
    since: float
    gone: float | None = None
    acknowledged: str = ""  # by whom
    shelved: str = ""  # by whom, why and until when: shown apart, though what it means for the machine stays

    @property
    def over(self) -> bool:
        """Whether it may leave the list."""
        return self.gone is not None and bool(self.acknowledged)


@dataclass(frozen=True)
class Condition:
    """Something abnormal, by a key of its own."""

    key: str
    level: Level
    text: str
    cause: str


FLAGS = {
    Flag.NO_REALTIME: (
        Level.WARNING,
        "No real-time priority",
        "cycles may come late: LimitRTPRIO of the service",
    ),
    Flag.NO_LOCK: (
        Level.WARNING,
        "Memory is not locked",
        "cycles may come late: LimitMEMLOCK of the service",
    ),
    Flag.STOLEN_TIME: (
        Level.WARNING,
        "Processor time was taken away",
        "by the kernel or the host of a virtual machine",
    ),
    Flag.BUS_PASSIVE: (Level.WARNING, "CAN bus error-passive", "many errors: cable, termination, bit rate"),
    Flag.BUS_OFF: (
        Level.CRITICAL,
        "CAN bus off or gone",
        "short circuit, bit rate, or its interface or process has ended",
    ),
    Flag.RECORDER_LOST: (Level.WARNING, "Recorder does not work", "ticks are not recorded"),
    Flag.MODBUS_LOST: (Level.WARNING, "Modbus server does not work", "no targets come from there"),
    Flag.RETAIN_LOST: (Level.WARNING, "Retained values are not saved", "they would be old after a power cut"),
    Flag.DISK_FULL: (Level.WARNING, "Disk full", "ticks are not recorded"),
    Flag.POLICY_LATE: (Level.WARNING, "Policy late", "its last answer was used again"),
    Flag.FORCED: (Level.NOTE, "Inputs are forced", "by the service role; see Signals"),
    Flag.OTHER_CONTROLLER: (
        Level.CRITICAL,
        "Another controller on the bus",
        "it sends commands with this one's identifiers: switch one of them off",
    ),
}
FAULTS = {
    "sensor_timeout": "A sensor was lost",
    "sensor_range": "A sensor is out of its range",
    "sensor_checksum": "A sensor's messages are damaged",
    "sensor_error": "A sensor reports an error",
    "sensor_stuck": "A sensor is stuck",
    "target_timeout": "Whoever writes targets was lost",
    "policy_timeout": "The policy outside was lost, or its commands are stale",
    "target_out_of_reach": "The target is out of reach",
    "machine_not_ready": "The machine is not ready",
    "machine_timeout": "The machine's messages stopped",
    "machine_fault": "The machine reports a fault",
    "operator_timeout": "The operator's panel was lost",
    "task_overrun": "The control cycle was too late three times",
    "controller_failed": "The controller gave no number",
    "emergency_stop": "Emergency stop",
    "bus_off": "CAN bus off",
    "keep_out": "Keep-out",
    "other_controller": "Another controller sends on the bus",
    "two_senders": "Two senders of one message",
    "configuration": "Configuration",
}
MACHINE_FAULTS = {
    "command_timeout": "Machine: commands stopped, valves centred",
    "emergency_stop": "Machine: emergency stop is open",
    "low_supply": "Machine: pilot supply pressure is low",
    "oil_temperature": "Machine: oil temperature",
    "sensor_failed": "Machine: a sensor failed",
    "brake_failed": "Machine: slew brake failed",
}
HOW_OUT = "latched: left by the enabling switch, pressed anew when the cause is gone and the joystick at rest"
BY_VR = {s.vr: s for s in signals().values()}
FAULT, FAULT_SIGNAL, MODE = (OUTPUT.index[n] for n in ("fault_code", "fault_signal", "control_mode"))
STOP, MACHINE_FAULT = INPUT.index["emergency_stop"], INPUT.index["machine_fault"]
FAULT_TEXTS, MODE_TEXTS = signal("fault_code").values, signal("control_mode").values


def conditions(inputs: np.void, outputs: np.void) -> Iterator[Condition]:
    """All that is abnormal in a pair of images."""
    yield from _fault(outputs)
    if inputs["status"][STOP] == Status.OK and inputs["value"][STOP] > 0.5:
        yield Condition(
            "emergency_stop", Level.CRITICAL, "Emergency stop is open", "hard-wired; it acts by itself"
        )
    code = int(inputs["value"][MACHINE_FAULT])
    if inputs["status"][MACHINE_FAULT] == Status.OK and code:
        name = signal("machine_fault").values.get(code, str(code))
        yield Condition(
            f"machine:{code}",
            Level.CRITICAL,
            MACHINE_FAULTS.get(name, f"Machine: {name}"),
            "reported by the machine",
        )
    flags = int(outputs["flags"])
    for flag, (level, text, cause) in FLAGS.items():
        if flags & flag:
            yield Condition(f"flag:{flag.value}", level, text, cause)


def wrong_inputs(inputs: np.void) -> Iterator[Condition]:
    """Inputs that are not as they should be, a message at a time."""
    bad: dict[tuple[str, int], list[str]] = {}
    for place in np.flatnonzero(np.isin(inputs["status"], SERIOUS)):
        s = INPUT.signals[place]
        if s.can:
            bad.setdefault((s.can.message, int(inputs["status"][place])), []).append(s.name)
    for (message, status), names in bad.items():
        what = Status(status).name.lower().replace("_", " ")
        about = definition().bus.messages[message].description
        shown = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
        two = status == Status.TWO_SENDERS
        level, text = Level.CRITICAL if two else Level.WARNING, f"{message}: {what}"
        yield Condition(f"input:{message}:{status}", level, text, f"{about}: {shown}")


def _fault(outputs: np.void) -> Iterator[Condition]:
    code = int(outputs["value"][FAULT])
    if not code:
        return
    name = FAULT_TEXTS.get(code, str(code))
    latched = MODE_TEXTS.get(int(outputs["value"][MODE])) == "fault"
    about = BY_VR.get(int(outputs["value"][FAULT_SIGNAL]))
    parts = [f"{about.name}: {about.description}"] if about else []
    parts += [HOW_OUT] if latched else []
    text = FAULTS.get(name, name)
    if name == "two_senders" and about and about.can:
        text = f"Two senders of {about.can.message}"
    level = Level.CRITICAL if latched else Level.WARNING
    key = f"fault:{name}:{about.name if about else ''}"
    yield Condition(key, level, text, "; ".join(parts))


class Alarms:
    """The list; `version` grows with every change.  One thread updates it, others acknowledge."""

    def __init__(self, history: int = HISTORY) -> None:
        self.version = 0
        self._lock = threading.RLock()
        self.present: dict[str, Alarm] = {}
        self.history: deque[Alarm] = deque(maxlen=history)
        self._waiting: list[Alarm] = []  # gone, but not acknowledged
        self._first_wrong: dict[str, float] = {}
        self._shelf: dict[str, tuple[float, str]] = {}  # by key: until when [s], what is said of it
        self._count = 0

    def update(
        self, found: list[Condition], wrong: list[Condition], now: float, day: float | None = None
    ) -> None:
        """What is abnormal at `now` [s], on a clock that is never set; `wrong` counts when it has lasted.

        `day` is the same moment on the day's clock, for people only; without it `now` is shown.
        """
        day = now if day is None else day
        with self._lock:
            self._take_from_shelf(now)
            self._first_wrong = {c.key: self._first_wrong.get(c.key, now) for c in wrong}
            held = [c for c in wrong if now - self._first_wrong[c.key] >= HELD_S]
            there = {c.key: c for c in (*found, *held)}
            for key in [k for k in self.present if k not in there]:
                self._leave(self.present.pop(key), day)
            for key, condition in there.items():
                if key not in self.present:
                    self._raise(condition, day)

    def unseen(self, number: int | None) -> list[Alarm]:
        """Those that nobody acknowledged: all (None), or the one of this number."""
        return [a for a in self.listed() if not a.acknowledged and number in (None, a.number)]

    def acknowledge(self, number: int | None, who: str) -> list[Alarm]:
        """Mark one alarm, or all (None), as seen; those that were not before."""
        with self._lock:
            fresh = self.unseen(number)
            for alarm in fresh:
                alarm.acknowledged = who
            for alarm in [a for a in self._waiting if a.over]:
                self._waiting.remove(alarm)
                self.history.append(alarm)
            self.version += bool(fresh)
            return fresh

    def acknowledge_key(self, key: str, who: str) -> list[Alarm]:
        """Mark the alarm of this key as seen, if there is one that was not."""
        return [
            a for alarm in self.unseen(None) if alarm.key == key for a in self.acknowledge(alarm.number, who)
        ]

    def shelve(self, number: int, until: float, said: str) -> None:
        """Put an alarm aside until then [s, the clock of `update`]; ValueError if it is not one to put aside.

        Also if it goes and comes again meanwhile.  What stops the machine is never put aside.
        """
        with self._lock:
            alarm = self.shelvable(number)
            self._shelf[alarm.key] = until, said
            alarm.shelved = said
            self.version += 1

    def unshelve(self, number: int) -> None:
        """Show an alarm as any other again; ValueError if it is not shelved."""
        with self._lock:
            self._show_again([self.on_shelf(number).key])

    def shelvable(self, number: int) -> Alarm:
        """The alarm of this number; ValueError if it may not be put aside."""
        with self._lock:
            alarm = next((a for a in self.present.values() if a.number == number), None)
        if alarm is None:
            raise ValueError("this alarm is not present")
        if alarm.level == Level.CRITICAL or alarm.key.startswith("fault:"):
            raise ValueError("what stops the machine cannot be shelved")
        return alarm

    def on_shelf(self, number: int) -> Alarm:
        """The shelved alarm of this number; ValueError if there is none."""
        alarm = next((a for a in self.listed() if a.number == number and a.shelved), None)
        if alarm is None:
            raise ValueError("this alarm is not shelved")
        return alarm

    def _take_from_shelf(self, now: float) -> None:
        over = [key for key, (until, _) in self._shelf.items() if now >= until]
        if over:
            self._show_again(over)

    def _show_again(self, keys: list[str]) -> None:
        for key in keys:
            del self._shelf[key]
        for alarm in [a for a in (*self.present.values(), *self._waiting) if a.key in keys]:
            alarm.shelved = ""
        self.version += 1

    def listed(self) -> list[Alarm]:
        """What is there or was not acknowledged: the most urgent first, then the newest, causes first."""
        order = list(Level)
        with self._lock:
            found = [*self.present.values(), *self._waiting]
        return sorted(
            found,
            key=lambda a: (a.gone is not None, bool(a.shelved), order.index(a.level), -a.since, a.number),
        )

    def _raise(self, condition: Condition, day: float) -> None:
        again = next((a for a in self._waiting if a.key == condition.key), None)
        if again:  # a contact that rattles is one alarm
            self._waiting.remove(again)
            again.gone, again.since = None, day
            self.present[condition.key] = again
        else:
            self._count += 1
            self.present[condition.key] = Alarm(
                self._count, condition.key, condition.level, condition.text, condition.cause, day
            )
        self.present[condition.key].shelved = self._shelf.get(condition.key, (0.0, ""))[1]
        self.version += 1

    def _leave(self, alarm: Alarm, day: float) -> None:
        alarm.gone = day
        if alarm.over:
            self.history.append(alarm)
        else:
            self._waiting.append(alarm)
        self.version += 1
