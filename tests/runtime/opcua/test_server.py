"""The OPC UA server, started for real: values, units, quality; who may command; what is refused and told.

The client is asyncua's, which is the server's library too; `test_other_client.py` reads with another one.
"""

import asyncio
import math
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from runtime.image import INPUT, OUTPUT, Status
from runtime.modbus.holding import LAPSE_NS
from runtime.opcua.space import QUALITY
from specs.opcua import NAMESPACE, is_whole, node, unit_id
from tests.runtime.interfaces.beside import Beside, drawn, statuses, value
from tests.runtime.opcua.clients import connected, until

asyncua = pytest.importorskip("asyncua")
ua: Any = asyncua.ua
pytestmark = pytest.mark.slow
SIGNALS = (*INPUT.signals, *OUTPUT.signals)


def target(served: Beside, name: str) -> tuple[float, int]:
    place = INPUT.at(name)
    return float(served.inputs["value"][place]), int(served.inputs["status"][place])


@pytest.mark.long
def test_values_units_ranges_and_quality_of_every_signal(served: Beside, papers: dict[str, Any]):
    async def look() -> None:
        images = drawn(1)
        bad = {"q_boom": Status.TIMEOUT, "q_stick": Status.FORCED, "p_pump": Status.ERROR}
        statuses(bad, images[0])
        images[0]["age"][INPUT.at("oil_temperature")] = 25
        served.publish(images)
        async with connected(served, papers) as (client, index):
            nodes = {s.name: client.get_node(f"ns={index};s={node(s)}") for s in SIGNALS}
            first = nodes["q_slew"]

            async def shown() -> bool:
                held = await first.read_data_value(raise_on_bad_status=False)
                return held.Value.Value == value(images, "q_slew")

            await until(shown)
            for s in SIGNALS:
                if s.kind == "target":
                    continue  # nobody commands
                held = await nodes[s.name].read_data_value(raise_on_bad_status=False)
                wanted = None if s.name in ("q_boom", "p_pump") else value(images, s.name)  # bad: no value
                assert held.Value.Value == wanted, s.name
                assert held.StatusCode.value == QUALITY[bad.get(s.name, Status.OK)], s.name
                assert wanted is None or (held.Value.VariantType == ua.VariantType.UInt16) == is_whole(s)
                if s.values:
                    texts = await (await nodes[s.name].get_child("0:EnumValues")).read_value()
                    assert {t.Value: t.DisplayName.Text for t in texts} == dict(s.values)
                else:
                    span = await (await nodes[s.name].get_child("0:EURange")).read_value()
                    assert (span.Low, span.High) == (s.min, s.max)
                    unit = await (await nodes[s.name].get_child("0:EngineeringUnits")).read_value()
                    assert unit.UnitId == unit_id(s.unit)
            older = await nodes["oil_temperature"].read_data_value()
            newer = await nodes["q_slew"].read_data_value()
            apart = (newer.SourceTimestamp - older.SourceTimestamp).total_seconds()
            assert apart >= 0.4  # 25 ticks, and what the two reads lie apart

    asyncio.run(look())


def test_nobody_writes_without_the_role_and_no_node_is_writable(served: Beside, papers: dict[str, Any]):
    async def look(who: str) -> None:
        async with connected(served, papers, who) as (client, index):
            machine = client.get_node(f"ns={index};s=Slewright")
            with pytest.raises(ua.UaStatusCodeError, match="BadUserAccessDenied"):
                await machine.call_method(f"{index}:SetTarget", 8.0, 0.0, 4.0, 1.0, 0.0)
            for name in ("Commands.u_slew", "Targets.target_x"):
                with pytest.raises(ua.UaStatusCodeError, match=r"BadUserAccessDenied|BadNotWritable"):
                    await client.get_node(f"ns={index};s={name}").write_value(1.0)
            with pytest.raises(ua.UaStatusCodeError):
                await client.nodes.objects.add_object(index, "intruder")

    for who in ("", "viewer"):
        asyncio.run(look(who))
    assert target(served, "target_x")[1] == Status.NEVER


def test_a_certificate_of_another_authority_is_refused(served: Beside, papers: dict[str, Any]):
    async def look() -> None:
        with pytest.raises((ua.UaError, ConnectionError)):
            async with connected(served, papers, "stranger"):
                pass
        async with connected(served, papers) as (client, index):  # it goes on
            assert await client.get_node(f"ns={index};s=Status.control_mode").read_browse_name()

    asyncio.run(look())


def test_a_planner_commands_and_what_it_commanded_lapses(served: Beside, papers: dict[str, Any]):
    async def look() -> None:
        async with connected(served, papers, "planner") as (client, index):
            machine = client.get_node(f"ns={index};s=Slewright")

            async def call(name: str, *given: float) -> None:
                await machine.call_method(f"{index}:{name}", *given)

            async def taken(*given: float) -> bool:
                try:
                    await call("SetTarget", *given)
                except ua.UaStatusCodeError:
                    return False
                return True

            for wrong in (math.nan, 26.0, -math.inf):
                with pytest.raises(ua.UaStatusCodeError, match="BadOutOfRange"):
                    await call("SetTarget", wrong, 0.0, 4.0, 1.0, 0.0)
            with pytest.raises(ua.UaStatusCodeError, match="BadArgumentsMissing"):
                await call("SetTarget", 8.0)
            with pytest.raises(ua.UaStatusCodeError, match="BadTypeMismatch"):
                await machine.call_method(f"{index}:Follow", "yes")
            assert target(served, "target_x")[1] == Status.NEVER
            await call("SetTarget", 8.0, 1.0, 4.0, 0.5, 100.0)
            await call("Follow", 1.0)
            await until(lambda: _now(target(served, "target_valid") == (1.0, Status.OK)))
            assert target(served, "target_x") == (8.0, Status.OK)
            assert target(served, "pace") == (0.5, Status.OK)
            await until(lambda: _now(target(served, "target_x")[1] == Status.NEVER))  # no sign of life
            await until(lambda: taken(9.0, 1.0, 4.0, 1.0, 0.0))
            assert target(served, "target_x") == (9.0, Status.OK)
            await call("Release")
            await until(lambda: _now(target(served, "target_x")[1] == Status.NEVER))
            await call("SetTarget", 7.0, 1.0, 4.0, 1.0, 0.0)
        for _ in range(200):  # the session has ended: what it commanded lapses
            served.publish()
            if target(served, "target_x")[1] == Status.NEVER:
                return
            await asyncio.sleep(0.05)
        pytest.fail("its targets still count")

    asyncio.run(look())


def test_signs_of_life_keep_a_command_and_nobody_displaces_it(served: Beside, papers: dict[str, Any]):
    async def shown() -> tuple[float, int]:
        for _ in range(2):  # ticks
            served.publish()
        return target(served, "target_x")

    async def look() -> None:
        async with (
            connected(served, papers, "planner") as (planner, index),
            connected(served, papers, "second") as (second, _),
        ):
            own, other = (c.get_node(f"ns={index};s=Slewright") for c in (planner, second))
            command = Kept(own, index, ("SetTarget", 8.0, 1.0, 4.0, 0.5, 100.0))
            for name, given in (("SetTarget", (2.5, 0.0, 4.0, 1.0, 0.0)), ("Heartbeat", ())):
                asked = f"{index}:{name}", *given

                async def answer(asked: tuple[Any, ...] = asked) -> str:
                    try:
                        await other.call_method(*asked)
                    except ua.UaStatusCodeError as error:
                        return type(error).__name__
                    await other.call_method(f"{index}:Release")
                    return "it commands"

                assert await command.behind(answer, "BadUserAccessDenied")
            for _ in range(12):  # longer than a command counts without a sign of life
                assert await command.behind(shown, (8.0, Status.OK))
                await asyncio.sleep(0.1)

    asyncio.run(look())


class Kept:
    """A command that signs of life keep; on a slow computer it may lapse, and then it is given again."""

    def __init__(self, machine: Any, index: int, command: tuple[Any, ...]) -> None:
        self.machine, self.index, self.command, self.since = machine, index, command, -math.inf

    @property
    def late(self) -> bool:
        """Whether it may have lapsed since the last sign of life."""
        return time.monotonic() - self.since >= 1e-9 * LAPSE_NS

    async def sign(self, name: str, *given: float) -> bool:
        """A sign of life; whether the server takes it, as it has to before the command lapses."""
        began = time.monotonic()
        try:
            await self.machine.call_method(f"{self.index}:{name}", *given)
        except ua.UaStatusCodeError:
            assert self.late
            return False
        self.since = began
        return True

    async def behind(self, seen: Callable[[], Awaitable[Any]], wanted: Any) -> bool:
        """Whether that is seen right behind a sign of life."""
        while True:
            if not await self.sign("Heartbeat"):
                await until(lambda: self.sign(*self.command))
            found = await seen()
            if found == wanted or not self.late:
                return found == wanted


async def _is(node: Any, value: float) -> bool:
    held = await node.read_data_value(raise_on_bad_status=False)
    return held.StatusCode.is_good() and held.Value.Value == value


async def _now(found: Any) -> Any:
    return found


def test_an_operator_acknowledges_and_nobody_else(served: Beside, papers: dict[str, Any], tmp_path: Path):
    """By the event's id; the page and the audit log have it."""
    from runtime.interfaces.told import Listener

    acknowledge = ua.NodeId(ua.ObjectIds.AcknowledgeableConditionType_Acknowledge)
    listener = Listener(served.folder, "opcua")
    told: list[dict[str, Any]] = []

    class Heard:
        def __init__(self) -> None:
            self.events: list[Any] = []

        def event_notification(self, event: Any) -> None:
            if event.ConditionName == "emergency_stop":
                self.events.append(event)

    comment = "seen, hose looked at, no oil on the ground, pump to be looked at, m.k."

    async def asked(client: Any, index: int, key: str, event: bytes) -> str:
        condition = client.get_node(ua.NodeId(f"Alarms.{key}", index))
        given = ua.Variant(event, ua.VariantType.ByteString), ua.Variant(ua.LocalizedText(comment))
        try:
            await condition.call_method(acknowledge, *given)
        except ua.UaStatusCodeError as error:
            return ua.status_codes.get_name_and_doc(error.code)[0]
        return "Good"

    async def story() -> None:
        heard = Heard()
        served.inputs["value"][INPUT.at("emergency_stop")] = 0.0
        served.inputs["status"][INPUT.at("emergency_stop")] = Status.OK
        async with connected(served, papers, "operator") as (client, index):
            watching = await client.create_subscription(50, heard)
            await watching.subscribe_events(client.nodes.server, ua.ObjectIds.AlarmConditionType)
            await asyncio.sleep(0.2)
            served.inputs["value"][INPUT.at("emergency_stop")] = 1.0
            await until(lambda: _now(heard.events))
            event = heard.events[0].EventId
            assert await asked(client, index, "no_such", event) == "BadNodeIdUnknown"
            assert await asked(client, index, "emergency_stop", b"another") == "BadEventIdUnknown"
            async with connected(served, papers, "planner") as (planner, _):
                assert await asked(planner, index, "emergency_stop", event) == "BadUserAccessDenied"
            async with connected(served, papers) as (nobody, _):
                assert await asked(nobody, index, "emergency_stop", event) == "BadUserAccessDenied"
            assert await asked(client, index, "emergency_stop", event) == "Good"
            await until(lambda: _now(len(heard.events) > 1))
            newest = heard.events[-1]
            assert (getattr(newest, "AckedState/Id"), newest.Retain) == (True, True)
            assert (
                await asked(client, index, "emergency_stop", newest.EventId)
                == "BadConditionBranchAlreadyAcked"
            )
            served.inputs["value"][INPUT.at("emergency_stop")] = 0.0
            await until(lambda: _now(len(heard.events) > 2))
            assert heard.events[-1].Retain is False

    asyncio.run(story())
    told += listener.new()
    (done,) = [e for e in told if e.get("acknowledged")]
    assert done["acknowledged"] == "emergency_stop"
    assert "operator" in done["what"]
    assert f" acknowledged ({comment}): " in done["what"]  # whole, however long the alarm's own text is
    assert any("planner" in e["what"] and "refused Acknowledge" in e["what"] for e in told)


class Heard:
    """What a client is told of events."""

    def __init__(self) -> None:
        self.events: list[Any] = []

    def event_notification(self, event: Any) -> None:
        self.events.append(event)


def test_alarms_come_and_go_as_events_and_the_loss_of_the_control_process_shows(
    served: Beside, papers: dict[str, Any]
):
    async def look() -> None:
        heard = Heard()
        statuses({s.name: Status.OK for s in INPUT.signals}, served.inputs)
        served.inputs["value"][INPUT.at("emergency_stop")] = 0.0
        async with connected(served, papers) as (client, index):
            stop = client.get_node(f"ns={index};s=Status.emergency_stop")
            await until(lambda: _is(stop, 0))
            watching = await client.create_subscription(50, heard)
            await watching.subscribe_events(client.nodes.server, ua.ObjectIds.AlarmConditionType)
            served.inputs["value"][INPUT.at("emergency_stop")] = 1.0
            await until(lambda: _now([e for e in heard.events if e.ConditionName == "emergency_stop"]))
            served.inputs["value"][INPUT.at("emergency_stop")] = 0.0
            of = lambda: [e for e in heard.events if e.ConditionName == "emergency_stop"]  # noqa: E731
            await until(lambda: _now(len(of()) > 1))
            assert [(e.Retain, e.Severity) for e in of()] == [(True, 900), (True, 200)]  # nobody acknowledged
            assert of()[0].Message.Text.startswith("Emergency stop is open")

    asyncio.run(look())
    time.sleep(1.2)  # nothing is published

    async def lost() -> None:
        client = asyncua.Client(f"opc.tcp://127.0.0.1:{served.ready}/slewright")
        async with client:
            index = await client.get_namespace_index(NAMESPACE)
            first = client.get_node(f"ns={index};s=Status.control_mode")

            async def gone() -> bool:
                held = await first.read_data_value(raise_on_bad_status=False)
                return held.StatusCode.value == ua.StatusCodes.BadCommunicationError

            await until(gone)

    asyncio.run(lost())


def test_a_client_that_comes_later_asks_for_the_alarms_that_last(served: Beside, papers: dict[str, Any]):
    async def look() -> None:
        places = [INPUT.at(name) for name in ("emergency_stop", "machine_fault")]
        async with connected(served, papers) as (client, _):
            heard = Heard()
            served.inputs["value"][places] = 0.0
            served.inputs["status"][places] = Status.OK
            watching = await client.create_subscription(50, heard)
            await watching.subscribe_events(client.nodes.server, ua.ObjectIds.AlarmConditionType)
            await asyncio.sleep(0.2)
            served.inputs["value"][places] = 1.0
            await until(lambda: _now(len({e.ConditionName for e in heard.events if e.Retain}) > 1))
        async with connected(served, papers) as (client, _):
            late = Heard()
            watching = await client.create_subscription(50, late)
            await watching.subscribe_events(client.nodes.server, ua.ObjectIds.AlarmConditionType)
            number = ua.Variant(watching.subscription_id, ua.VariantType.UInt32)
            kind = client.get_node(ua.ObjectIds.ConditionType)
            await kind.call_method(ua.NodeId(ua.ObjectIds.ConditionType_ConditionRefresh), number)
            lasting = {e.ConditionName: e.EventId for e in heard.events if e.Retain}
            known = lambda: {e.ConditionName: e.EventId for e in late.events if e.ConditionName}  # noqa: E731
            await until(lambda: _now(lasting.items() <= known().items()))
        served.inputs["value"][places] = 0.0

    asyncio.run(look())
