"""ROS 2's types against an independent implementation: rosbags, with ROS 2 Jazzy's definitions."""

import pytest

from specs import ros2
from specs.errors import InputError

typesys = pytest.importorskip("rosbags.typesys")
JAZZY = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
OWN = (ros2.SIGNALS, ros2.TARGET, ros2.POLICY)


def with_own() -> object:
    """Jazzy's types and ours, from the generated `.msg` files."""
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    for name in OWN:
        text = ros2.files()[f"{name}.msg"]
        store.register(typesys.get_types_from_msg(text, name))
    return store


@pytest.mark.parametrize("name", [n for n in ros2.types() if n not in OWN and "/srv/" not in n])
def test_a_standard_type_has_jazzys_fields_and_hash(name: str):
    assert [f for f, _ in ros2.types()[name]] == [f for f, _ in JAZZY.fielddefs[name][1]]
    assert ros2.type_hash(name) == JAZZY.hash_rihs01(name)


@pytest.mark.parametrize("name", OWN)
def test_own_types_hash_as_their_msg_files_do(name: str):
    assert with_own().hash_rihs01(name) == ros2.type_hash(name)  # type: ignore[attr-defined]


def test_the_idl_defines_what_the_msg_file_does():
    for name in OWN:
        text = ros2.files()[f"{name}.idl"].replace("@final ", "")
        lines = "\n".join(line for line in text.splitlines() if not line.startswith(("//", "#")))
        found = typesys.get_types_from_idl(lines)[name][1]
        assert [f for f, _ in found] == [f for f, _ in ros2.types()[name]]


def test_jazzys_published_hash_of_a_header():
    """As `ros2 topic info -v` shows it for std_msgs/msg/String."""
    wanted = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    assert ros2.type_hash("std_msgs/msg/String") == wanted


def test_types_that_there_are_not_are_named():
    with pytest.raises(InputError, match="no ROS 2 type 'std_msgs/msg/Strin'"):
        ros2.fields_of("std_msgs/msg/Strin")
    with pytest.raises(InputError, match="no ROS 2 type of a field"):
        ros2.split("float64[")
