"""The slew networks as an FMU: the roll-out that the scores use, restorable, mirror-symmetric if promised."""

import csv
import os
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks.slew_nn import step
from fmus.models.slew_nn.fmu import build_from
from fmus.models.slew_nn.model import MODEL, STEP, TICKS, of_network
from fmus.models.slew_nn.network import HISTORY, PERIOD_S, SlewNetwork
from fmus.models.slew_nn.untrained import PRESSURE_LAYERS, VELOCITY_LAYERS, untrained
from fmus.toolchain.build import build_fmu
from fmus.toolchain.loader import model_folders
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack_system
from orchestrator.system.stimuli import Stimuli
from specs.errors import InputError
from tests.fmus.importer import Imported
from tests.fmus.models.roll_out import feeds_through

OUTPUTS = ["q_slew", "qd_slew", "p_slew_a", "p_slew_b"]
AHEAD = 60
KINDS = {
    "small": untrained(3),
    "paper": untrained(4, PRESSURE_LAYERS, VELOCITY_LAYERS),
    "ensemble": untrained(5, members=3, residual=True),
    "symmetric": untrained(6, (24, 16), (16,), members=2, symmetric=True),
}
REFERENCE = Path(__file__).resolve().parents[3] / "fmus" / "models" / "slew_nn" / "reference.csv"


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """FMU of the small network."""
    return build_from(KINDS["small"], "small", tmp_path_factory.mktemp("small"))


@cache
def commands() -> tuple[np.ndarray, np.ndarray]:
    """Joystick and inertia for each 0.1 s."""
    rng = np.random.default_rng(1)
    return rng.uniform(-1, 1, AHEAD), rng.uniform(2.5e5, 5.5e5, AHEAD)


def by_numpy(
    network: SlewNetwork,
    u: np.ndarray,
    inertia: np.ndarray,
    push: np.ndarray | float = 0.0,
    pressure: float = 0.0,
) -> np.ndarray:
    """omega, p_r, p_l [n, 3] of the network on its own predictions, as the equations are written.

    u [n] or [n, 2]: the joystick as the prediction sees it, and as the history keeps it; push [n]: torque.
    """
    start = {"u": 0.0, "p_l": pressure, "p_r": pressure, "omega": 0.0}
    past = {key: np.full((1, HISTORY), value) for key, value in start.items()}
    rows, pushes = [], np.broadcast_to(push, len(u))
    for now, i, torque in zip(np.broadcast_to(u.T, (2, len(u))).T, inertia, pushes, strict=True):
        past["u"] = np.append(past["u"][:, 1:], [[now[0]]], axis=1)
        p_l, p_r, omega = network.predict(**past, inertia=np.array([i]))
        omega = omega + PERIOD_S * torque / i
        past["u"][0, -1] = now[1]
        for key, value in zip(("p_l", "p_r", "omega"), (p_l, p_r, omega), strict=True):
            past[key] = np.append(past[key][:, 1:], value[:, None], axis=1)
        rows.append([omega[0], p_r[0], p_l[0]])
    return np.array(rows)


def by_fmu(fmu: Path, u: np.ndarray, inertia: np.ndarray, start: float = 0.0, **inputs: float) -> np.ndarray:
    """OUTPUTS [5 n, 4] of every tick, with joystick ([n] or [n, 5]) and inertia held for 0.1 s."""
    ticks = np.broadcast_to(u.T, (TICKS, len(u))).T
    with Imported(fmu, start_slew_pressure=start) as instance:
        rows = [
            instance.run(1, {"u_slew": value, "inertia": i, **inputs}, OUTPUTS)[0]
            for now, i in zip(ticks, inertia, strict=True)
            for value in now
        ]
    return np.array(rows)


def assert_same(found: np.ndarray, wanted: np.ndarray) -> None:
    """Equal to 1e-9 of each column's largest value, and not for want of motion."""
    size = np.abs(wanted).max(axis=0)
    np.testing.assert_allclose(found / size, wanted / size, rtol=0, atol=1e-9)
    assert np.all(np.ptp(wanted, axis=0) > 0.01 * size)


@pytest.mark.parametrize(("kind", "version"), [*((kind, 2) for kind in KINDS), ("small", 3)])
def test_the_fmu_is_the_network_on_its_own_predictions(kind: str, version: int, tmp_path: Path) -> None:
    fmu = build_from(KINDS[kind], kind, tmp_path, version)
    found = by_fmu(fmu, *commands())
    assert_same(found[TICKS - 1 :: TICKS, 1:], by_numpy(KINDS[kind], *commands()))


def test_between_predictions_it_goes_straight_and_the_angle_is_the_integral(small: Path) -> None:
    found = np.vstack([np.zeros(4), by_fmu(small, *commands())])
    share = np.arange(TICKS + 1)[:, None] / TICKS
    for a in range(0, len(found) - 1, TICKS):
        line = found[a, 1:] + share * (found[a + TICKS, 1:] - found[a, 1:])
        np.testing.assert_allclose(found[a : a + TICKS + 1, 1:], line, rtol=1e-12, atol=1e-12)
    speed = found[:, 1]
    area = np.append(0.0, np.cumsum(STEP * (speed[1:] + speed[:-1]) / 2))
    np.testing.assert_allclose(found[:, 0], area, rtol=0, atol=1e-12)


def test_of_a_joystick_that_moves_within_a_period_the_history_keeps_the_mean(small: Path) -> None:
    u = np.random.default_rng(2).uniform(-1, 1, (AHEAD, TICKS))
    found = by_fmu(small, u, commands()[1])[TICKS - 1 :: TICKS, 1:]
    wanted = by_numpy(KINDS["small"], np.stack([u[:, 0], u.mean(axis=1)], axis=1), commands()[1])
    assert_same(found, wanted)


def test_histories_of_pressure_start_where_the_parameter_says(small: Path) -> None:
    found = by_fmu(small, *commands(), start=1.5e6)[TICKS - 1 :: TICKS, 1:]
    assert_same(found, by_numpy(KINDS["small"], *commands(), pressure=1.5e6))
    with Imported(small, start_slew_pressure=1.5e6, start_q_slew=0.5) as instance:
        assert instance.get(*OUTPUTS) == [0.5, 0.0, 1.5e6, 1.5e6]


def test_a_torque_turns_the_carriage_as_a_free_body_unless_the_brake_holds_it(small: Path) -> None:
    u, inertia = np.full(AHEAD, 0.5), commands()[1]
    found = by_fmu(small, u, inertia, disturbance_torque_slew=2e4)[TICKS - 1 :: TICKS, 1:]
    push = np.append(0.0, np.full(AHEAD - 1, 2e4))  # released 0.06 s after the joystick has left neutral
    wanted = by_numpy(KINDS["small"], u, inertia, push)
    assert_same(found, wanted)
    assert np.abs(wanted - by_numpy(KINDS["small"], u, inertia)).max(axis=0)[0] > 1e-3  # rad/s
    still = by_fmu(small, 0 * u, inertia, disturbance_torque_slew=2e4)
    np.testing.assert_array_equal(still, by_fmu(small, 0 * u, inertia))


def test_the_brake_signal_follows_the_joystick(small: Path) -> None:
    with Imported(small) as instance:
        seen = [row[0] for row in instance.run(10, {"u_slew": 0.3}, ["brake_released"])]
        assert seen == [0.0] * 3 + [1.0] * 7
        seen = [row[0] for row in instance.run(260, {"u_slew": 0.0}, ["brake_released"])]
        assert seen == [1.0] * 250 + [0.0] * 10


def test_directional_derivatives_are_the_partials(small: Path) -> None:
    with Imported(small) as instance:
        instance.run(TICKS + 2, {"u_slew": 0.5}, OUTPUTS)
        for output, state in (("qd_slew", "omega"), ("p_slew_a", "p_r"), ("p_slew_b", "p_l")):
            partials = [instance.derivative(output, f"state.{state}_{i}") for i in (8, 9)]
            np.testing.assert_allclose(partials, [0.6, 0.4], rtol=1e-12)
        assert instance.derivative("q_slew", "state.q") == 1.0
        assert instance.derivative("qd_slew", "u_slew") == 0.0


@pytest.mark.parametrize("phase", [0, 3])
def test_the_step_s_derivative_goes_through_the_network(phase: int) -> None:
    """Forward derivative of the next state against central differences."""
    rng, model = np.random.default_rng(phase), of_network(KINDS["ensemble"])
    size = np.array([v.nominal or 1.0 for v in model.states])
    x, u, p = (
        0.1 * rng.normal(size=len(size)) * size,
        np.array([0.4, 4e5, 0.0, 1e4]),
        model.start_parameters(),
    )
    x[1] = phase
    dx = rng.normal(size=len(size)) * size
    dx[1] = 0.0
    found = np.array(model.directional(x, u, 1.0, p, dx, np.zeros(4), np.zeros(len(model.parameters)))[0])
    ends = [np.array(model.f(x + sign * 1e-6 * dx, u, 1.0, p)) for sign in (1, -1)]
    numeric = (ends[0] - ends[1]) / 2e-6
    np.testing.assert_allclose(found.ravel() / size, numeric.ravel() / size, rtol=0, atol=1e-6)


def test_the_interface_is_that_of_the_hydraulic_slew() -> None:
    from fmus.models.slew.model import MODEL as SLEW

    assert (MODEL.inputs, MODEL.outputs) == (SLEW.inputs, SLEW.outputs)
    assert feeds_through(MODEL) == []


@pytest.mark.parametrize("version", [2, 3])
def test_the_nominal_system_runs_with_the_networks(version: int, tmp_path: Path) -> None:
    system = load_system(pack_system("nominal", version, tmp_path, {"slew": model_folders()["slew_nn"]}))  # type: ignore[arg-type]
    target = {"target_x": -3.0, "target_y": 9.0, "target_z": 4.0, "pace": 1.0}
    record = simulate(system, 100, Stimuli({0: target}))
    assert np.isfinite(record.column("q_tool_x")).all()
    speed, angle = record.column("qd_slew"), record.column("q_slew")
    assert np.ptp(speed) > 0
    np.testing.assert_allclose(np.diff(angle), STEP * (speed[1:] + speed[:-1]) / 2, atol=1e-12)


@pytest.mark.parametrize("content", [b"", b"nonsense", b"PK"])
def test_a_file_that_is_no_network_is_named(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "net.npz").write_bytes(content)
    with pytest.raises(InputError, match=r"not a slew network: it is no whole \.npz file"):
        SlewNetwork.load(tmp_path / "net.npz")


def test_same_weights_same_bytes_and_no_name_but_a_c_name(tmp_path: Path) -> None:
    first, second = (build_from(untrained(3), "net", tmp_path / f).read_bytes() for f in ("a", "b"))
    assert first == second
    with pytest.raises(InputError, match="'my net'"):
        build_from(untrained(3), "my net", tmp_path / "c")
    assert not (tmp_path / "c").exists()


def test_reference_roll_out() -> None:
    """`SLEWRIGHT_UPDATE_REFS=1 pytest ...` rewrites reference.csv: needed when weights.npz changes."""
    u = np.repeat([0.0, 0.5, -0.8, 0.0], 15)
    inertia = np.linspace(3e5, 5e5, len(u))
    rows = by_fmu(build_fmu("slew_nn", 2), u, inertia, start=1.5e6)[TICKS - 1 :: TICKS]
    found = np.column_stack([PERIOD_S * np.arange(1, len(u) + 1), u, inertia, rows])
    if os.environ.get("SLEWRIGHT_UPDATE_REFS"):
        head = ["time", "u_slew", "inertia", *OUTPUTS]
        lines = [",".join(head), *(",".join(f"{value:.12g}" for value in row) for row in found)]
        REFERENCE.write_text("\n".join(lines) + "\n", encoding="utf-8")
    with REFERENCE.open(encoding="utf-8", newline="") as file:
        wanted = np.array(list(csv.reader(file))[1:], dtype=float)
    size = np.abs(wanted).max(axis=0)
    np.testing.assert_allclose(found / size, wanted / size, rtol=0, atol=1e-8)


def test_the_bench_compares_what_computes_the_same() -> None:
    """Times are measured, not judged; the limits are, on made-up figures."""
    figures = step.measure(KINDS["small"], 2).figures()
    assert figures["ratio_p25"] <= figures["ratio"] <= figures["ratio_p75"]
    assert figures["realtime_factor"] == pytest.approx(STEP * 1e6 / figures["fmu_us"])
    kept = {name: {"ratio": 1.4, "realtime_factor": 600.0} for name in step.JUDGED}
    assert step.missed(kept) == []
    kept["paper"] = {"ratio": 1.6, "realtime_factor": 400.0}
    assert [must.split(":")[0] for must in step.missed(kept)] == ["paper", "paper"]
