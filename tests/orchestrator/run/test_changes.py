"""Parameters that change during a run, against the closed form on both sides of the change."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator.run.simulate import simulate
from orchestrator.system.system import System
from specs.errors import InputError
from tests.orchestrator.systems import OSCILLATOR, component, connection, connector, load, ssd

STEP, N = 0.01, 300


@pytest.fixture(scope="module", params=[2, 3], ids=["fmi2", "fmi3"])
def decay(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> System:
    """exp(-rate t)"""
    text = ssd(
        [component("decay", "decay", connector("amount", "output"))],
        [connection("decay.amount", "amount")],
        [connector("amount", "output")],
        step=str(STEP),
    )
    return load(tmp_path_factory.mktemp("decay"), text, ["decay"], request.param)


def test_from_its_tick_on_the_new_value_holds(decay: System) -> None:
    record = simulate(decay, N, changes={100: {"decay.rate": 3.0}, 200: {"decay.rate": 0.0}})
    t = record.time
    exponent = np.clip(t, 0.0, 1.0) + 3.0 * np.clip(t - 1.0, 0.0, 1.0)
    assert np.allclose(record.column("amount"), np.exp(-exponent), rtol=1e-6)
    assert record.meta["changes"] == {"100": {"decay.rate": 3.0}, "200": {"decay.rate": 0.0}}


def test_a_change_at_the_beginning_and_one_after_the_end(decay: System) -> None:
    record = simulate(
        decay, N, changes={0: {"decay.rate": 2.0}, N: {"decay.rate": 0.0}, N + 9: {"decay.rate": 1.0}}
    )
    assert np.allclose(record.column("amount"), np.exp(-2.0 * record.time), rtol=1e-6)


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss-seidel", "iterate"])
def test_every_algorithm_changes_it_once(tmp_path: Path, algorithm: str) -> None:
    """A step that is taken back keeps the change: the oscillator's rate drops to 0, its speed stays."""
    system = load(tmp_path, OSCILLATOR, ["position", "speed"])
    record = simulate(system, N, changes={100: {"speed.rate": 0.0}}, algorithm=algorithm)
    pace = record.column("pace")
    assert np.ptp(pace[:101]) > 0.5
    assert np.ptp(pace[100:]) == 0.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({5: {"decay.rat": 1.0}}, r"decay\.rat.*rate"),
        ({5: {"decoy.rate": 1.0}}, r"decoy\.rate.*decay"),
        ({5: {"rate": 1.0}}, r"'rate' is not of the form component\.variable"),
        ({5: {"decay.rate": 11.0}}, r"decay\.rate = 11 .*out of bounds; valid: 0 … 10"),
        ({5: {"decay.rate": float("nan")}}, r"decay\.rate"),
        ({5: {"decay.rate": "much"}}, r"decay\.rate"),
        ({5: {"decay.amount": 1.0}}, r"decay\.amount cannot change during a run.*rate"),
        ({-1: {"decay.rate": 1.0}}, r"-1"),
    ],
)
def test_mistakes_are_refused_before_the_run(
    decay: System, tmp_path: Path, change: dict[int, dict[str, Any]], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        simulate(decay, N, changes=change, record_path=tmp_path / "run.parquet")
    assert list(tmp_path.iterdir()) == []
