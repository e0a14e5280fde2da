"""The live picture, by a client of our own: every signal's value, the machine model, log; nothing goes in."""

import asyncio
import base64
import json
import socket
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from runtime.bundle import GUARD_SCENE
from runtime.image import INPUT, OUTPUT, Status
from specs import scene, scene_text
from specs.foxglove import SURROUNDINGS
from tests.records.foxglove.decoded import message_class
from tests.runtime.foxglove.client import Client
from tests.runtime.interfaces.beside import Beside, drawn, statuses, value

pytest.importorskip("foxglove")
TOPICS = {"/tick", "/tf", "/joint_states", "/scene", "/log"}


@pytest.fixture
def served(tmp_path: Path):
    with Beside("foxglove", tmp_path, host="127.0.0.1", port=0, name="slewright: test") as found:
        yield found


@pytest.mark.long
def test_what_the_guard_of_the_bundle_keeps_off_is_shown(tmp_path: Path):
    text = json.dumps(scene_text.plain(scene.load("truck")))
    (tmp_path / "bundle").mkdir()
    (tmp_path / "bundle" / GUARD_SCENE).write_text(text)
    told = {"host": "127.0.0.1", "port": 0, "name": "test", "bundle": str(tmp_path / "bundle")}

    async def look(served: Beside) -> None:
        client = await Client(int(served.ready)).open()
        await client.until(lambda: client.channels.keys() >= TOPICS | {SURROUNDINGS})
        await client.subscribe(SURROUNDINGS)
        await client.until(lambda: len(client.messages.get(SURROUNDINGS, ())) > 1, served.publish)
        update = decoder(client.channels[SURROUNDINGS]).FromString(client.messages[SURROUNDINGS][-1])
        shown = {entity.id: entity for entity in update.entities}
        assert {thing.name for thing in scene.load("truck").things} <= shown.keys()
        assert shown["truck"].cubes
        client.close()

    with Beside("foxglove", tmp_path, **told) as served:
        asyncio.run(look(served))


def decoder(channel: dict[str, Any]) -> Any:
    """The message class that a channel's own schema describes."""
    assert channel["encoding"] == "protobuf"
    return message_class(channel["schemaName"], base64.b64decode(channel["schema"]))


def test_every_signals_value_is_the_images(served: Beside):
    async def look() -> None:
        client = await Client(int(served.ready)).open()
        await client.until(lambda: client.channels.keys() >= TOPICS)
        tick = decoder(client.channels["/tick"])
        await client.subscribe("/tick")
        for seed in range(5):
            images = drawn(seed)
            statuses({"q_boom": Status.TIMEOUT}, images[0])
            served.publish(images)
            wanted = served.tick

            def newest() -> Any:
                held = client.messages.get("/tick", ())
                found = tick.FromString(held[-1]) if held else None
                return found if found and found.tick >= wanted else None  # noqa: B023

            found = await client.until(newest, served.publish)
            for s in (*INPUT.signals, *OUTPUT.signals):
                assert getattr(found, s.name) == value(images, s.name), s.name
            assert found.q_boom_status == Status.TIMEOUT
        client.close()

    asyncio.run(look())


def test_model_scene_and_log(served: Beside):
    async def look() -> None:
        client = await Client(int(served.ready)).open()
        await client.until(lambda: client.channels.keys() >= TOPICS)
        topics = ("/tf", "/scene", "/log", "/joint_states")
        await client.subscribe(*topics)
        await client.send(op="fetchAsset", uri="package://slewright/machine.urdf", requestId=7)
        await client.send(op="fetchAsset", uri="file:///etc/hostname", requestId=8)
        served.publish(drawn(3))
        await client.until(lambda: {7, 8} <= client.assets.keys(), served.publish)
        assert client.assets[7][0] == 0
        assert ElementTree.fromstring(client.assets[7][1]).tag == "robot"
        assert client.assets[8][0] == 1  # an error
        served.outputs["value"][OUTPUT.at("control_mode")] = 5
        served.outputs["value"][OUTPUT.at("fault_code")] = 2
        log = decoder(client.channels["/log"])

        def lines() -> list[str]:
            return [log.FromString(m).message for m in client.messages.get("/log", ())]

        await client.until(lambda: "mode: fault" in lines(), served.publish)
        assert any(t.startswith("A sensor is out of its range") for t in lines())
        frames = decoder(client.channels["/tf"]).FromString(client.messages["/tf"][-1]).transforms
        assert [f.child_frame_id for f in frames][:3] == ["carriage", "boom", "stick"]
        await client.until(lambda: client.messages.get("/scene"), served.publish)
        client.close()

    asyncio.run(look())


def test_nothing_goes_in_and_nonsense_ends_nobody_elses_connection(served: Beside):
    async def look() -> None:
        good, bad = await Client(int(served.ready)).open(), await Client(int(served.ready)).open()
        await bad.until(lambda: any(t["op"] == "serverInfo" for t in bad.told))
        info = next(t for t in bad.told if t["op"] == "serverInfo")
        assert not {"clientPublish", "parameters", "services"} & set(info["capabilities"])
        channel = {"id": 1, "topic": "/u_slew", "encoding": "json", "schemaName": ""}
        await bad.send(op="advertise", channels=[channel])
        await bad.raw(b"\x01" + bytes(4) + json.dumps({"u_slew": 1.0}).encode())
        await bad.send(op="setParameters", parameters=[{"name": "u_slew", "value": 1.0}])
        await bad.raw("{ no JSON")
        await bad.raw(bytes(range(256)))
        raw = socket.create_connection(("127.0.0.1", int(served.ready)))
        raw.sendall(b"GET / HTTP/1.1\r\nUpgrade: nonsense\r\n\r\n" + bytes(1000))
        await good.until(lambda: good.channels.keys() >= TOPICS)
        await good.subscribe("/tick")
        await good.until(lambda: len(good.messages.get("/tick", ())) > 5, served.publish)
        raw.close()
        bad.close()
        good.close()

    asyncio.run(look())
    assert served.process.poll() is None
