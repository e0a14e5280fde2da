"""Scheduled execution: partitions run where their clocks tick, by priority, and announce others."""

import json
from pathlib import Path

import pytest

from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.overview import figures
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from specs.errors import InputError, RunError
from tests.orchestrator.beats import beats
from tests.orchestrator.systems import component, connection, connector, ssd, write_ssp

KIND = "ScheduledExecution"
EVERY_20_MS = '"constant" intervalDecimal="0.02"'
NEVER = {"b.go": 1e9}


def scheduled(folder: Path, k: str, p: str = "", priorities: tuple[int, int, int] = (0, 0, 0)) -> System:
    return load_system(beats(folder, k, p, KIND, priorities=priorities))


@pytest.mark.parametrize("trust", [True, False])
def test_partitions_run_at_their_times_with_the_inputs_of_the_instant(tmp_path: Path, trust: bool) -> None:
    system = scheduled(tmp_path, '"constant" intervalDecimal="0.04" shiftDecimal="0.02"')
    stimuli = Stimuli({n: {"u": float(n)} for n in range(6)})
    record = simulate(system, 6, stimuli, record=["beats.ticks", "beats.last", "beats.seen"], trust=trust)
    assert record.column("beats.ticks").tolist() == [0, 0, 1, 1, 2, 2, 3]  # at 0.02, 0.06, 0.1
    assert record.column("beats.last").tolist() == [0, 0, 0.02, 0.02, 0.06, 0.06, 0.1]
    assert record.column("beats.seen").tolist() == [0, 0, 1, 1, 3, 3, 5]


def test_times_inside_steps_are_met(tmp_path: Path) -> None:
    system = scheduled(tmp_path, '"changing"')
    given = {"beats.interval": 0.013, "beats.growth": 0.005}
    record = simulate(system, 5, parameters=given, record=["beats.ticks", "beats.last"], trust=True)
    assert record.column("beats.ticks").tolist() == [0, 1, 2, 3, 3, 4]
    assert record.column("beats.last") == pytest.approx([0, 0.013, 0.031, 0.054, 0.054, 0.082])


@pytest.mark.parametrize(("priorities", "order"), [((0, 1, 0), 12), ((2, 1, 0), 21), ((0, 0, 0), 12)])
def test_of_partitions_due_at_one_time_the_lower_number_runs_first(
    tmp_path: Path, priorities: tuple[int, int, int], order: int
) -> None:
    system = scheduled(tmp_path, EVERY_20_MS, EVERY_20_MS, priorities)
    record = simulate(system, 3, record=["beats.order"], trust=True)
    assert record.column("beats.order").tolist() == [0, order, order, order]


@pytest.mark.parametrize("trust", [True, False])
def test_a_partition_announces_a_countdown_which_runs_when_it_is_due(tmp_path: Path, trust: bool) -> None:
    system = scheduled(tmp_path, '"countdown"', EVERY_20_MS)
    record_ = ["beats.ticks", "beats.last", "beats.pticks", "beats.order"]
    given = {"beats.go": 2, "beats.interval": 0.013, "beats.growth": 1.0}
    record = simulate(system, 4, parameters=given, record=record_, trust=trust)
    assert record.column("beats.pticks").tolist() == [0, 1, 2, 3, 4]
    assert record.column("beats.ticks").tolist() == [0, 0, 1, 1, 1]  # p's second tick, 0.02, and 0.013
    assert record.column("beats.last")[-1] == pytest.approx(0.033)


def test_a_countdown_of_zero_runs_next_and_before_what_is_less_urgent(tmp_path: Path) -> None:
    given = {"beats.go": 1, "beats.interval": 0.0, "beats.growth": 1.0}
    for priorities, order in (((0, 1, 0), 21), ((1, 0, 0), 21)):
        system = scheduled(tmp_path, '"countdown"', EVERY_20_MS, priorities)
        record = simulate(system, 1, parameters=given, record=["beats.order"], trust=True)
        assert record.column("beats.order").tolist() == [0, order]


def test_what_the_standard_forbids_is_named(tmp_path: Path) -> None:
    twice = scheduled(tmp_path, '"changing"')
    with pytest.raises(RunError, match=r"the clock of value reference 10 ticks twice at t = 0\.01 s"):
        simulate(twice, 3, parameters={"beats.interval": 0.01, "beats.growth": -0.01}, trust=True)
    with pytest.raises(
        RunError, match="component beats failed in the step from t = 0 s: the FMU returned error"
    ):
        simulate(scheduled(tmp_path, EVERY_20_MS), 3, parameters={"beats.fault": 2}, trust=True)


def test_a_lock_that_is_not_given_back_is_said(tmp_path: Path) -> None:
    for trust in (True, False):
        statistics: dict = {}
        record = simulate(
            scheduled(tmp_path, EVERY_20_MS),
            3,
            parameters={"beats.fault": 1},
            trust=trust,
            statistics=statistics,
        )
        said = json.dumps(record.meta)
        assert "value reference 10 ends at t = 0 s with 1 preemption locks held" in said
        assert statistics["components"]["beats"]["warnings"] == 1


@pytest.mark.parametrize("trust", [True, False])
def test_output_clocks_tick_partitions_of_others_at_the_same_time(tmp_path: Path, trust: bool) -> None:
    ends = [
        *(connector(n, kind, "Clock") for n, kind in (("i", "input"), ("o", "output"))),
        *(connector(n, kind) for n, kind in (("w", "input"), ("y", "output"))),
    ]
    fmus = {
        "one": beats(tmp_path, '"changing"', kind=KIND, name="one"),
        "two": beats(tmp_path, '"countdown"', name="two"),
        "three": beats(tmp_path, '"countdown"', kind=KIND, name="three"),
    }
    parts = [component(name, source, *ends) for name, source in zip("abc", fmus, strict=True)]
    links = [connection(f"a.{out}", f"{to}.{into}") for to in "bc" for out, into in (("o", "i"), ("y", "w"))]
    text = ssd(parts, links, step="0.02", version="2.0")
    system = load_system(write_ssp(tmp_path, text, fmus))
    given = {"a.interval": 0.013, "a.growth": 0.005, **NEVER, "c.go": 1e9}
    names = [f"{name}.{column}" for name in "bc" for column in ("heard", "heard_at")]
    record = simulate(system, 5, parameters=given, record=names, trust=trust)
    for name in "bc":
        assert record.column(f"{name}.heard").tolist() == [0, 1, 2, 3, 3, 4]
        assert record.column(f"{name}.heard_at") == pytest.approx([0, 0.013, 0.031, 0.054, 0.054, 0.082])


def test_check_says_what_it_found(tmp_path: Path) -> None:
    found = figures(scheduled(tmp_path, '"countdown"', EVERY_20_MS, (3, 1, 0)))["components"][0]
    assert found["kind"] == "scheduled execution"
    k, p, i, o = ({c["name"]: c for c in found["clocks"]}[name] for name in "kpio")
    assert (k["interval"], k["priority"], k["ticks"]) == ("countdown", 3, "at times that its FMU tells")
    assert (p["interval_s"], p["shift_s"], p["priority"], p["ticks"]) == (0.02, 0.0, 1, "with the steps")
    assert (i["ticks"], o["ticks"], o["causality"]) == ("by connection", "by its FMU", "output")


def test_an_fmu_of_two_kinds_is_co_simulated_unless_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="offers no ScheduledExecution; it offers: CoSimulation"):
        load_system(beats(tmp_path, EVERY_20_MS), kind=KIND)
