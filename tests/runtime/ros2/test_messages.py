"""The messages against an independent implementation: rosbags reads every one as ROS 2 Jazzy would."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime.image import Status
from runtime.interfaces.publish import ImagePort, create
from runtime.interfaces.view import SIGNALS, Seen, View
from specs import ros2
from tests.runtime.interfaces.beside import drawn, statuses, value

pytest.importorskip("cyclonedds")
typesys = pytest.importorskip("rosbags.typesys")


@pytest.fixture(scope="module")
def store() -> Any:
    found = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    for name in (ros2.SIGNALS, ros2.TARGET, ros2.POLICY):
        found.register(typesys.get_types_from_msg(ros2.files()[f"{name}.msg"], name))
    return found


def seen_of(folder: Path, images: tuple[np.ndarray, np.ndarray]) -> Seen:
    port = ImagePort(create(folder))
    view = View.join(folder)
    port.receive(images[0], 1)
    port.send(images[1], 1)
    found = view.new()
    assert found
    return found


@pytest.mark.parametrize("seed", range(3))
def test_every_signal_arrives_with_its_value_and_status(tmp_path: Path, store: Any, seed: int):
    from runtime.ros2.messages import signals

    images = drawn(seed)
    statuses({"q_boom": Status.TIMEOUT, "p_pump": Status.FORCED}, images[0])
    seen = seen_of(tmp_path, images)
    found = store.deserialize_cdr(signals(seen).serialize(), ros2.SIGNALS)
    assert found.header.stamp.sec * 10**9 + found.header.stamp.nanosec == seen.time_ns
    for place, s in enumerate(SIGNALS):
        assert getattr(found, s.name) == value(images, s.name)
        assert getattr(found, f"{s.name}_status") == seen.status[place]


def test_every_topic_is_the_bytes_that_rosbags_writes(tmp_path: Path, store: Any):
    from runtime.ros2.messages import CLOCK, TOPICS

    seen = seen_of(tmp_path, drawn(5))
    for topic in (*TOPICS, CLOCK):
        ours = bytes(topic.made(seen).serialize())
        read = store.deserialize_cdr(ours, topic.type)
        again = bytes(store.serialize_cdr(read, topic.type))
        assert again.ljust(len(ours), b"\0") == ours, topic.name  # ours may be filled up to 4 bytes


def test_joints_are_those_of_the_urdf_and_of_a_bag(tmp_path: Path, store: Any):
    from records.formats import ros2_bag
    from runtime.ros2.messages import JOINTS, joint_states
    from specs import urdf

    images = drawn(6)
    found = store.deserialize_cdr(
        joint_states(seen_of(tmp_path, images)).serialize(), "sensor_msgs/msg/JointState"
    )
    assert tuple(found.name) == JOINTS
    assert JOINTS[: len(ros2_bag.JOINTS)] == ros2_bag.JOINTS
    assert set(JOINTS) == {j.name for j in urdf.joints()}
    position = dict(zip(found.name, found.position, strict=True))
    assert position["tool_level"] == pytest.approx(value(images, "q_boom") + value(images, "q_stick"))
    assert position["tool_roll"] == value(images, "imu_tool_roll")


def test_standard_messages_have_each_signal_at_its_place(tmp_path: Path, store: Any):
    from runtime.ros2.messages import TOPICS
    from specs import places

    images = drawn(7)
    seen = seen_of(tmp_path, images)
    made = {t.name: store.deserialize_cdr(t.made(seen).serialize(), t.type) for t in TOPICS}
    for name, place in places.standard().items():
        topic, _, path = place.partition(".")
        found = made[topic]
        for step in path.replace("[", ".").replace("]", "").split("."):
            found = found[int(step)] if step.isdigit() else getattr(found, step)
        assert found == value(images, name), place
