"""Faults in whole runs: what arrives, under every algorithm, is what the arithmetic of the fault says."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator.run.master import Master, Options
from orchestrator.run.simulate import simulate
from orchestrator.ssp.description import ALGORITHMS
from orchestrator.system.layout import lay_out
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from records.record import Record, read
from specs.errors import InputError, RunError
from specs.faults import Fault, seed_of
from tests.orchestrator.core.core_probe import CFault
from tests.orchestrator.systems import component, connection, connector, load, ssd

STEP, N, SEED = 0.02, 300, 5
V = np.sin(np.arange(N + 1) * 0.07)
DRIVE = Stimuli({tick: {"v": float(v)} for tick, v in enumerate(V)})


def fault(
    kind: str, target: str = "position.v", start_s: float = 0.5, end_s: float | None = 2.0, **own: Any
) -> Fault:
    return Fault(target=target, kind=kind, start_s=start_s, end_s=end_s, **own)


ONE_OF_EACH = [
    fault("stuck"),
    fault("stuck", value=7.0),
    fault("bias", value=0.25),
    fault("drift", rate_per_s=0.5),
    fault("noise", std=0.3),
    fault("delay", delay_s=0.1),
    fault("dropout", probability=0.3),
    fault("dropout", probability=0.1, mean_ticks=8.0),
    fault("spike", probability=0.1, size=2.0),
    fault("quantise", step=0.1),
    fault("scale", factor=-1.5),
    fault("saturate", low=-0.5, high=0.75),
]
each = pytest.mark.parametrize(
    "of", ONE_OF_EACH, ids=lambda f: str(f).replace(" on position.v, 0.5 s to 2 s", "")
)


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> System:
    """position, its speed a system input; and a second one on the same source."""
    twin = component("twin", "position", connector("v", "input"), connector("position", "output"))
    return load(
        tmp_path_factory.mktemp("system"),
        ssd(
            [
                component("position", "position", connector("v", "input"), connector("position", "output")),
                twin,
            ],
            [
                connection("v", "position.v"),
                connection("v", "twin.v"),
                connection("position.position", "place"),
                connection("twin.position", "other"),
            ],
            [connector("v", "input"), connector("place", "output"), connector("other", "output")],
            step=str(STEP),
        ),
        ["position"],
    )


def arrived(record: Record, name: str = "place") -> np.ndarray:
    """What the integrator must have got in each step."""
    return np.diff(record.column(name)) / STEP


def expected(of: Fault, x: np.ndarray = V[:-1], number: int = 0) -> np.ndarray:
    return CFault(of, seed_of(of, SEED, number), STEP).run(x)


@each
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_what_arrives_is_what_the_fault_says(system: System, of: Fault, algorithm: str) -> None:
    record = simulate(system, N, DRIVE, algorithm=algorithm, seed=SEED, faults=[of])
    assert np.allclose(arrived(record), expected(of), atol=1e-9)
    assert np.allclose(arrived(record, "other"), V[:-1], atol=1e-9)  # nothing else that reads the source
    assert np.array_equal(record.column("v"), V)
    assert record.meta["faults"] == [of.as_dict()]


def test_several_faults_act_in_order(system: System) -> None:
    faults = [fault("scale", factor=2.0), fault("bias", value=1.0), fault("noise", std=0.1)]
    record = simulate(system, N, DRIVE, seed=SEED, faults=faults)
    y = V[:-1]
    for number, of in enumerate(faults):
        y = expected(of, y, number)
    assert np.allclose(arrived(record), y, atol=1e-9)


def test_a_fault_on_an_output_of_the_system_is_in_the_record_only(system: System) -> None:
    of = fault("bias", "place", value=3.0)
    plain, record = (simulate(system, N, DRIVE, seed=SEED, faults=f) for f in ([], [of]))
    shift = record.column("place") - plain.column("place")
    assert np.allclose(
        shift, np.where((np.arange(N + 1) >= 25) & (np.arange(N + 1) < 100), 3.0, 0.0), atol=1e-12
    )


def test_a_fault_on_an_input_of_the_system_reaches_all_that_read_it(system: System) -> None:
    of = fault("noise", "v", std=0.5)
    record = simulate(system, N, DRIVE, seed=SEED, faults=[of])
    assert np.allclose(arrived(record), expected(of), atol=1e-9)
    assert np.allclose(arrived(record, "other"), expected(of), atol=1e-9)


def test_the_seed_of_the_run_decides_the_noise(system: System) -> None:
    of = fault("noise", std=0.5)
    hashes = [simulate(system, N, DRIVE, seed=s, faults=[of]).run_hash for s in (1, 1, 2)]
    assert hashes[0] == hashes[1] != hashes[2]


def test_a_component_that_fails_ends_the_run(system: System, tmp_path: Path) -> None:
    of = Fault(target="twin", kind="fail", start_s=1.0)
    with pytest.raises(RunError, match=r"component twin failed in the step from t = 1 s: .*scenario"):
        simulate(system, N, DRIVE, record_path=tmp_path / "run.parquet", faults=[of])
    record = read(tmp_path / "run.parquet")
    assert (len(record), record.complete) == (51, False)


@pytest.mark.parametrize(
    ("of", "words"),
    [
        (fault("stuck", "positon.v"), r"positon.*position"),
        (fault("stuck", "position.w"), r"position\.w: .*position\.v"),
        (fault("stuck", "plaice"), r"plaice.*place"),
        (fault("stuck", "position.position"), r"position\.position"),
        (fault("fail", "positon", end_s=None), r"positon.*position"),
        (fault("bias", start_s=0.51, value=1.0), r"start_s = 0\.51: not a multiple of the step"),
    ],
)
def test_a_fault_on_what_is_not_there_is_refused_before_the_run(
    system: System, tmp_path: Path, of: Fault, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        simulate(system, N, DRIVE, record_path=tmp_path / "run.parquet", faults=[of])
    assert list(tmp_path.iterdir()) == []


def test_from_the_first_tick_on(system: System) -> None:
    """What initialisation exchanged is no tick: the first value is that of the first step."""
    for of in (fault("stuck", start_s=0.0), fault("delay", start_s=0.0, delay_s=0.1)):
        record = simulate(system, N, DRIVE, seed=SEED, faults=[of])
        assert np.allclose(arrived(record), expected(of), atol=1e-9)


def test_an_output_that_is_not_recorded_may_be_faulty(system: System) -> None:
    record = simulate(
        system, 10, DRIVE, record=["v"], faults=[fault("bias", "place", start_s=0.0, value=1.0)]
    )
    assert record.names == ["time", "v"]


def test_memory_and_disk_have_one_hash(system: System, tmp_path: Path) -> None:
    of = [fault("noise", std=1.0)]
    memory = simulate(system, N, DRIVE, seed=SEED, faults=of)
    disk = simulate(system, N, DRIVE, seed=SEED, faults=of, record_path=tmp_path / "run.parquet")
    assert len(memory.run_hash) == 64
    assert memory.run_hash == disk.run_hash == disk.computed_hash()
    assert simulate(system, N, DRIVE, seed=SEED).run_hash != memory.run_hash


def test_a_fault_of_the_system_description_is_one_of_the_run(tmp_path: Path) -> None:
    text = ssd(
        [component("position", "position", connector("v", "input"), connector("position", "output"))],
        [connection("v", "position.v"), connection("position.position", "place")],
        [connector("v", "input"), connector("place", "output")],
        step=str(STEP),
    ).replace(
        f'stepSize="{STEP}"/>',
        f'stepSize="{STEP}"><slw:Fault target="position.v" kind="bias" start_s="0.5" end_s="2" value="0.25"/>'
        "</slw:Simulation>",
    )
    record = simulate(load(tmp_path, text, ["position"]), N, DRIVE)
    assert np.allclose(arrived(record), expected(fault("bias", value=0.25)), atol=1e-9)
    assert record.meta["faults"] == [fault("bias", value=0.25).as_dict()]


def test_a_fault_on_a_converted_input_of_the_system_must_name_where_it_arrives(tmp_path: Path) -> None:
    """Else 1 mm/s too much would be 1 m/s too much."""
    text = ssd(
        [component("position", "position", connector("v", "input", unit="m/s"))],
        [connection("v", "position.v", '<ssc:LinearTransformation factor="0.001"/>')],
        [connector("v", "input", unit="m/s")],
    )
    with pytest.raises(
        InputError, match=r"on v: it is converted .* position\.v; state the fault on position\.v"
    ):
        simulate(load(tmp_path, text, ["position"]), 1, faults=[fault("bias", "v", value=1.0)])


@each
def test_a_restored_snapshot_goes_on_with_what_the_fault_remembers(system: System, of: Fault) -> None:
    layout = lay_out(system, ["place"])
    options = Options(faults=[of], stimuli=DRIVE.changes, seed=SEED)

    def master() -> Master:
        return Master(system, layout, system.start_values({}), options)

    def go_on(run: Master) -> np.ndarray:
        run.run(N)
        return run.plan.reals.copy()

    with master() as first, master() as other:
        first.initialise()
        first.run(60)  # while the fault acts
        state = first.snapshot()
        end = go_on(first)
        first.restore(state)
        assert np.array_equal(go_on(first), end)
        other.initialise()
        other.run(7)
        other.restore(state)
        assert np.array_equal(go_on(other), end)


def test_a_delay_before_a_component_of_another_rate_counts_ticks_of_the_system(tmp_path: Path) -> None:
    """position steps every fifth tick: what was sent seven ticks before arrives then, and holds."""
    text = ssd(
        [component("position", "position", connector("v", "input"), connector("position", "output"))],
        [connection("v", "position.v"), connection("position.position", "place")],
        [connector("v", "input"), connector("place", "output")],
        step=str(STEP),
    ).replace(
        f'stepSize="{STEP}"/>',
        f'stepSize="{STEP}"><slw:Component name="position" stepSize="{5 * STEP}"/></slw:Simulation>',
    )
    of = fault("delay", start_s=0.0, end_s=None, delay_s=7 * STEP)
    record = simulate(load(tmp_path, text, ["position"]), N, DRIVE, faults=[of])
    steps = np.diff(record.column("place")[::5]) / (5 * STEP)
    assert np.allclose(steps[2:], V[3 : N - 7 : 5][: len(steps) - 2], atol=1e-9)
    assert np.allclose(steps[:2], V[0], atol=1e-9)
