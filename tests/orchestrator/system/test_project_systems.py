"""The project's own systems: packed, loaded, simulated, and held to FMPy as the reference importer."""

import math
from pathlib import Path

import numpy as np
import pytest

from fmus.toolchain.build import build_fmu
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack, pack_system
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from specs import systems
from specs.errors import InputError
from specs.ssd import FmiVersion, render
from tests.fmus.importer import Imported

TARGET = {"target_x": -3.0, "target_y": 9.0, "target_z": 4.0, "pace": 1.0}
SECOND = {"target_x": 8.0, "target_y": -4.0, "target_z": 3.0}
QUIET = {"machine.noise_seed": 0.0}


def quiet(system: System) -> dict[str, float]:
    """Parameters that switch the sensor noise off."""
    return {k: v for k, v in QUIET.items() if k.split(".")[0] in system.components}


@pytest.mark.parametrize("fmi_version", [2, 3])
@pytest.mark.parametrize("name", ["nominal", "reference"])
def test_our_result_is_fmpys(tmp_path: Path, name: str, fmi_version: FmiVersion) -> None:
    """Jacobi exchange written out with FMPy's instances, 3 s with a change of target, to 1e-9."""
    system = load_system(pack_system(name, fmi_version, tmp_path))
    record = simulate(system, 150, Stimuli({0: TARGET, 75: SECOND}), quiet(system))
    expected = by_fmpy(system, fmi_version, 150)
    for output, values in expected.items():
        scale = max(1.0, float(np.abs(values).max()))
        np.testing.assert_allclose(record.column(output), values, rtol=0, atol=1e-9 * scale, err_msg=output)


def by_fmpy(system: System, fmi_version: FmiVersion, ticks: int) -> dict[str, np.ndarray]:
    """Outputs over time of the same system, exchanged by hand between FMPy's instances."""
    driven = {name: i.start for name, i in system.inputs.items()} | TARGET
    fmus: dict[str, Imported] = {}
    for name in system.components:
        starts = {
            k.target.name: driven[k.source.name]
            for k in system.links
            if k.target.owner == name and not k.source.owner
        }
        seed = 0 if f"{name}.noise_seed" in QUIET else None
        fmus[name] = Imported(build_fmu(name, fmi_version), seed, **starts)  # type: ignore[arg-type]

    def read() -> dict[tuple[str, str], float]:
        names = {k.source for k in system.links} | {o.link.source for o in system.outputs.values()}
        return {(s.owner, s.name): fmus[s.owner].get(s.name)[0] for s in names if s.owner}

    rows = []
    for tick in range(ticks + 1):
        driven |= SECOND if tick == 75 else {}
        values = read()
        rows.append([values[o.link.source.owner, o.link.source.name] for o in system.outputs.values()])
        for link in system.links:
            source = link.source
            value = values[source.owner, source.name] if source.owner else driven[source.name]
            fmus[link.target.owner].set(**{link.target.name: value})  # type: ignore[arg-type]
        for fmu in fmus.values():
            fmu.step(system.step_s)
    for fmu in fmus.values():
        fmu.__exit__(None, None, None)
    return dict(zip(system.outputs, np.array(rows).T, strict=True))


@pytest.mark.parametrize("name", ["nominal", "reference"])
def test_nothing_is_left_unconnected_and_both_versions_agree(tmp_path: Path, name: str) -> None:
    ends = []
    for fmi_version in (2, 3):
        system = load_system(pack_system(name, fmi_version, tmp_path))
        assert system.warnings == ()
        record = simulate(system, 100, Stimuli({0: TARGET}), seed=5)
        ends.append(np.array([record.column(n) for n in record.names]))
    np.testing.assert_array_equal(ends[0], ends[1])


def test_the_seed_moves_the_sensors_and_not_the_machine(tmp_path: Path) -> None:
    system = load_system(pack_system("reference", 2, tmp_path))
    runs = [simulate(system, 2, Stimuli({0: TARGET}), seed=seed) for seed in (1, 1, 2)]
    rates = [r.column("imu_cabin_rate_x") for r in runs]
    np.testing.assert_array_equal(rates[0], rates[1])
    assert (rates[0] != rates[2]).any()
    np.testing.assert_array_equal(runs[0].column("true_q_boom")[:2], runs[2].column("true_q_boom")[:2])


def test_the_controller_turns_the_nominal_system_to_its_target(tmp_path: Path) -> None:
    system = load_system(pack_system("nominal", 2, tmp_path))
    record = simulate(system, 1500, Stimuli({0: TARGET}))
    # A plain PI comes to rest where gain times error falls into the dead band: up to 14 degrees off.
    assert record.column("true_q_slew")[-1] == pytest.approx(math.atan2(9.0, -3.0), abs=math.radians(14.0))
    assert record.column("radius")[-1] == pytest.approx(math.hypot(9.0, 3.0), abs=0.5)


def test_an_unknown_system_is_not_packed(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no system 'nominl'; did you mean nominal"):
        pack_system("nominl", 2, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_connector_that_is_no_signal_is_warned_of(tmp_path: Path) -> None:
    """It may be meant (a system of one's own), or be a slip: the nearest signals are named."""
    spec = systems.load("nominal")
    text = render(spec, 2).replace('Connector name="target_x"', 'Connector name="target_xx"', 1)
    text = text.replace('startConnector="target_x"', 'startConnector="target_xx"')
    fmus = {f"{c.fmu}.fmu": build_fmu(c.fmu, 2) for c in spec.components}
    (warning,) = load_system(pack(text, fmus, tmp_path / "a.ssp")).warnings
    assert "target_xx is no signal of specs/signals.toml; did you mean target_x" in warning
