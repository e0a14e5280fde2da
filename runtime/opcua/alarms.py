"""Alarms as events of OPC UA's AlarmConditionType: one when an alarm comes, is over, or is acknowledged.

A client whose certificate has the role of an operator acknowledges (OPC 10000-9, 5.7.3): the method
Acknowledge of AcknowledgeableConditionType on the condition's node, with the newest event's id.  The page's
list and the audit log have it then, too (runtime/interfaces/told.py).
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from typing import Any

from asyncua import ua as types
from asyncua.server.server import Server

from runtime.hmi.alarms import Level
from runtime.interfaces.news import Line
from runtime.opcua.sessions import client_of

ua: Any = types  # its declared types leave out much of what it takes

SEVERITY = {Level.CRITICAL: 900, Level.WARNING: 600, Level.NOTE: 200}
CODES = ua.StatusCodes
KEPT = 500  # conditions that are remembered; those that are over and acknowledged go first
COMMENT = 80  # letters


@dataclass
class Condition:
    """An alarm as the clients know it."""

    line: Line
    event: bytes = b""  # id of its newest event
    acknowledged: bool = False

    @property
    def retained(self) -> bool:
        """Whether it is of interest still."""
        return self.line.active or not self.acknowledged


class Events:
    """Sends lines as events of the machine's object; `await build(server, machine)` first."""

    def __init__(self, refuse: Callable[[str], None], done: Callable[[str, str, str], None]) -> None:
        """`refuse` is told who may not acknowledge; `done` (key, who, text) what was acknowledged."""
        self._refuse, self._done = refuse, done
        self._alarm: Any = None
        self._plain: Any = None
        self._index = 0
        self._conditions: dict[str, Condition] = {}

    async def build(self, server: Server, machine: Any) -> None:
        """Make the generators; events come from the Server object, as clients expect, about the machine."""
        self._index = machine.nodeid.NamespaceIndex
        self._alarm = await server.get_event_generator(ua.ObjectIds.AlarmConditionType)
        self._plain = await server.get_event_generator(ua.ObjectIds.BaseEventType)
        for generator in (self._alarm, self._plain):
            generator.event.SourceNode, generator.event.SourceName = machine.nodeid, "Slewright"

    async def tell(self, line: Line) -> None:
        """An alarm that comes or goes, or something else that happened."""
        if line.key in ("mode", "interface"):
            await self._trigger(self._plain, line)
            return
        known = self._conditions.get(line.key)
        again = line.active or known is None  # it has come anew, and was not acknowledged yet
        self._conditions[line.key] = Condition(line, acknowledged=not again and known.acknowledged)  # type: ignore[union-attr]
        self._forget()
        await self._show(self._conditions[line.key])

    async def acknowledge(self, session: Any, request: Any) -> int:
        """A client's call of the method; the code of its answer."""
        who = client_of(session)
        condition, event, comment = self._asked(request)
        if not getattr(session.user, "acknowledges", False):
            self._refuse(f"{who} was refused Acknowledge: its role is not that of an operator")
            return CODES.BadUserAccessDenied
        if condition is None:
            return CODES.BadNodeIdUnknown
        if event != condition.event:
            return CODES.BadEventIdUnknown
        if condition.acknowledged:
            return CODES.BadConditionBranchAlreadyAcked
        condition.acknowledged = True
        said = f" ({comment})" if comment else ""  # before the alarm's own text, whose end may be cut off
        self._done(condition.line.key, who, f"{who} acknowledged{said}: {condition.line.text}")
        await self._show(condition)
        return CODES.Good

    def _asked(self, request: Any) -> tuple[Condition | None, bytes, str]:
        """Condition, event id and comment of a call; no condition if it is none of ours."""
        name = str(request.ObjectId.Identifier)
        ours = request.ObjectId.NamespaceIndex == self._index and name.startswith("Alarms.")
        condition = self._conditions.get(name.removeprefix("Alarms.")) if ours else None
        given = [v.Value for v in request.InputArguments]
        event = given[0] if given and isinstance(given[0], bytes) else b""
        comment = getattr(given[1], "Text", None) if len(given) > 1 else ""
        return condition, event, str(comment or "")[:COMMENT]

    def _forget(self) -> None:
        over = [key for key, c in self._conditions.items() if not c.retained]
        while len(self._conditions) > KEPT and over:
            del self._conditions[over.pop(0)]
        while len(self._conditions) > KEPT:
            del self._conditions[next(iter(self._conditions))]

    async def _show(self, condition: Condition) -> None:
        # another object each time: the server keeps it for a client that asks for a refresh
        event, line = copy(self._alarm.event), condition.line
        self._alarm.event = event
        event.NodeId = ua.NodeId(f"Alarms.{line.key}", self._index)
        event.ConditionName, event.Retain = line.key, condition.retained
        event.ActiveState = ua.LocalizedText("Active" if line.active else "Inactive")
        setattr(event, "ActiveState/Id", line.active)
        event.EnabledState = ua.LocalizedText("Enabled")
        setattr(event, "EnabledState/Id", True)
        event.AckedState = ua.LocalizedText("Acknowledged" if condition.acknowledged else "Unacknowledged")
        setattr(event, "AckedState/Id", condition.acknowledged)
        await self._trigger(self._alarm, line)
        condition.event = event.EventId.Value

    async def _trigger(self, generator: Any, line: Line) -> None:
        generator.event.Severity = SEVERITY[line.level]
        generator.event.Message = ua.LocalizedText(line.text)
        await generator.trigger()
