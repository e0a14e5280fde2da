"""ROS 2 bags in SQLite, as rosbags writes them, and as other tools leave them."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from records.formats import read_measurement
from specs.errors import InputError

BEGIN_NS = 1_772_366_400_000_000_000
OWN = "float64 pressure\nint64 count\nuint8 state\nstring name\n"


def bag(folder: Path, count: int = 20) -> Path:
    """Joint states (ROS 2's own) and a message of the bag's own, at 50 Hz."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(OWN, "crane/msg/Pressure"))
    types = store.types
    with Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as made:
        joints = made.add_connection("/joints", "sensor_msgs/msg/JointState", typestore=store)
        own = made.add_connection("/crane/p", "crane/msg/Pressure", typestore=store)
        for k in range(count):
            stamp = BEGIN_NS + 20_000_000 * k
            header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](k, 0), "base")
            one = types["sensor_msgs/msg/JointState"](
                header, ["slew", "boom"], np.array([0.1 * k, 1.0]), np.zeros(0), np.zeros(0)
            )
            made.write(joints, stamp, store.serialize_cdr(one, "sensor_msgs/msg/JointState"))
            two = types["crane/msg/Pressure"](1e5 + k, 2**53 + k, k % 3, "a")
            made.write(own, stamp, store.serialize_cdr(two, "crane/msg/Pressure"))
    return folder


def database(folder: Path) -> Path:
    return next(folder.glob("*.db3"))


@pytest.mark.parametrize("of_folder", [True, False])
def test_what_was_written_is_read(tmp_path, of_folder):
    folder = bag(tmp_path / "b")
    found = read_measurement(folder if of_folder else database(folder))
    assert found["joints.position[0]"].values.tolist() == [0.1 * k for k in range(20)]
    np.testing.assert_allclose(found["joints.position[0]"].time, 0.02 * np.arange(20), atol=1e-9)
    assert found["crane.p.pressure"].values.tolist() == [1e5 + k for k in range(20)]
    assert found["crane.p.count"].values.tolist() == [2**53 + k for k in range(20)]
    assert found.start is not None
    assert int(found.start.timestamp()) == BEGIN_NS // 10**9


def test_a_bag_without_definitions_gives_what_ros_2_defines(tmp_path):
    file = database(bag(tmp_path / "b"))
    with sqlite3.connect(file) as change:
        change.execute("DROP TABLE message_definitions")
    found = read_measurement(file)
    assert "joints.position[0]" in found
    assert any("crane/msg/Pressure is defined neither in the file nor" in said for said in found.repairs)


def test_the_definition_in_the_bag_comes_first(tmp_path):
    """A message of ROS 2's name that is another one there is read as the bag says."""
    file = database(bag(tmp_path / "b"))
    with sqlite3.connect(file) as change:
        change.execute("UPDATE topics SET type = 'std_msgs/msg/Float64' WHERE name = '/crane/p'")
        set_type = "UPDATE message_definitions SET topic_type = 'std_msgs/msg/Float64'"
        change.execute(f"{set_type} WHERE topic_type LIKE 'crane%'")
    assert read_measurement(file)["crane.p.count"].values[0] == 2**53


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("UPDATE messages SET data = x'28b52ffd00' WHERE id = 2", "compressed"),
        ("UPDATE messages SET topic_id = 77", "damaged: a message of topic 77"),
        ("UPDATE messages SET timestamp = -5", "damaged: a message of topic"),
        ("UPDATE messages SET data = 'text'", "damaged: a message of topic"),
        ("DELETE FROM messages", "holds no messages"),
        ("DROP TABLE topics", "no bag of ROS 2: no such table: topics"),
    ],
)
def test_bags_that_cannot_be_read(tmp_path, change, says):
    file = database(bag(tmp_path / "b"))
    with sqlite3.connect(file) as made:
        made.execute(change)
    with pytest.raises(InputError, match=says):
        read_measurement(file)


def test_a_bag_that_was_not_closed_gives_what_stands_beside_it(tmp_path):
    file = database(bag(tmp_path / "b"))
    open_one = sqlite3.connect(file)
    open_one.execute("PRAGMA journal_mode = wal")
    open_one.execute(
        "INSERT INTO messages SELECT 1000, topic_id, timestamp + 1000000000, data FROM messages WHERE id = 2"
    )
    open_one.commit()
    copy = tmp_path / "killed.db3"
    for end in ("", "-wal"):
        (tmp_path / f"killed.db3{end}").write_bytes((file.parent / f"{file.name}{end}").read_bytes())
    open_one.close()
    assert len(read_measurement(copy)["crane.p.pressure"].values) == 21


def test_a_cut_bag_is_refused(tmp_path):
    file = database(bag(tmp_path / "b", 2000))
    file.write_bytes(file.read_bytes()[:50_000])
    with pytest.raises(InputError, match="is damaged or no bag of ROS 2: database disk image is malformed"):
        read_measurement(file)


def test_a_bag_damaged_in_the_middle_is_refused(tmp_path):
    file = database(bag(tmp_path / "b", 4000))
    data = bytearray(file.read_bytes())
    data[300_000:400_000] = bytes(100_000)
    file.write_bytes(data)
    with pytest.raises(InputError, match="is damaged: a message of topic None"):
        read_measurement(file)


def test_what_is_no_database_is_refused(tmp_path):
    (tmp_path / "a.db3").write_bytes(b"no database, but long enough to look like one" * 50)
    with pytest.raises(InputError, match="is damaged or no bag of ROS 2"):
        read_measurement(tmp_path / "a.db3")


def test_joint_states_of_two_publishers_keep_the_places_of_their_names(tmp_path):
    """Which name has which place differs between messages: each keeps the place of its first message."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    types, sent = store.types, [["a", "b"], ["b", "a"], ["c"], ["c", "a"]]
    value = {"a": 1.0, "b": 2.0, "c": 3.0}
    with Writer(tmp_path / "b", version=9, storage_plugin=StoragePlugin.SQLITE3) as made:
        joints = made.add_connection("/joints", "sensor_msgs/msg/JointState", typestore=store)
        for k, names in enumerate(sent):
            header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](k, 0), "base")
            one = types["sensor_msgs/msg/JointState"](
                header, names, np.array([10 * k + value[n] for n in names]), np.zeros(0), np.zeros(0)
            )
            made.write(joints, BEGIN_NS + 10**9 * k, store.serialize_cdr(one, "sensor_msgs/msg/JointState"))
    found = read_measurement(tmp_path / "b")
    assert found["joints.position[0]"].values.tolist() == [1, 11, 31]
    assert found["joints.position[1]"].values.tolist() == [2, 12]
    assert found["joints.position[2]"].values.tolist() == [23, 33]
    assert any("each keeps its place" in said for said in found.repairs)
