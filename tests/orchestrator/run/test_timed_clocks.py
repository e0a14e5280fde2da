"""Clocks that tick at times of their own: when they tick, with what inputs, and what is refused."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from orchestrator.run.master import Master, Options
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.layout import lay_out
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from specs.errors import InputError, RunError
from tests.orchestrator.beats import FLAGS, beats
from tests.orchestrator.systems import component, connection, connector, ssd, write_ssp

RECORD = ["beats.ticks", "beats.last", "beats.x"]
CHANGING, COUNTDOWN, TUNABLE, FIXED = ('"changing"', '"countdown"', '"tunable"', '"fixed"')
STEP_S = 0.02


def run(
    fmu: Path, ticks: int, trust: bool = True, algorithm: str = "", **parameters: float
) -> tuple[list[float], list[float]]:
    """How often k had ticked at each tick of the system, and when last."""
    given = {f"beats.{name}": value for name, value in parameters.items()}
    chosen = algorithm or None
    record = simulate(load_system(fmu), ticks, parameters=given, record=RECORD, trust=trust, algorithm=chosen)
    assert record.column("beats.x") == pytest.approx([STEP_S * n for n in range(ticks + 1)], abs=1e-12)
    return record.column("beats.ticks").tolist(), record.column("beats.last").tolist()


def failed(fmu: Path, **parameters: float) -> str:
    given = {f"beats.{name}": value for name, value in parameters.items()}
    with pytest.raises(RunError) as caught:
        simulate(load_system(fmu), 5, parameters=given, trust=True)
    return str(caught.value)


@pytest.mark.parametrize("trust", [True, False])
@pytest.mark.parametrize("fraction", ["", ' supportsFraction="true"'])
def test_a_changing_clock_ticks_when_it_said_after_its_last_tick(
    tmp_path: Path, trust: bool, fraction: str
) -> None:
    fmu = beats(tmp_path, CHANGING + fraction)
    ticks, last = run(fmu, 5, trust, interval=0.013, growth=0.005)  # at 0.013, 0.031, 0.054, 0.082
    assert ticks == [0, 1, 2, 3, 3, 4]
    assert last == pytest.approx([0, 0.013, 0.031, 0.054, 0.054, 0.082])


def test_a_countdown_begins_where_the_fmu_knows_it(tmp_path: Path) -> None:
    fmu = beats(tmp_path, COUNTDOWN)
    ticks, last = run(fmu, 6, go=2, interval=0.033)  # known at 0.04: ticks at 0.073, and 0.033 after each
    assert ticks == [0, 0, 0, 0, 1, 1, 2]
    assert last == pytest.approx([0, 0, 0, 0, 0.073, 0.073, 0.106])


def test_a_countdown_of_zero_ticks_in_the_same_instant_and_one_without_end_is_named(tmp_path: Path) -> None:
    fmu = beats(tmp_path, CHANGING)
    ticks, last = run(fmu, 3, interval=0.0, growth=0.015)  # at 0, 0.015, 0.045
    assert (ticks, last) == ([0, 2, 2, 3], pytest.approx([0, 0.015, 0.015, 0.045]))
    for endless in (fmu, beats(tmp_path, COUNTDOWN)):
        message = failed(endless, interval=0.0)
        assert (
            "component beats failed in the step from t = 0 s: at t = 0 s clock k ticks without end" in message
        )


def test_fixed_and_tunable_clocks_without_a_stated_interval_are_asked_for_it(tmp_path: Path) -> None:
    for kind in (FIXED, TUNABLE, FIXED + ' supportsFraction="true"'):
        ticks, last = run(beats(tmp_path, kind), 5, interval=0.025, shift=0.03)  # at 0.03, 0.055, 0.08
        assert ticks == [0, 0, 1, 2, 2, 3]
        assert last == pytest.approx([0, 0, 0.03, 0.055, 0.055, 0.08])


def test_a_tuned_interval_counts_from_where_it_was_tuned(tmp_path: Path) -> None:
    system = load_system(beats(tmp_path, TUNABLE))
    changes = {3: {"beats.period": 0.01}}
    given = {"beats.interval": 0.05, "beats.shift": 0.05}
    record = simulate(
        system, 6, parameters=given, record=RECORD, trust=True, changes=changes
    )  # at 0.05; tuned at 0.06: 0.07, 0.08, 0.09, …
    assert record.column("beats.ticks").tolist() == [0, 0, 0, 1, 2, 4, 6]


def test_a_stated_interval_that_is_no_whole_step_divides_the_step(tmp_path: Path) -> None:
    stated = '"constant" intervalDecimal="0.03" shiftDecimal="0.01"'
    ticks, last = run(beats(tmp_path, stated), 5)  # at 0.01, 0.04, 0.07
    assert ticks == [0, 1, 1, 2, 3, 3]
    assert last == pytest.approx([0, 0.01, 0.01, 0.04, 0.07, 0.07])
    with pytest.raises(
        InputError, match=r"no whole multiples of its step, 0\.02 s, and its FMU allows no other"
    ):
        load_system(beats(tmp_path, stated, flags='hasEventMode="true"'))


def test_a_tick_at_a_whole_step_sees_the_inputs_of_that_instant_and_one_inside_those_of_the_step(
    tmp_path: Path,
) -> None:
    system = load_system(beats(tmp_path, CHANGING))
    stimuli = Stimuli({n: {"u": float(n)} for n in range(6)})
    record = simulate(
        system, 5, parameters={"beats.interval": 0.04, "beats.growth": -0.01}, record=["beats.seen"],
        trust=True, stimuli=stimuli,
    )  # at 0.04 (u = 2), 0.07 (u = 3), 0.09 (u = 4)  # fmt: skip
    assert record.column("beats.seen").tolist() == [0, 0, 0, 2, 3, 4]


@pytest.mark.parametrize("algorithm", ["gauss-seidel", "iterate", "adaptive"])
def test_steps_that_are_taken_back_take_their_clocks_back(tmp_path: Path, algorithm: str) -> None:
    fmu = beats(tmp_path, CHANGING)
    expected = run(fmu, 8, interval=0.013, growth=0.002)
    found = run(fmu, 8, algorithm=algorithm, interval=0.013, growth=0.002)
    assert found[0] == expected[0]
    assert found[1] == pytest.approx(expected[1])


def test_each_sweep_of_iterate_samples_what_was_there_at_the_tick(tmp_path: Path) -> None:
    ends = [*(connector(n, "input") for n in "uw"), connector("x", "output")]
    fmus = {"one": beats(tmp_path, '"constant" intervalDecimal="0.02"', name="one")}
    parts = [component(name, "one", *ends) for name in "ab"]
    links = [connection("a.x", f"b.{name}") for name in "uw"]  # w moves with every step, and is iterated
    text = ssd(parts, links, step=str(STEP_S), version="2.0")
    statistics: dict = {}
    record = simulate(
        load_system(write_ssp(tmp_path, text, fmus)), 4, record=["b.seen"], trust=True, algorithm="iterate",
        statistics=statistics,
    )  # fmt: skip
    assert statistics["sweeps"] > 4
    assert record.column("b.seen") == pytest.approx([0, 0, 0.02, 0.04, 0.06])


def test_a_countdown_that_waits_for_ever_is_said(tmp_path: Path) -> None:
    system = load_system(beats(tmp_path, COUNTDOWN))
    said = [
        simulate(system, 3, parameters={"beats.go": go}, trust=True).meta.get("messages") for go in (9, 3)
    ]  # known at 0.18 s, and at 0.06 s, the end
    assert said == [{"beats": ["countdown clock k never ticked: the FMU did not tell an interval"]}, None]


@pytest.mark.parametrize(
    ("kind", "given", "words"),
    [
        (CHANGING, {"interval": -0.01}, "t = 0 s the FMU tells of changing clock k an interval of -0.01 s"),
        (COUNTDOWN, {"fault": 3}, "countdown clock k an interval of nan s; valid: intervals of 0 or more"),
        (COUNTDOWN, {"growth": -0.006}, "at t = 0.014 s the FMU tells of countdown clock k an interval of -"),
        (CHANGING, {"fault": 4}, "changing clock k an interval of inf s"),
        (TUNABLE, {"interval": 0.0}, "tunable clock k an interval of 0 s; valid: positive intervals"),
        (FIXED, {"interval": 1e-12}, "fixed clock k an interval of 1e-12 s"),
        (FIXED, {"shift": -1.0}, "fixed clock k a shift of -1 s"),
        (CHANGING, {"qualifier": 0}, "changing clock k that its interval is not yet known"),
        (CHANGING, {"qualifier": 7}, "its interval with the unknown qualifier 7"),
        (CHANGING, {"interval": 1e-9, "growth": 0.0}, "s clock k ticks without end"),
    ],
)  # fmt: skip
def test_times_at_which_no_clock_ticks_are_refused_by_component_clock_and_time(
    tmp_path: Path, kind: str, given: Mapping[str, float], words: str
) -> None:
    message = failed(beats(tmp_path, kind), **given)
    assert "component beats" in message
    assert words in message


def test_a_tick_inside_a_step_needs_an_fmu_that_can_divide_it(tmp_path: Path) -> None:
    only_events = beats(tmp_path, CHANGING, flags='hasEventMode="true"')
    message = failed(only_events, interval=0.03)
    assert "clock k ticks at t = 0.03 s, inside a step" in message
    assert "canHandleVariableCommunicationStepSize" in message
    assert run(only_events, 4, interval=0.04)[0] == [0, 0, 0, 1, 1]
    internal = beats(tmp_path, CHANGING, flags=FLAGS + ' fixedInternalStepSize="0.004"')
    assert run(internal, 4, interval=0.028, growth=0.004)[1] == pytest.approx([0, 0, 0.028, 0.028, 0.06])
    assert "only in steps of 0.004 s" in failed(internal, interval=0.0141)


def test_a_run_goes_on_from_a_snapshot_to_the_bit(tmp_path: Path) -> None:
    system = load_system(beats(tmp_path, CHANGING))
    start = system.start_values({"beats.interval": 0.013, "beats.growth": 0.003})
    layout = lay_out(system, ["beats.ticks", "beats.last"])

    def values(master: Master) -> list[float]:
        return master.instances[0].get("ticks", "last", "x").tolist()

    with Master(system, layout, start, Options(trust=True)) as master:
        master.initialise()
        master.run(4)
        data = master.snapshot()
        master.run(11)
        expected = values(master)
    with Master(system, layout, start, Options(trust=True)) as master:
        master.initialise()
        master.run(1)
        master.restore(data)
        master.run(11)
        assert values(master) == expected


# ---- beside connected clocks ----


def pair(
    folder: Path, k: str, algorithm: str = "jacobi", flags: str = FLAGS, listener: str = FLAGS
) -> System:
    """a's k ticks a's o, which ticks b's i; b's k never ticks."""
    ends = [
        *(connector(n, kind, "Clock") for n, kind in (("i", "input"), ("o", "output"))),
        *(connector(n, kind) for n, kind in (("u", "input"), ("w", "input"), ("y", "output"))),
    ]
    fmus = {
        "one": beats(folder, k, name="one", flags=flags),
        "two": beats(folder, COUNTDOWN, name="two", flags=listener),
    }
    parts = [component("a", "one", *ends), component("b", "two", *ends)]
    links = [connection("a.o", "b.i"), connection("a.y", "b.w")]
    text = ssd(parts, links, step=str(STEP_S), version="2.0")
    text = text.replace(f'stepSize="{STEP_S}"', f'stepSize="{STEP_S}" algorithm="{algorithm}"')
    return load_system(write_ssp(folder, text, fmus))


PAIR = ["a.ticks", "a.last", "b.heard", "b.heard_at", "a.x", "b.x"]
NEVER = {"b.go": 1e9}


@pytest.mark.parametrize("trust", [True, False])
@pytest.mark.parametrize("kind", [CHANGING, COUNTDOWN])
def test_what_a_told_clock_ticks_in_another_fmu_ticks_at_the_same_time(
    tmp_path: Path, kind: str, trust: bool
) -> None:
    given = {"a.interval": 0.013, "a.growth": 0.005, **NEVER}
    record = simulate(pair(tmp_path, kind), 5, parameters=given, record=PAIR, trust=trust)
    assert record.column("a.ticks").tolist() == [0, 1, 2, 3, 3, 4]
    assert record.column("b.heard").tolist() == [0, 1, 2, 3, 3, 4]
    assert record.column("b.heard_at") == pytest.approx([0, 0.013, 0.031, 0.054, 0.054, 0.082])
    for name in "ab":
        assert record.column(f"{name}.x") == pytest.approx([STEP_S * n for n in range(6)])


def test_all_that_are_connected_must_be_able_to_divide_their_steps(tmp_path: Path) -> None:
    system = pair(tmp_path, CHANGING, listener='hasEventMode="true"')
    with pytest.raises(RunError) as caught:
        simulate(system, 5, parameters={"a.interval": 0.013, **NEVER}, trust=True)
    assert "component b" in str(caught.value)
    assert "a clock of another component that it is connected with ticks at t = 0.013 s" in str(caught.value)
    with pytest.raises(InputError, match="algorithm 'gauss-seidel' cannot divide; valid: jacobi"):
        pair(tmp_path, CHANGING, "gauss-seidel")


def test_a_clock_that_ticks_too_often_beside_others_is_named(tmp_path: Path) -> None:
    with pytest.raises(
        RunError, match=r"component a failed in the step from t = 0 s: at t = .* s clock k ticks"
    ):
        simulate(pair(tmp_path, CHANGING), 1, parameters={"a.interval": 1e-9, **NEVER}, trust=True)
