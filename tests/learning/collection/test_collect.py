"""Collecting on the simulated reference machine, with the tiny plan."""

import json
from collections.abc import Mapping

import numpy as np
import pytest

from learning.collection import collect as collecting
from learning.collection.collect import MANIFEST, PAGE, collect
from learning.collection.command import NEUTRAL, Command, Sample
from learning.collection.machine import RECORDED
from learning.collection.plan import SPLITS, Plan, Recording
from records.record import read
from specs.errors import InputError
from tests.conftest import Command as Cli
from tests.learning.collection.pilots import Always


@pytest.mark.long
def test_every_recording_is_there_with_its_split_and_length(collected, plan):
    manifest = json.loads((collected / MANIFEST).read_text())
    assert manifest["minutes"] == {split: pytest.approx(plan.minutes(split), abs=1e-6) for split in SPLITS}
    assert all(0.5 < minutes < 1.0 for minutes in manifest["minutes"].values())
    assert manifest["aborted"] == []
    assert manifest["origin"] == "simulated reference machine"
    assert len(manifest["recordings"]) == len(plan.recordings)
    for entry in manifest["recordings"]:
        found = read(collected / entry["file"])
        assert found.complete
        assert found.computed_hash() == entry["run_hash"]
        assert found.meta["split"] == entry["split"]
        assert found.time == pytest.approx(0.02 * np.arange(round(50 * entry["seconds"])))
        assert entry["seconds"] >= 8.0


def test_a_recording_holds_commands_and_sensors_and_no_truth(collected, plan):
    found = read(collected / f"{plan.recordings[9].name}.parquet")
    assert set(found.names) == {"time", "load_told", *RECORDED}
    assert not [name for name in found.names if name.startswith("true_")]
    assert set(found.column("load_told")) == {1000.0}
    assert found.units["p_slew_a"] == "Pa"
    held = found.column("u_slew").reshape(-1, 5)
    assert (held == held[:, :1]).all()  # commands change every 0.1 s
    assert len(np.unique(held[:, 0])) > 3


def test_the_same_plan_gives_the_same_bytes_and_another_seed_others(collected, plan, tmp_path):
    collect(plan, tmp_path, parts=("random", "driving"))
    for name in ("009_random", "012_driving"):
        mine, theirs = (folder / f"{name}.parquet" for folder in (tmp_path, collected))
        assert mine.read_bytes() == theirs.read_bytes()
    assert read(tmp_path / "009_random.parquet").run_hash != read(tmp_path / "010_random.parquet").run_hash


def test_what_is_there_is_kept_and_what_is_missing_is_made(plan, tmp_path):
    collect(plan, tmp_path, parts=("steps",))
    first, second, third = (tmp_path / f"{n:03d}_steps.parquet" for n in range(3))
    before, first_time = first.read_bytes(), first.stat().st_mtime_ns
    second.unlink()
    manifest = collect(plan, tmp_path, parts=("steps",))
    assert first.stat().st_mtime_ns == first_time
    assert first.read_bytes() == before
    assert [e["file"] for e in manifest["recordings"]] == [p.name for p in (first, second, third)]
    assert read(second).complete


def test_a_file_that_is_no_recording_is_left_alone(plan, tmp_path):
    foreign = tmp_path / "001_steps.parquet"
    foreign.write_bytes(b"mine")
    with pytest.raises(InputError, match=r"001_steps\.parquet is damaged .*; remove it"):
        collect(plan, tmp_path, parts=("steps",))
    assert foreign.read_bytes() == b"mine"
    assert [p.name for p in tmp_path.iterdir()] == [foreign.name]


def test_an_interrupted_collection_goes_on_where_it_stopped(plan, tmp_path, monkeypatch):
    usual = collecting.pilot

    def impatient(given: Plan, recording: Recording, gains: Mapping[str, float] | None = None):
        if recording.index == 0 and recording.split == "validation":

            class Stop(Always):
                def __call__(self, period: int, seen: Sample) -> Command:
                    if period == 30:
                        raise KeyboardInterrupt
                    return NEUTRAL

            return Stop(NEUTRAL)
        return usual(given, recording, gains)

    monkeypatch.setattr(collecting, "pilot", impatient)
    with pytest.raises(KeyboardInterrupt):
        collect(plan, tmp_path, parts=("sines",))
    broken = read(tmp_path / "004_sines.parquet")
    assert not broken.complete
    assert broken.reason == "interrupted"
    assert len(broken) == 150
    assert not (tmp_path / MANIFEST).exists()
    monkeypatch.setattr(collecting, "pilot", usual)
    kept = (tmp_path / "003_sines.parquet").stat().st_mtime_ns
    manifest = collect(plan, tmp_path, parts=("sines",))
    assert (tmp_path / "003_sines.parquet").stat().st_mtime_ns == kept
    assert len(manifest["recordings"]) == 3


def test_a_recording_of_something_else_is_never_written_over(collected, plan):
    before = (collected / "000_steps.parquet").read_bytes()
    with pytest.raises(InputError, match="recording of collection tiny, seed 1, machine nominal"):
        collect(plan, collected, machine="validation:1", parts=("steps",))
    assert (collected / "000_steps.parquet").read_bytes() == before


def test_a_machine_that_is_drawn_moves_otherwise(collected, plan, tmp_path):
    collect(plan, tmp_path, machine="tuning:2", parts=("steps",))
    mine, theirs = (read(folder / "000_steps.parquet") for folder in (tmp_path, collected))
    assert (mine.column("u_slew") == theirs.column("u_slew")).all()
    assert abs(mine.column("q_slew") - theirs.column("q_slew")).max() > 0.01


def test_the_command_resumes_writes_its_figures_and_names_what_is_wrong(collected, slewright: Cli, tmp_path):
    target = tmp_path / "figures.json"
    done = slewright("collect", "tiny", "--out", collected, "--json", target)
    assert done.returncode == 0, done.stderr
    figures = json.loads(target.read_text())
    assert figures["minutes"]["train"] > 0.5
    assert set(figures["coverage"]["covered"]) >= {"all", "excitation", "steps"}
    wrong = slewright("collect", "tiny", "--out", collected, "--parts", "stepps")
    assert wrong.returncode == 2
    assert "stepps" in wrong.stderr
    assert "did you mean steps" in wrong.stderr


def test_the_page_is_complete_in_itself(collected):
    page = (collected / PAGE).read_text()
    head = page.split("<script>")[0]
    assert "simulated reference machine" in head
    assert "src=" not in head
    assert "href=" not in head
    for entry in json.loads((collected / MANIFEST).read_text())["recordings"]:
        assert entry["file"] in head
