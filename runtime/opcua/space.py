"""The address space, made from the signals, and what keeps it up to date.

    Objects / Slewright / Commands, Targets, Sensors, Status / SIGNAL     (specs/opcua.py has the identifiers)

A number is an AnalogUnitRangeType with range and unit, an enumeration a MultiStateValueDiscreteType with its
texts.  A value's status code tells how good it is; its source time is when its message came.
"""

from datetime import UTC, datetime
from typing import Any

from asyncua import ua as types
from asyncua.server.server import Server

from runtime.image import Status
from runtime.interfaces.view import SIGNALS, Seen
from specs.opcua import FOLDERS, METHODS, NAMESPACE, UNECE, UNECE_URI, Method, is_whole, node, unit_id
from specs.signals import Signal, signal

ua: Any = types  # its declared types leave out much of what it takes

CODES = ua.StatusCodes
QUALITY = {
    Status.OK: CODES.Good,
    Status.NEVER: CODES.BadWaitingForInitialData,
    Status.TIMEOUT: CODES.BadNoCommunication,
    Status.ERROR: CODES.BadSensorFailure,
    Status.NOT_AVAILABLE: CODES.BadNoDataAvailable,
    Status.CHECKSUM: CODES.UncertainLastUsableValue,
    Status.RANGE: CODES.UncertainEngineeringUnitsExceeded,
    Status.STUCK: CODES.UncertainSensorNotAccurate,
    Status.FORCED: CODES.GoodLocalOverride,
    Status.TWO_SENDERS: CODES.BadCommunicationError,
}
LOST = CODES.BadCommunicationError  # of everything, when the control process no longer publishes


class Space:
    """The nodes; `await build(server)` first."""

    def __init__(self) -> None:
        self.machine: Any = None
        self.methods: dict[str, Any] = {}
        self._server: Any = None
        self._nodes: list[Any] = []

    async def build(self, server: Server) -> None:
        """Make all nodes."""
        self._server = server
        index = await server.register_namespace(NAMESPACE)
        self.machine = await server.nodes.objects.add_object(
            ua.NodeId("Slewright", index), ua.QualifiedName("Slewright", index)
        )
        folders = {
            kind: await self.machine.add_folder(ua.NodeId(name, index), ua.QualifiedName(name, index))
            for kind, name in FOLDERS.items()
        }
        for s in SIGNALS:
            self._nodes.append(await _add(folders[s.kind], s, index))
        for method in METHODS:
            self.methods[method.name] = await _add_method(self.machine, method, index)

    async def show(self, seen: Seen) -> None:
        """Write what the images hold."""
        for place, (s, nodeid) in enumerate(zip(SIGNALS, self._nodes, strict=True)):
            code = QUALITY[Status(int(seen.status[place]))]
            await self._write(nodeid, s, float(seen.value[place]), code, seen.source_ns(place))

    async def lost(self, seen: Seen) -> None:
        """Mark everything as no longer known."""
        for place, (s, nodeid) in enumerate(zip(SIGNALS, self._nodes, strict=True)):
            await self._write(nodeid, s, float(seen.value[place]), LOST, seen.source_ns(place))

    async def _write(self, nodeid: Any, s: Signal, value: float, code: int, source_ns: int) -> None:
        shown = ua.DataValue(
            _variant(s, value),
            ua.StatusCode(code),
            SourceTimestamp=datetime.fromtimestamp(source_ns / 1e9, UTC),
            ServerTimestamp=datetime.now(UTC),
        )
        await self._server.write_attribute_value(nodeid, shown)


def _variant(s: Signal, value: float) -> Any:
    if is_whole(s):
        whole = round(value) if 0 <= value <= 0xFFFF else 0
        return ua.Variant(whole, ua.VariantType.UInt16)
    return ua.Variant(value, ua.VariantType.Double)


async def _add(folder: Any, s: Signal, index: int) -> Any:
    name = ua.QualifiedName(s.name, index)
    made = await folder.add_variable(ua.NodeId(node(s), index), name, _variant(s, s.start))
    waiting = ua.DataValue(_variant(s, s.start), ua.StatusCode(CODES.BadWaitingForInitialData))
    await made.write_value(waiting)
    about = ua.DataValue(ua.Variant(ua.LocalizedText(s.description)))
    await made.write_attribute(ua.AttributeIds.Description, about)
    await _set_type(made, "MultiStateValueDiscreteType" if s.values else "AnalogUnitRangeType")
    if s.values:
        texts = [ua.EnumValueType(n, ua.LocalizedText(t), ua.LocalizedText(t)) for n, t in s.values.items()]
        await _property(made, "EnumValues", ua.Variant(texts, ua.VariantType.ExtensionObject))
    else:
        given = ua.Range(float(s.min or 0.0), float(s.max or 0.0))
        await _property(made, "EURange", ua.Variant(given, ua.VariantType.ExtensionObject))
        await _property(made, "EngineeringUnits", ua.Variant(_unit(s), ua.VariantType.ExtensionObject))
    return made.nodeid


async def _set_type(made: Any, name: str) -> None:
    """The node's type definition instead of plain BaseDataVariableType."""
    has_type = ua.ObjectIds.HasTypeDefinition
    await made.delete_reference(ua.ObjectIds.BaseDataVariableType, has_type, True, False)
    await made.add_reference(getattr(ua.ObjectIds, name), has_type, True, False)


async def _property(made: Any, name: str, value: Any) -> None:
    """A property of OPC UA's own namespace, as its types ask for."""
    place = ua.NodeId(f"{made.nodeid.Identifier}.{name}", made.nodeid.NamespaceIndex)
    await made.add_property(place, ua.QualifiedName(name, 0), value)


def _unit(s: Signal) -> Any:
    _, symbol, name = UNECE[s.unit]
    return ua.EUInformation(UNECE_URI, unit_id(s.unit), ua.LocalizedText(symbol), ua.LocalizedText(name))


async def _add_method(machine: Any, method: Method, index: int) -> Any:
    arguments = [_argument(signal(name)) for name in method.arguments]

    async def unlinked(parent: Any, *given: Any) -> Any:
        return ua.StatusCode(CODES.BadUserAccessDenied)

    name = ua.QualifiedName(method.name, index)
    made = await machine.add_method(ua.NodeId(method.name, index), name, unlinked, arguments, [])
    about = ua.DataValue(ua.Variant(ua.LocalizedText(method.description)))
    await made.write_attribute(ua.AttributeIds.Description, about)
    return made


def _argument(s: Signal) -> Any:
    low, high = f"{s.min:g}", f"{s.max:g}"
    text = ua.LocalizedText(f"{s.description}; {s.unit}, {low} to {high}")
    return ua.Argument(s.name, ua.NodeId(ua.ObjectIds.Double), -1, [], text)
