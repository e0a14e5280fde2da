"""Runs that end well and runs that do not: what is raised, and what is left on the disk."""

import math
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from benchmarks.testpack import kit
from orchestrator.run.master import Master
from orchestrator.run.simulate import simulate
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from records.record import RecordWriter, read
from specs.errors import InputError, RunError
from specs.faults import Fault
from tests.orchestrator.systems import (
    OSCILLATOR,
    chain,
    component,
    connection,
    connector,
    liar,
    liar_system,
    load,
    ssd,
)


def driven(folder: Path) -> System:
    """position alone, its speed a system input in mm/s … as far as the input is concerned."""
    return load(
        folder,
        ssd(
            [component("position", "position", connector("v", "input"), connector("position", "output"))],
            [connection("v", "position.v"), connection("position.position", "place")],
            [connector("v", "input"), connector("place", "output")],
        ),
        ["position"],
    )


def bursting(folder: Path, fmi_version: int = 2) -> System:
    """A component whose step fails when its parameter `limit` is exceeded."""
    return load(
        folder,
        ssd(
            [component("bomb", "burst", connector("push", "input"), connector("count", "output"))],
            [connection("push", "bomb.push"), connection("bomb.count", "count")],
            [connector("push", "input"), connector("count", "output")],
        ),
        ["burst"],
        fmi_version,
    )


def test_stimuli_hold_until_the_next_change(tmp_path: Path) -> None:
    record = simulate(driven(tmp_path), 5, Stimuli({0: {"v": 1.0}, 3: {"v": -2.0}}))
    assert record.column("v").tolist() == [1.0, 1.0, 1.0, -2.0, -2.0, -2.0]
    np.testing.assert_allclose(record.column("place"), [1.0, 1.01, 1.02, 1.03, 1.01, 0.99])


def test_an_undriven_system_input_keeps_the_start_value_of_the_variable(tmp_path: Path) -> None:
    assert simulate(driven(tmp_path), 1).column("v").tolist() == [0.25, 0.25]


def test_two_runs_are_byte_identical_and_say_where_they_come_from(tmp_path: Path) -> None:
    paths = [tmp_path / "a.parquet", tmp_path / "b.parquet"]
    for path in paths:
        system = load(tmp_path, OSCILLATOR, ["position", "speed"])
        simulate(
            system, 700, parameters={"speed.rate": 2.0}, record_path=path, seed=4, meta={"scenario": "s"}
        )
    assert paths[0].read_bytes() == paths[1].read_bytes()
    meta = read(paths[0]).meta
    assert meta["parameters"] == {"speed.rate": 2.0}
    assert (meta["scenario"], meta["seed"], meta["step_s"], meta["complete"]) == ("s", 4, 0.01, True)
    assert set(meta["fmus"]) == {"position", "speed"}
    assert len(read(paths[0])) == 701


def test_in_memory_and_on_disk_hold_the_same(tmp_path: Path) -> None:
    system = load(tmp_path, OSCILLATOR, ["position", "speed"])
    memory, disk = simulate(system, 600), simulate(system, 600, record_path=tmp_path / "r.parquet")
    assert memory.table.equals(disk.table)
    assert memory.meta == {k: v for k, v in disk.meta.items() if k != "format"}


@pytest.mark.parametrize("fmi_version", [2, 3])
def test_a_failing_fmu_is_named_with_time_and_inputs_and_the_record_kept(
    tmp_path: Path, fmi_version: int
) -> None:
    path = tmp_path / "r.parquet"
    with pytest.raises(RunError) as caught:
        simulate(bursting(tmp_path, fmi_version), 20, Stimuli({0: {"push": 0.75}}), record_path=path)
    message = str(caught.value)
    assert "component bomb failed in the step from t = 0.03 s" in message
    assert "state root is not a finite number" in message
    assert "last inputs: push = 0.75" in message
    record = read(path)
    assert not record.complete
    assert "component bomb" in record.reason
    assert record.column("count").tolist() == [0.0, 1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("fmi_version", "trick", "words"),
    [
        (2, 1, "output level_out became nan"),
        (2, 2, "returned discard (I do not want to)"),
        (2, 3, "returned fatal (I do not want to)"),
        (3, 1, "output level_out became inf"),
        (3, 2, "it returned early, unasked"),
    ],
)
@pytest.mark.parametrize("algorithm", ["jacobi", "gauss-seidel"])
def test_lies_and_refusals_stop_the_run(
    tmp_path: Path, fmi_version: int, trick: int, words: str, algorithm: str
) -> None:
    system = load(tmp_path, liar_system(fmi_version), {"liar": liar(fmi_version, tmp_path)}, fmi_version)
    path = tmp_path / "r.parquet"
    with pytest.raises(RunError) as caught:
        simulate(system, 20, parameters={"liar.trick": trick}, record_path=path, algorithm=algorithm)
    assert "component liar failed in the step from t = 0.05 s" in str(caught.value)
    assert words in str(caught.value)
    assert "level_in = 5" in str(caught.value)
    assert read(path).column("count").tolist() == [0, 1, 2, 3, 4, 5]


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss-seidel"])
def test_an_fmu_may_end_the_simulation(tmp_path: Path, algorithm: str) -> None:
    system = load(tmp_path, liar_system(3), {"liar": liar(3, tmp_path)}, 3)
    record = simulate(system, 20, parameters={"liar.trick": 3}, algorithm=algorithm)
    assert (record.complete, len(record)) == (False, 7)
    assert record.reason == "component liar asked to end the simulation at t = 0.06 s"


def test_a_warning_does_not_stop_the_run(tmp_path: Path) -> None:
    system = load(tmp_path, liar_system(2), {"liar": liar(2, tmp_path)})
    assert simulate(system, 20, parameters={"liar.trick": 4}).complete


def test_interrupted_runs_keep_what_they_have(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, run = tmp_path / "r.parquet", Master.run

    def interrupted(self: Master, until: int) -> bool:
        run(self, min(until, 301))
        if self.tick == 301:
            raise KeyboardInterrupt
        return True

    monkeypatch.setattr(Master, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        simulate(driven(tmp_path), 1000, record_path=path)
    record = read(path)
    assert (record.complete, record.reason, len(record)) == (False, "interrupted", 301)


def test_a_full_disk_ends_the_run_and_leaves_a_readable_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, append, calls = tmp_path / "r.parquet", RecordWriter.append, []

    def full(self: RecordWriter, rows: np.ndarray) -> None:
        calls.append(len(rows))
        if len(calls) == 2:
            raise RunError("recording stopped: the disk is full")
        append(self, rows)

    monkeypatch.setattr(RecordWriter, "append", full)
    with pytest.raises(RunError, match="disk is full"):
        simulate(driven(tmp_path), 50_000, record_path=path)
    record = read(path)
    assert not record.complete
    assert len(record) == calls[0] > 0


def test_really_full_device(tmp_path: Path) -> None:
    """/dev/full refuses every write: the run ends with RunError, whoever notices first."""
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full here")
    (tmp_path / "r.parquet.recording").symlink_to("/dev/full")
    with pytest.raises(RunError, match=r"disk is full|cannot record"):
        simulate(driven(tmp_path), 2000, record_path=tmp_path / "r.parquet")


@pytest.mark.parametrize(
    ("stimuli", "words"),
    [
        ({0: {"vv": 1.0}}, "system test has no input 'vv', nor is it a signal"),
        ({0: {"place": 1.0}}, "system test has no input 'place'"),
        ({0: {"u_slew": 1.0}}, "no input 'u_slew': it is a signal, but not here; valid: v"),
        ({0: {"u_slow": 1.0}}, r"nor is it a signal of specs/signals.toml; did you mean u_slew"),
        ({0: {"v": float("nan")}}, "input v is nan at tick 0"),
        ({-1: {"v": 1.0}}, "whole ticks from 0 on, not at -1"),
    ],
)
def test_wrong_stimuli_are_refused(tmp_path: Path, stimuli: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        simulate(driven(tmp_path), 1, Stimuli(stimuli))


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"position.start": 11.0}, r"parameter position.start = 11 m is out of bounds; valid: -10 … 10 m"),
        ({"position.start": float("nan")}, "out of bounds"),
        ({"position.stat": 1.0}, "component position has no parameter 'stat'; did you mean start"),
        ({"position.v": 1.0}, "position.v is of causality input, not a parameter"),
        ({"positon.start": 1.0}, "has no component 'positon'; did you mean position"),
        ({"start": 1.0}, "'start' is not of the form component.parameter"),
    ],
)
def test_wrong_parameters_are_refused_and_nothing_is_written(
    tmp_path: Path, parameters: dict, words: str
) -> None:
    path = tmp_path / "r.parquet"
    with pytest.raises(InputError, match=words):
        simulate(driven(tmp_path), 1, parameters=parameters, record_path=path)
    assert not list(tmp_path.glob("r.parquet*"))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("plase", "cannot record 'plase', nor is it a signal of specs/signals.toml; did you mean place"),
        ("zzz", "specs/signals.toml; valid: place, v; of its components: COMPONENT.VARIABLE, with position"),
        ("q_slew", "cannot record 'q_slew': it is a signal, but not here"),
        ("position.positon", "component position: no variable 'positon'; did you mean position"),
        ("tool.x", "has no component 'tool'"),
    ],
)
def test_wrong_names_to_record_are_refused(tmp_path: Path, name: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        simulate(driven(tmp_path), 1, record=[name])


def test_integer_parameters_take_whole_numbers_only(tmp_path: Path) -> None:
    system = load(tmp_path, liar_system(2), {"liar": liar(2, tmp_path)})
    with pytest.raises(InputError, match=r"parameter liar.trick = 1.5, but its type is Integer"):
        simulate(system, 1, parameters={"liar.trick": 1.5})


def test_unconnected_inputs_are_warned_of(tmp_path: Path) -> None:
    text = chain().replace(connection("decay.amount", "position.v"), "")
    system = load(tmp_path, text, ["decay", "position"])
    assert "input position.v is not connected and keeps its start value 0.25" in system.warnings
    np.testing.assert_allclose(simulate(system, 2).column("place"), [1.0, 1.0025, 1.005])


def test_many_runs_reuse_a_loaded_system(tmp_path: Path) -> None:
    system = load(tmp_path, OSCILLATOR, ["position", "speed"])
    ends = {simulate(system, 50, parameters={"speed.rate": r}).column("place")[-1] for r in (1.0, 2.0, 1.0)}
    assert len(ends) == 2


def test_progress_is_reported(tmp_path: Path) -> None:
    ticks: list[int] = []
    simulate(driven(tmp_path), 1000, progress=ticks.append)
    assert ticks == sorted(ticks)
    assert len(ticks) >= 3


@pytest.mark.parametrize("name", ["realtime", "limit_s"])
@pytest.mark.parametrize("value", [-1.0, math.nan])
def test_wrong_pace_and_limit_are_refused(tmp_path: Path, name: str, value: float) -> None:
    system, wrong = load(tmp_path, OSCILLATOR, ["position", "speed"]), cast("dict[str, Any]", {name: value})
    with pytest.raises(InputError, match=f"{name} is a .*, not {value:g}"):
        simulate(system, 5, record_path=tmp_path / "r.parquet", **wrong)
    assert not list(tmp_path.glob("r.parquet*"))


def test_last_inputs_show_no_internal_numbers_for_strings(tmp_path: Path) -> None:
    kinds = (("string", "String"), ("integer", "Integer"))
    ends = [connector(f"{k}_{way}", f"{way}put", t) for k, t in kinds for way in ("in", "out")]
    text = ssd(
        [component(name, "echo", *ends) for name in ("a", "b")],
        [connection(f"a.{k}_out", f"b.{k}_in") for k, _ in kinds],
    )
    system = load(tmp_path, text, {"echo": kit.build("echo", 2)})
    with pytest.raises(RunError) as caught:
        simulate(system, 5, faults=[Fault(target="b", kind="fail")])
    inputs = str(caught.value).splitlines()[1]
    assert "string_in = …" in inputs
    assert "integer_in = 1" in inputs
