"""What is kept of a run: record and film, with scene, plan and what the guard did."""

from pathlib import Path

import numpy as np
import pytest

from records import record as records
from records.record import Record
from specs import scene, scene_text
from tests.records.foxglove.decoded import messages
from verification.scenes import kept
from verification.scenes.run import TRUE, Case, Ran
from verification.scenes.study import Job

pytest.importorskip("foxglove")
TRUCK = scene.load("truck")
TICKS = 60


def ran(parts: tuple[str, ...] = ()) -> Ran:
    time = 0.02 * np.arange(TICKS)
    angles = np.tile([0.3, 1.1, -2.0, 0.02, 0.05], (TICKS, 1))
    table = Record.from_rows(["time", *TRUE], np.column_stack([time, angles]), {"step_s": 0.02})
    return Ran(Case(TRUCK, "pd", "tuning:3", seed=2), table, (), (0,), parts)


def test_a_record_has_the_scene_and_is_otherwise_the_run(tmp_path: Path):
    kept.keep(tmp_path, ran())
    path, picture = kept.paths(tmp_path, ran().case)
    assert path.name == "truck-pd-tuning_3-2.parquet"
    found = records.read(path)
    assert scene_text.of(found.meta[scene_text.SCENE], "record") == TRUCK
    assert found.meta[scene_text.WAYS] == []
    assert found.names == ["time", *TRUE]
    assert found.complete
    assert found.run_hash == found.computed_hash()
    assert len(messages(picture)["/tf"]) == TICKS / 2
    assert kept.there(tmp_path, ran().case)


def test_what_the_guard_did_is_a_column(tmp_path: Path):
    kept.keep(tmp_path, ran(("", "grab", *[""] * (TICKS - 2))))
    found = records.read(kept.paths(tmp_path, ran().case)[0])
    assert found.column(kept.GUARD_PART)[:3].tolist() == [0.0, 4.0, 0.0]


def test_nothing_driven_leaves_nothing(tmp_path: Path):
    kept.keep(tmp_path, Ran(ran().case, None, (), ()))
    assert list(tmp_path.iterdir()) == []
    assert not kept.there(tmp_path, ran().case)


def test_a_job_is_done_when_all_that_is_to_be_kept_is_there(tmp_path: Path):
    job = Job(TRUCK, "pd", {"tuning:3": {}}, 2, None, tmp_path)
    assert not job.complete(None)
    assert job.complete([{"driven": False}])  # without a plan there is nothing to keep
    assert not job.complete([{"driven": True}])
    kept.keep(tmp_path, ran())
    assert job.complete([{"driven": True}])
