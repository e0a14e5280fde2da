"""Every FMU of the project in both FMI versions: valid, restorable at any tick, with true partials."""

import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy.validation import validate_fmu

from fmus.toolchain.build import FMI_VERSIONS, build_fmu
from fmus.toolchain.codegen import check_no_feedthrough
from fmus.toolchain.loader import load_model, model_folders
from tests.fmus.importer import Imported

NAMES = sorted(model_folders())
EACH = pytest.mark.parametrize(("name", "version"), [(n, v) for n in NAMES for v in FMI_VERSIONS])


def drive(instance: Imported, name: str, ticks: int, seed: int) -> list[list[float]]:
    """Steps with inputs that change every 3 ticks within their range, and all outputs after each."""
    model, rng, rows = load_model(name), random.Random(seed), []
    commands = [v for v in model.inputs if not v.name.startswith("disturbance")]
    outputs = [v.name for v in model.outputs]
    for tick in range(ticks):
        if tick % 3 == 0:
            instance.set(**{v.name: v.start + rng.uniform(-0.3, 0.3) * spread(v) for v in commands})
        instance.step()
        rows.append(instance.get(*outputs))
    return rows


def spread(variable: object) -> float:
    """A tenth of the variable's range: enough to move, too little to leave it."""
    low, high = getattr(variable, "min", None), getattr(variable, "max", None)
    return 0.1 * (high - low) if low is not None and high is not None else 0.1


@EACH
def test_fmpy_finds_nothing(name: str, version: int) -> None:
    assert validate_fmu(str(build_fmu(name, version))) == []


@EACH
def test_every_variable_says_what_it_is(name: str, version: int) -> None:
    """Description and unit of all inputs, outputs and parameters; a range for what can be set."""
    with Imported(build_fmu(name, version)) as i:
        for v in i.description.modelVariables:
            if v.causality in ("input", "output", "parameter"):
                assert v.description, v.name
                assert v.unit or v.name == "noise_seed", v.name
            if v.causality == "parameter" and v.name != "noise_seed":
                assert None not in (v.min, v.max, v.nominal), v.name


@EACH
def test_only_start_values_and_seeds_are_fixed(name: str, version: int) -> None:
    with Imported(build_fmu(name, version)) as i:
        for v in i.description.modelVariables:
            if v.causality == "parameter":
                fixed = v.name.startswith("start_") or v.name == "noise_seed"
                assert v.variability == ("fixed" if fixed else "tunable"), v.name


@EACH
def test_restored_at_random_ticks_the_future_is_the_same(name: str, version: int) -> None:
    """Inputs have changed within every delay line's length, so the state is saved mid-delay."""
    ticks = random.Random(name).sample(range(2, 60), 3)
    fmu = build_fmu(name, version)
    for before in ticks:
        with Imported(fmu) as i, Imported(fmu) as other:
            drive(i, name, before, seed=1)
            state = i.saved()
            future = drive(i, name, 40, seed=2)
            i.restore(state)
            assert drive(i, name, 40, seed=2) == future
            other.restore(state)
            assert drive(other, name, 40, seed=2) == future


@pytest.mark.parametrize("version", FMI_VERSIONS)
def test_machine_goes_on_in_another_process(version: int, tmp_path: Path) -> None:
    fmu = build_fmu("machine", version)
    with Imported(fmu) as i:
        drive(i, "machine", 23, seed=5)
        (tmp_path / "state").write_bytes(i.saved())
        future = drive(i, "machine", 30, seed=6)
    code = (
        "from pathlib import Path; from tests.fmus.importer import Imported\n"
        "from tests.fmus.toolchain.test_project_fmus import drive\n"
        f"i = Imported(Path({str(fmu)!r})); i.restore(Path({str(tmp_path / 'state')!r}).read_bytes())\n"
        "print(repr(drive(i, 'machine', 30, seed=6)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == repr(future)


@pytest.mark.parametrize("name", ["slew", "machine"])
def test_directional_derivatives_are_the_exact_jacobian(name: str) -> None:
    """d(rates)/d(states) of the compiled FMU against CasADi's, at the FMU's own point."""
    model = load_model(name)
    states = [f"state.{v.name}" for v in model.states]
    with Imported(build_fmu(name, 2)) as i:
        i.run(60, {"u_slew": 0.5}, states)  # longer than any delay: delayed and present inputs are the same
        x, u = np.array(i.get(*states)), i.get(*(v.name for v in model.inputs))
        exact = np.array(model.jacobian(x, u, i.get("brake_released"), model.start_parameters()))
        for column, state in zip(exact.T, states, strict=True):
            found = [i.derivative(f"der({r})", state) for r in states]
            np.testing.assert_allclose(found, column, rtol=1e-9, atol=1e-12 * np.abs(column).max())


@pytest.mark.parametrize("name", NAMES)
def test_nothing_feeds_straight_through(name: str) -> None:
    check_no_feedthrough(load_model(name))
