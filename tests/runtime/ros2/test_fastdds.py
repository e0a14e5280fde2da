"""The other way into ROS 2: eProsima Fast DDS, its default (skipped, visibly, where its headers are missing).

Debian has it: libfastrtps-dev.  Bytes are read and written by rosbags, so that neither our types nor
Cyclone's code is at the other end.
"""

import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

from runtime.image import INPUT, OUTPUT, Status
from specs import ros2
from tests.runtime.interfaces.beside import Beside, drawn, value
from tests.runtime.interfaces.both import Both
from tests.runtime.ros2.peer import DOMAINS
from tests.runtime.ros2.test_live import x

pytest.importorskip("cyclonedds")
typesys = pytest.importorskip("rosbags.typesys")
SOURCE = Path(__file__).parent / "fastdds" / "peer.cpp"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not Path("/usr/include/fastdds").is_dir() or not shutil.which("g++"),
        reason="Fast DDS's headers or g++ are not installed",
    ),
]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("fastdds") / "peer"
    command = ["g++", "-std=c++17", "-o", made, SOURCE, "-lfastrtps", "-lfastcdr"]
    subprocess.run(command, check=True, timeout=240)
    return made


def test_fast_dds_reads_every_signal_and_commands(tmp_path: Path, program: Path):
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    for name in (ros2.SIGNALS, ros2.TARGET):
        store.register(typesys.get_types_from_msg(ros2.files()[f"{name}.msg"], name))
    images, domain = drawn(1), next(DOMAINS)
    followed: set[tuple[float, int]] = set()
    with Beside(
        "ros2",
        tmp_path,
        Both(tmp_path, "ros2"),
        domain=domain,
        commands=True,
        simulated=True,
        policy="",
        bundle="",
        about={},
    ) as served:
        served.publish(images)

        def run(*given: str) -> str:
            command = [str(program), str(domain), *given]
            with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as peer:
                while peer.poll() is None:
                    served.publish()
                    followed.add(x(served))
                    time.sleep(0.02)
                assert peer.returncode == 0
                return peer.stdout.read() if peer.stdout else ""

        came = run("take", "rt/slewright/signals", ros2.dds_type(ros2.SIGNALS), "60")
        found = store.deserialize_cdr(bytes.fromhex(came.strip()), ros2.SIGNALS)
        for s in (*INPUT.signals, *OUTPUT.signals):
            if s.kind != "target":
                assert getattr(found, s.name) == value(images, s.name), s.name
        sent = bytes(store.serialize_cdr(_target(store), ros2.TARGET)).hex()
        run("send", "rt/slewright/target", ros2.dds_type(ros2.TARGET), "4", sent)
        assert (8.0, Status.OK) in followed


def _target(store: Any) -> Any:
    header = store.types["std_msgs/msg/Header"](store.types["builtin_interfaces/msg/Time"](0, 0), "base")
    return store.types[ros2.TARGET](header, 8.0, 1.0, 4.0, True, 0.0, 1.0)
