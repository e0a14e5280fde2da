"""A run in a scene as an MCAP file that Foxglove plays with the layout that ships.

/tick           every column of the record, JSON with units
/tf             foxglove.FrameTransforms  joints, from the given angles
/joint_states   foxglove.JointStates
/machine        foxglove.SceneUpdate      the machine's parts, which follow /tf
/surroundings   foxglove.SceneUpdate      things that stand still, zones, targets
/moving         foxglove.SceneUpdate      things that move
/plan           foxglove.SceneUpdate      the planned way, and the room that the swinging grab takes
"""

import os
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer

from records.formats.mcap_file import write_topic
from records.formats.mcap_topics import OURS, STATE
from records.foxglove import machine, surroundings
from records.measurement import Channel
from records.record import Record
from records.schema import columns_of
from specs.foxglove import MACHINE, MOVING, PLAN, SURROUNDINGS
from specs.pose import ANGLES
from specs.scene import Scene

TICK, TF, JOINT_STATES = "/tick", "/tf", "/joint_states"
JOINTS_EVERY, MOVING_EVERY = 2, 5  # ticks
Sent = tuple[int, str, Any]  # ns, topic, message


def write(
    path: Path, record: Record, angles: np.ndarray, scene: Scene, ways: Sequence[Any], swept_m: float
) -> None:
    """Write the file, whole or not at all.

    `angles` (n, 5) are those of `specs.pose.ANGLES` in each row of the record, `ways` the planned ways of the
    grab ((m, 3) each), `swept_m` the radius of the room that the grab takes on them.
    Raises ModuleNotFoundError where foxglove-sdk is missing.
    """
    messages = import_module("foxglove.messages")
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        with part.open("wb") as file:
            writer = Writer(file)
            writer.start(profile="", library="slewright")
            write_topic(writer, TICK, record.time, _channels(record), 0)
            _write(writer, _shown(record.time, angles, scene, ways, swept_m, messages))
            writer.finish()
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _channels(record: Record) -> list[Channel]:
    columns = [column for column in columns_of(record.table.schema) if column.name != "time"]
    return [Channel(c.name, c.unit, record.time, record.column(c.name), c.description) for c in columns]


def _shown(
    times: np.ndarray, angles: np.ndarray, scene: Scene, ways: Sequence[Any], swept_m: float, messages: Any
) -> Iterator[Sent]:
    """All messages in the order of time."""
    stamps = np.round(1e9 * times).astype(np.int64).tolist()
    yield stamps[0], MACHINE, machine.parts(stamps[0], messages)
    yield stamps[0], SURROUNDINGS, surroundings.still(scene, stamps[0], messages)
    if ways:
        yield stamps[0], PLAN, surroundings.plan(ways, swept_m, stamps[0], messages)
    moves = any(thing.path for thing in scene.things)
    for row, (at, seconds) in enumerate(zip(stamps, times.tolist(), strict=True)):
        if row % JOINTS_EVERY == 0:
            by_name: dict[str, float] = dict(zip(ANGLES, angles[row].tolist(), strict=True))
            turned = {j.name: sum(by_name[name] for name in j.angles) for j in machine.JOINTS}
            yield at, TF, machine.transforms(turned, at, messages)
            yield at, JOINT_STATES, machine.joint_states(turned, at, messages)
        if moves and row % MOVING_EVERY == 0:
            yield at, MOVING, surroundings.moving(scene, seconds, at, messages)


def _write(writer: Writer, sent: Iterator[Sent]) -> None:
    topics: dict[str, int] = {}
    for at, topic, message in sent:
        if topic not in topics:
            schema = message.get_schema()
            number = writer.register_schema(schema.name, schema.encoding, schema.data)
            topics[topic] = writer.register_channel(topic, "protobuf", number, {OURS: STATE})
        writer.add_message(topics[topic], at, message.encode(), at)
