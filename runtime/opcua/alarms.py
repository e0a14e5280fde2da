"""Alarms as events of OPC UA's AlarmConditionType: one when an alarm comes, one when it is over.

They can be seen, not acknowledged, here: that is done at the page (docs/how-to/hmi.md).
"""

from typing import Any

from asyncua import ua as types
from asyncua.server.server import Server

from runtime.hmi.alarms import Level
from runtime.interfaces.news import Line

ua: Any = types  # its declared types leave out much of what it takes

SEVERITY = {Level.CRITICAL: 900, Level.WARNING: 600, Level.NOTE: 200}


class Events:
    """Sends lines as events of the machine's object; `await build(server, machine)` first."""

    def __init__(self) -> None:
        self._alarm: Any = None
        self._plain: Any = None
        self._index = 0

    async def build(self, server: Server, machine: Any) -> None:
        """Make the generators; events come from the Server object, as clients expect, about the machine."""
        self._index = machine.nodeid.NamespaceIndex
        self._alarm = await server.get_event_generator(ua.ObjectIds.AlarmConditionType)
        self._plain = await server.get_event_generator(ua.ObjectIds.BaseEventType)
        for generator in (self._alarm, self._plain):
            generator.event.SourceNode, generator.event.SourceName = machine.nodeid, "Slewright"

    async def tell(self, line: Line) -> None:
        """An alarm that comes or goes, or something else that happened."""
        about_alarm = line.key not in ("mode", "interface")
        generator = self._alarm if about_alarm else self._plain
        event = generator.event
        event.Severity = SEVERITY[line.level]
        if about_alarm:
            self._fill(event, line)
        event.Message = ua.LocalizedText(line.text)
        await generator.trigger()

    def _fill(self, event: Any, line: Line) -> None:
        event.NodeId = ua.NodeId(f"Alarms.{line.key}", self._index)
        event.ConditionName, event.Retain = line.key, line.active
        event.ActiveState = ua.LocalizedText("Active" if line.active else "Inactive")
        setattr(event, "ActiveState/Id", line.active)
        event.EnabledState = ua.LocalizedText("Enabled")
        setattr(event, "EnabledState/Id", True)
        event.AckedState = ua.LocalizedText("Unacknowledged")
        setattr(event, "AckedState/Id", False)
