"""Model exchange: states integrated by CVODE, against analytic and high-order solutions; events; bad FMUs."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.stimuli import Stimuli
from records.record import Record
from specs.errors import InputError, RunError
from tests.orchestrator.exchange import (
    BALL,
    BROKEN,
    CHATTER,
    ENDLESS,
    LAG,
    OSCILLATOR,
    PAST,
    STAIR,
    WATCHED,
    exchange,
)
from tests.orchestrator.systems import component, connection, connector, fmu, load, ssd

VERSIONS = pytest.mark.parametrize("fmi_version", [2, 3])


def run(
    folder: Path,
    fmi_version: int,
    kind: int,
    ticks: int = 300,
    record: Sequence[str] = ("x", "v", "count"),
    **more: Any,
) -> Record:
    system = load_system(exchange(fmi_version, folder), more.pop("step_s", None))
    return simulate(system, ticks, parameters={"exchange.kind": kind}, record=list(record), **more)


@VERSIONS
def test_the_oscillator_follows_a_solution_of_higher_order(tmp_path: Path, fmi_version: int) -> None:
    record = run(tmp_path, fmi_version, OSCILLATOR, 2000, trust=True)
    exact = solve_ivp(
        lambda _, y: [y[1], (1 - y[0] ** 2) * y[1] - y[0]],
        (0, 20),
        [2, 0],
        method="DOP853",
        rtol=1e-11,
        atol=1e-12,
        t_eval=record.time,
    )
    assert np.abs(record.column("x") - exact.y[0]).max() < 5e-4
    finer = run(tmp_path, fmi_version, OSCILLATOR, 2000, trust=True, tell_tolerance=1e-9)
    assert np.abs(finer.column("x") - exact.y[0]).max() < 2e-6


def ball(t: np.ndarray) -> np.ndarray:
    """Height of the ball dropped from 1 m at each time, by its bounces."""
    height = np.empty_like(t)
    begin, speed = -math.sqrt(2 / 9.81), math.sqrt(2 * 9.81)
    for i, time in enumerate(t):
        while speed > 0.0 and time > begin + 2 * speed / 9.81:
            begin, speed = begin + 2 * speed / 9.81, 0.7 * speed
            speed = 0.0 if speed < 0.1 else speed
        height[i] = speed * (time - begin) - 9.81 / 2 * (time - begin) ** 2 if speed else 0.0
    return height


@VERSIONS
@pytest.mark.parametrize("trust", [True, False])
def test_the_ball_bounces_and_comes_to_rest(tmp_path: Path, fmi_version: int, trust: bool) -> None:
    record = run(tmp_path, fmi_version, BALL, trust=trust)
    assert np.abs(record.column("x") - ball(record.time)).max() < 2e-5
    assert record.column("count")[-1] == 11
    assert record.column("x")[-1] == record.column("v")[-1] == 0.0


@VERSIONS
@pytest.mark.parametrize("step", [0.01, 0.7, 2.5])
def test_time_events_are_met_whatever_the_step(tmp_path: Path, fmi_version: int, step: float) -> None:
    record = run(tmp_path, fmi_version, STAIR, 3, trust=True, step_s=step)
    whole = np.floor(record.time + 1e-9)
    expected = whole * (whole - 1) / 2 + whole * (record.time - whole)
    assert record.column("count").tolist() == whole.tolist()
    assert np.abs(record.column("x") - expected).max() < 1e-6


@VERSIONS
def test_an_input_is_held_between_communication_points(tmp_path: Path, fmi_version: int) -> None:
    stimuli = Stimuli({10: {"u": 1.0}, 20: {"u": 1.0}, 30: {"u": 0.0}})
    record = run(tmp_path, fmi_version, LAG, 60, ("x", "y"), trust=True, step_s=0.1, stimuli=stimuli)
    t, x = record.time, record.column("x")
    rising = 1 - np.exp(-(t - 1.0))
    falling = (1 - math.exp(-2.0)) * np.exp(-(t - 3.0))
    assert np.abs(x - np.where(t < 1.0, 0.0, np.where(t < 3.0, rising, falling))).max() < 1e-5


@VERSIONS
def test_steps_of_the_solver_go_past_communication_points(tmp_path: Path, fmi_version: int) -> None:
    """A state that rests needs no step at each of the 300 communication points."""
    assert run(tmp_path, fmi_version, WATCHED, trust=True).column("count")[-1] < 30


@VERSIONS
@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (ENDLESS, "events without end (Zeno): 50 in a row less than 2.5533e-09 s apart at t = 2.5532986"),
        (BROKEN, "der(v) is not a number at t = 0.5"),
        (PAST, "the next event is to be at t = 0.25 s, which has passed, also after 50 events at t = 0.5 s"),
        (CHATTER, "the event at t = 0.5 s never ends: after 1000 iterations it wants another"),
    ],
)
def test_what_cannot_go_on_is_named_and_the_record_kept(
    tmp_path: Path, fmi_version: int, kind: int, words: str
) -> None:
    with pytest.raises(RunError, match="component exchange failed in the step from t = ") as failure:
        run(tmp_path, fmi_version, kind, record_path=tmp_path / "kept.parquet")
    assert words in str(failure.value)
    assert (tmp_path / "kept.parquet").is_file()


def in_system(folder: Path, implementation: str = ' implementation="ModelExchange"') -> str:
    """A lag that drives the model `position` (co-simulation) beside it."""
    text = ssd(
        [
            component("lag", "exchange", connector("u", "input"), connector("x", "output")),
            component("next", "position", connector("v", "input"), connector("position", "output")),
        ],
        [connection("u", "lag.u"), connection("lag.x", "next.v"), connection("next.position", "s")],
        [connector("u", "input"), connector("s", "output")],
    )
    return text.replace('name="lag"', f'name="lag"{implementation}', 1)


@VERSIONS
def test_both_kinds_in_one_system(tmp_path: Path, fmi_version: int) -> None:
    files = {"exchange": exchange(fmi_version, tmp_path), "position": fmu("position")}
    system = load(tmp_path, in_system(tmp_path), files)
    record = simulate(
        system,
        100,
        parameters={"lag.kind": LAG},
        stimuli=Stimuli({0: {"u": 1.0}}),
        record=["lag.x", "s"],
    )
    assert record.column("lag.x")[-1] == pytest.approx(1 - math.exp(-1.0), abs=2e-5)
    assert record.column("s")[-1] == pytest.approx(1 + math.exp(-1.0), abs=0.01)


@pytest.mark.parametrize("algorithm", ["iterate", "adaptive"])
def test_steps_of_it_are_taken_back(tmp_path: Path, algorithm: str) -> None:
    lag = (connector("u", "input"), connector("x", "output"))
    text = ssd(
        [component("lag", "exchange", *lag), component("next", "exchange", *lag)],
        [connection("u", "lag.u"), connection("lag.x", "next.u"), connection("next.x", "x")],
        [connector("u", "input"), connector("x", "output")],
    )
    statistics: dict[str, Any] = {}
    record = simulate(
        load(tmp_path, text, {"exchange": exchange(3, tmp_path)}),
        100,
        algorithm=algorithm,
        parameters={"lag.kind": LAG, "next.kind": LAG},
        stimuli=Stimuli({0: {"u": 1.0}}),
        record=["lag.x", "x"],
        trust=True,
        statistics=statistics,
    )
    assert statistics["components"]["lag"]["rollbacks"] > 0
    assert record.column("lag.x")[-1] == pytest.approx(1 - math.exp(-1.0), abs=5e-4)
    assert record.column("x")[-1] == pytest.approx(1 - 2 * math.exp(-1.0), abs=0.01)


def test_a_kind_that_is_not_offered_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="offers no CoSimulation; it offers: ModelExchange"):
        load_system(exchange(3, tmp_path), kind="CoSimulation")
    files = {"exchange": exchange(3, tmp_path), "position": fmu("position")}
    with pytest.raises(InputError, match="offers no CoSimulation"):
        load(tmp_path, in_system(tmp_path, ' implementation="CoSimulation"'), files)


def rewritten(folder: Path, fmi_version: int, old: str, new: str) -> Path:
    """The FMU with another list of derivatives."""
    path, changed = exchange(fmi_version, folder), folder / "changed.fmu"
    with ZipFile(path) as before, ZipFile(changed, "w") as after:
        for name in before.namelist():
            content = before.read(name).decode("latin-1")
            after.writestr(
                name, (content.replace(old, new) if name.endswith(".xml") else content).encode("latin-1")
            )
    return changed


RATES2 = '<Derivatives><Unknown index="3"/><Unknown index="5"/></Derivatives>'
RATES3 = '<ContinuousStateDerivative valueReference="2"/><ContinuousStateDerivative valueReference="4"/>'


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        (
            "",
            "",
            "ModelStructure lists no derivative, but there is der\\(x\\), der\\(v\\): no state would move",
        ),
        (2, 2, "ModelStructure lists the derivative der\\(x\\) twice"),
        (2, 6, "ModelStructure lists mu as a derivative; it is of causality parameter"),
    ],
)
@VERSIONS
def test_lists_of_derivatives_that_cannot_be(
    tmp_path: Path, fmi_version: int, first: int, second: int, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        load_system(with_rates(tmp_path, fmi_version, first, second))


@VERSIONS
def test_a_derivative_that_is_not_listed_gives_a_warning(tmp_path: Path, fmi_version: int) -> None:
    system = load_system(with_rates(tmp_path, fmi_version, 2))
    assert any("does not list der(v) among the derivatives" in text for text in system.warnings)
    assert not any("derivatives" in text for text in load_system(exchange(fmi_version, tmp_path)).warnings)


def with_rates(folder: Path, fmi_version: int, *numbers: int | str) -> Path:
    """The FMU with the variables of other value references listed as derivatives; "" stands for none."""
    if fmi_version == 2:
        listed = "".join(f'<Unknown index="{int(n) + 1}"/>' for n in numbers if n)
        return rewritten(folder, 2, RATES2, f"<Derivatives>{listed}</Derivatives>")
    listed = "".join(f'<ContinuousStateDerivative valueReference="{n}"/>' for n in numbers if n)
    return rewritten(folder, 3, RATES3, listed)
