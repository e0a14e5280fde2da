"""The live side: reads what the control process shows, keeps trends and alarms, feeds the stream."""

import time
from dataclasses import replace
from typing import Any

import numpy as np

from runtime.hmi import frames
from runtime.hmi.alarms import Alarm, Alarms, Condition, Level, conditions, wrong_inputs
from runtime.hmi.around import Around
from runtime.hmi.audit import Audit
from runtime.hmi.cells import GRANT, SEEN, state_of
from runtime.hmi.desk import Desk
from runtime.hmi.hub import Hub
from runtime.hmi.ladder import ladder
from runtime.hmi.outsiders import Outsiders
from runtime.hmi.planners import Planners
from runtime.hmi.trends import Trends
from runtime.image import OUTPUT, Flag
from runtime.modbus.port import PERIOD_NS
from runtime.shared import Cell

STALE_NS = 25 * PERIOD_NS  # as on Modbus: then nothing that is shown is true any longer
MODE = OUTPUT.index["control_mode"]
WORK_EVERY_NS = 1_000_000_000
START_NS = 60_000_000_000  # that the control process may take to start
GONE = Condition(
    "gone",
    Level.CRITICAL,
    "The control process does not publish",
    "it has ended or hangs; the valves are neutral by the machine's own timeout",
)
BUS_OFF = f"flag:{Flag.BUS_OFF.value}"
NO_AUDIT = Condition(
    "audit",
    Level.WARNING,
    "The audit log cannot be written",
    "disk full or not writable; nothing can be changed from the page",
)


class Watch:
    """What all routes share; `look` is to be called often, by one thread."""

    def __init__(
        self,
        cells: tuple[Cell, Cell, Cell],
        audit: Audit,
        hub: Hub,
        planners: Planners | None = None,
        bus_again: str = "",
        outsiders: Outsiders | None = None,
        around: Around | None = None,
    ) -> None:
        """`bus_again`: what it takes to use a CAN bus again that was gone (runtime/can/port.py).

        `around`: what the bundle's guard keeps off.
        """
        self._seen, self._grant, self._asked = cells
        self.audit, self.hub, self.planners = audit, hub, planners
        self._outsiders, self.around = outsiders, around
        self.trends, self.alarms = Trends(), Alarms()
        self.newest: np.void | None = None
        self.desk: Desk | None = None
        self._number = self._version = -1
        self._overruns = -1
        self._worked_ns = 0
        self._stale = self._bus_off = False
        self._bus_again = bus_again
        self._begun_ns = time.monotonic_ns()

    def granted(self) -> np.void:
        """What the control process has granted."""
        found = state_of(self._grant, GRANT)
        return np.zeros(1, GRANT)[0] if found is None else found

    def mode(self) -> int:
        """The controller's mode; -1 if it is not known."""
        if self.newest is None or self._stale:
            return -1
        return int(self.newest["outputs"]["value"][MODE])

    def look(self, now: int) -> None:
        """Take what is new at `now` [ns]."""
        if self._seen.number != self._number and (found := self._seen.read()):
            self._number = found[0]
            newest: np.void = np.frombuffer(found[1], SEEN)[0]
            self.newest = newest
            self._take(newest, now)
        self._stale = self.newest is None or now - int(self.newest["stamp_ns"]) > STALE_NS
        if self._stale:
            if self.newest is not None or now - self._begun_ns > START_NS:  # it is started after this process
                self._update([GONE], [], now, time.time())
            self.hub.put("stale", {"t": round(time.time(), 3)})
        if self._outsiders:
            self._outsiders.look(now)
            while self._outsiders.acknowledged:
                self.alarms.acknowledge_key(*self._outsiders.acknowledged.pop(0))
        if self.planners and self.planners.look(now):
            shown = {k: v for k, v in self.planners.state.items() if k != "events"}
            self.hub.put("modbus", shown | {"last": self.planners.last})
        if self.alarms.version != self._version:
            self._version = self.alarms.version
            self.hub.put("alarms", listed(self.alarms))

    def _take(self, newest: np.void, now: int) -> None:
        inputs, outputs, when = newest["inputs"], newest["outputs"], int(newest["day_ns"]) / 1e9
        values = frames.values(inputs, outputs)
        self.trends.add(when, values, now / 1e9)
        self._note_bus(bool(int(outputs["flags"]) & Flag.BUS_OFF))
        found = [self._with_cause(c) for c in conditions(inputs, outputs)]
        self._update(found, list(wrong_inputs(inputs)), now, when)
        shown = frames.frame(when, inputs, outputs)
        rungs = ladder(newest["ladder"], int(outputs["value"][MODE]))
        if self.around:
            shown["near"] = self.around.near(values)
        self.hub.put("frame", {**shown, "writer": int(newest["writer"]), "ladder": rungs, **self._control()})
        if now - self._worked_ns >= WORK_EVERY_NS:
            self._worked_ns = now
            self.hub.put("work", {"t": when, **frames.work(newest["work"])})

    def _note_bus(self, off: bool) -> None:
        """In the audit log: that the CAN bus is gone, and that it is back."""
        if off == self._bus_off:
            return
        self._bus_off = off
        what = "the CAN bus is gone or off" if off else "the CAN bus is back"
        try:
            self.audit.write("slewright", "runtime", "this computer", what, result="told")
        except OSError:
            return  # the log says so itself

    def _with_cause(self, condition: Condition) -> Condition:
        """A lost writer's alarm says what happened to it, that of the bus what it takes to use it again."""
        if condition.key == BUS_OFF:
            return replace(condition, cause=f"{condition.cause}; {self._bus_again}".rstrip("; "))
        if not condition.key.startswith("fault:target_timeout") or not (self.planners and self.planners.last):
            return condition
        return replace(condition, cause=f"Modbus: {self.planners.last}; {condition.cause}")

    def _control(self) -> dict[str, Any]:
        if self.desk is None:
            return {}
        writer, forcer = self.desk.writer, self.desk.forcer
        return {
            "by": f"{writer.session.name} ({writer.session.role})" if writer else "",
            "asked": self.desk.target(),
            "forced_by": f"{forcer.session.name} ({forcer.session.role})" if forcer else "",
        }

    def _update(self, found: list[Condition], wrong: list[Condition], now: int, day: float) -> None:
        told = self.planners.conditions() if self.planners else []
        told = [*told, *(self._outsiders.conditions() if self._outsiders else [])]
        self.alarms.update([*found, *told, *[NO_AUDIT] * self.audit.failed], wrong, now / 1e9, day)


def listed(alarms: Alarms) -> dict[str, Any]:
    """The list and what is over, as the page shows it."""
    past = [plain(a) for a in list(alarms.history)[-50:]]
    return {"list": [plain(a) for a in alarms.listed()], "past": past[::-1]}


def plain(alarm: Alarm) -> dict[str, Any]:
    """An alarm in plain data."""
    return {
        "number": alarm.number,
        "level": alarm.level.value,
        "text": alarm.text,
        "cause": alarm.cause,
        "since": round(alarm.since, 3),
        "gone": None if alarm.gone is None else round(alarm.gone, 3),
        "acknowledged": alarm.acknowledged,
        "shelved": alarm.shelved,
    }
