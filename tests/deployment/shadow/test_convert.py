"""The runtime's recordings in other tools' formats: a folder of segments to MDF4 and back, to a ROS 2 bag."""

from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF

from records.formats import read_measurement, write_measurement
from specs.errors import InputError
from tests.deployment.shadow.runs import TICKS, recorded, repeated


def test_asammdf_opens_what_the_recorder_wrote(tmp_path: Path):
    write_measurement(read_measurement(recorded()[0]), tmp_path / "run.mf4")
    with MDF(tmp_path / "run.mf4") as file:
        slew = file.get("q_slew")
        assert (len(slew.samples), slew.unit) == (TICKS, "rad")
        assert (
            np.array_equal(slew.samples, repeated().input("q_slew"), equal_nan=True)
            or np.isclose(slew.samples[5:], repeated().input("q_slew")[5:]).all()
        )
        assert np.allclose(np.diff(slew.timestamps), 0.02, atol=1e-6)
        assert file.get("seen_joystick_slew").unit in ("", "1")
        assert file.start_time.year >= 2024


def test_there_and_back_every_value_stays(tmp_path: Path):
    first = read_measurement(recorded()[0])
    write_measurement(first, tmp_path / "run.mf4")
    write_measurement(read_measurement(tmp_path / "run.mf4"), tmp_path / "run.mcap")
    back = read_measurement(tmp_path / "run.mcap")
    assert set(back.channels) == set(first.channels)
    for name in ("q_slew", "u_slew", "p_pump", "seen_joystick_slew", "late_ns"):
        assert np.array_equal(back[name].values, first[name].values), name
    assert back.start == first.start


def test_the_bag_has_the_papers_topics(tmp_path: Path):
    from rosbags.rosbag2 import Reader

    lost = write_measurement(read_measurement(recorded()[0]), tmp_path / "run.rosbag2")
    with Reader(tmp_path / "run.rosbag2") as bag:
        counts = {t: info.msgcount for t, info in bag.topics.items()}
    assert counts["/joint_states"] == counts["/commands"] == counts["/operator_seen"] == TICKS
    assert any("no topic holds" in line for line in lost)


def test_a_folder_without_segments_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match="folder"):
        read_measurement(tmp_path)
