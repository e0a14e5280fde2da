"""The binding of FMUs: state, serialisation and derivatives, in both FMI versions."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from orchestrator.fmi.instance import Instance
from specs.errors import InputError, RunError
from tests.orchestrator.systems import OSCILLATOR, load


@pytest.fixture(params=[2, 3])
def speed(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Instance]:
    """An instance of v' = -rate² x in step mode, rate = 2."""
    system = load(tmp_path, OSCILLATOR, ["position", "speed"], request.param)
    instance = Instance(system.components["speed"])
    instance.set(rate=2.0)
    instance.enter_initialisation()
    instance.exit_initialisation()
    instance.files = system  # type: ignore[attr-defined]  # keeps the unpacked FMU
    yield instance
    instance.free()


def steps(instance: Instance, count: int, x: float = 1.0) -> list[float]:
    """Speed after each of `count` steps of 0.01 s with input x."""
    found = []
    instance.set(x=x)
    for _ in range(count):
        instance.step(0.0, 0.01)
        found.append(float(instance.get("speed")[0]))
    return found


def test_stepping_integrates(speed: Instance) -> None:
    assert steps(speed, 3) == pytest.approx([-0.04, -0.08, -0.12], abs=1e-13)


def test_a_restored_state_has_the_same_future(speed: Instance) -> None:
    steps(speed, 5)
    state = speed.get_state()
    future = steps(speed, 4)
    speed.set_state(state)
    assert steps(speed, 4) == future
    speed.free_state(state)


def test_a_state_survives_as_bytes(speed: Instance) -> None:
    steps(speed, 5)
    state = speed.get_state()
    data = speed.serialize_state(state)
    future = steps(speed, 4)
    other = speed.deserialize_state(data)
    speed.set_state(other)
    assert steps(speed, 4) == future
    for s in (state, other):
        speed.free_state(s)


def test_bytes_that_are_no_state_are_refused_with_the_words_of_the_fmu(speed: Instance) -> None:
    with pytest.raises(RunError, match=r"component speed: deserialize returned error \(.+\)"):
        speed.deserialize_state(b"no state")


def test_directional_derivatives_are_those_of_the_equation(speed: Instance) -> None:
    steps(speed, 1)
    rate = speed.directional_derivative(["der(state.v)"], ["x"], [3.0])
    np.testing.assert_allclose(rate, [-4.0 * 3.0])
    np.testing.assert_allclose(speed.directional_derivative(["speed"], ["x"], [1.0]), [0.0])


def test_unknown_variables_are_named(speed: Instance) -> None:
    with pytest.raises(InputError, match="component speed: no variable 'sped'; did you mean speed"):
        speed.get("sped")


def test_calls_out_of_order_are_reported(speed: Instance) -> None:
    with pytest.raises(RunError, match=r"exit initialisation returned error \(not in initialisation mode\)"):
        speed.exit_initialisation()
