"""The filter: against a textbook Kalman filter, its step, dry friction, delays, and what any model may be."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.paths import SHIM
from fmus.toolchain import compiler
from reconcile.catalogue import ALL
from reconcile.equations.extended import Extended
from reconcile.equations.model import Attached, Folder, candidates
from reconcile.filter.equations import Stepped
from reconcile.filter.fit import Fitter
from reconcile.filter.kalman import CORRELATED, CREEP, STILL, Kalman
from reconcile.filter.library import HERE, headers
from reconcile.filter.point import Free
from reconcile.recordings.data import runs_of
from records.measurement import Measurement
from tests.reconcile import models
from tests.reconcile.truth import Truth, record

MASS, DRAG, STIFFNESS = 2.0, 1.5, 8.0
QUICK = 100.0  # the drag with which a speed dies away within a step
SIGMA, TAU, WHITE, OUT = 0.7, 0.3, 0.2, 0.01
GAMMA = 1.0 - np.sqrt(0.5)


def ros2(a: np.ndarray) -> np.ndarray:
    """Stability function of ROS2 of a matrix: what a step makes of a linear system."""
    one = np.eye(len(a))
    top = one + (1.0 - 2.0 * GAMMA) * a + (0.5 - 2.0 * GAMMA + GAMMA**2) * a @ a
    bottom = np.linalg.inv(one - GAMMA * a)
    return top @ bottom @ bottom


def textbook(
    time: np.ndarray, force: np.ndarray, y: np.ndarray, p0: np.ndarray, substeps: int, period: float
):
    """Innovations and variances [n, 2] of the spring with a lagged random force; NaN where missing.

    A step of `period` or more has `substeps`, a shorter one fewer.
    """
    a = np.zeros((4, 4))  # x, v, force that nobody recorded, input
    a[0, 1] = 1.0
    a[1] = [-STIFFNESS / MASS, -DRAG / MASS, 1.0 / MASS, 1.0 / MASS]
    z = np.array([y[0, 0], y[0, 1], 0.0])
    p = np.diag([*p0, SIGMA**2])
    e, s = np.full(y.shape, np.nan), np.full(y.shape, np.nan)
    for k in range(len(time)):
        if k:
            dt = time[k] - time[k - 1]
            n = int(np.ceil(min(substeps * dt / period, substeps) - 1e-6))
            phi = np.linalg.matrix_power(ros2(a * dt / n), n)
            keep = np.exp(-dt / TAU)
            z = phi[:3, :3] @ z + phi[:3, 3] * force[k - 1]
            p = phi[:3, :3] @ p @ phi[:3, :3].T
            p[1, 1] += WHITE**2 * dt / MASS**2
            fade = np.diag([1.0, 1.0, keep])
            z, p = fade @ z, fade @ p @ fade
            p[2, 2] += SIGMA**2 * (1.0 - keep**2)
        seen = np.flatnonzero(~np.isnan(y[k]))
        h = np.eye(3)[seen]
        whole = h @ p @ h.T + OUT**2 * np.eye(len(seen))
        lower = np.linalg.cholesky(whole)
        unit = lower / np.diag(lower)
        v = y[k, seen] - z[seen]
        e[k, seen], s[k, seen] = np.linalg.solve(unit, v), np.diag(lower) ** 2  # one output after the other
        gain = p @ h.T @ np.linalg.inv(whole)
        z, p = z + gain @ v, p - gain @ h @ p
    return e, s


def driven(time: np.ndarray, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A held force [n] and what the spring does under it and a random force, with noise [n, 2]."""
    rng = np.random.default_rng(seed)
    force = 3.0 * np.repeat(rng.uniform(-1, 1, len(time) // 10 + 1), 10)[: len(time)]
    z, y = np.zeros(2), np.empty((len(time), 2))
    other = 0.0
    for k in range(len(time)):
        if k:
            dt = time[k] - time[k - 1]
            for _ in range(20):
                rate = (force[k - 1] + other - DRAG * z[1] - STIFFNESS * z[0]) / MASS
                z = z + dt / 20.0 * np.array([z[1], rate])
            other = (
                np.exp(-dt / TAU) * other + SIGMA * np.sqrt(1 - np.exp(-2 * dt / TAU)) * rng.standard_normal()
            )
        y[k] = z + OUT * rng.standard_normal(2)
    return force, y


STEADY = 0.05 * np.arange(300)
IRREGULAR = np.cumsum(np.random.default_rng(3).uniform(0.02, 0.08, 300))


@pytest.mark.parametrize("substeps", [1, 3])
@pytest.mark.parametrize("missing", [False, True], ids=["whole", "missing samples"])
@pytest.mark.parametrize("time", [STEADY, IRREGULAR], ids=["steady", "irregular"])
def test_innovations_are_those_of_a_textbook_kalman_filter(time, missing, substeps):
    force, y = driven(time)
    kept = [np.arange(len(time)), np.arange(len(time))]
    if missing:
        kept = [np.flatnonzero(np.arange(len(time)) % 3 == 0), np.r_[0:100, 104 : len(time)]]
        for column, own in enumerate(kept):
            y[np.setdiff1d(np.arange(len(time)), own), column] = np.nan
    both = {
        n: (time[k], y[k, i]) for i, (n, k) in enumerate(zip(("position", "velocity"), kept, strict=True))
    }
    one = models.run({"force": (time, force)}, both)
    rows = models.recorded(one)
    kalman = Kalman(models.spring(), (), rows, ["position", "velocity"])
    kalman.scale, kalman.substeps = np.array([0.5, 1.0]), substeps
    found = kalman.run(models.noise(kalman, SIGMA, TAU, WHITE, OUT), ())
    assert found is not None
    # steps are those of the denser output; where the force changes in its gap, a step has two parts
    changed = np.flatnonzero(np.diff(force, prepend=force[0]) != 0.0)
    steps = np.union1d(kept[1], changed)
    period = float(np.median(np.diff(time[kept[1]])))
    e, s = textbook(time[steps], force[steps], y[steps], (2.0 * kalman.scale) ** 2, substeps, period)
    e, s = (v[np.isin(steps, kept[1])] for v in (e, s))
    assert np.nanmax(np.abs(e) / np.sqrt(s)) < 4.0  # none is clipped
    np.testing.assert_allclose(found[0].e, e, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found[0].s, s, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("folder", [models.spring(), models.cooling()], ids=lambda f: f.model.name)
def test_slopes_by_the_noise_are_those_of_differences(folder):
    """Also over missing samples, irregular steps, and samples so far out that they are clipped."""
    rng = np.random.default_rng(1)
    names = [v.name for v in folder.model.outputs]
    seen = {}
    for n in names:
        kept = np.flatnonzero(rng.random(len(IRREGULAR)) > 0.2)
        values = rng.standard_normal(len(kept))
        values[::17] += 30.0  # far out
        seen[n] = (IRREGULAR[kept], values)
    one = models.run({v.name: (IRREGULAR, np.sin(IRREGULAR)) for v in folder.model.inputs}, seen)
    kalman = Kalman(folder, (), models.recorded(one), names)
    kalman.substeps = 2
    values = models.noise(kalman, SIGMA, TAU, WHITE, 2.0)
    free = [f for n, v in values.items() if (f := Free(n, v, 0.5, True)).of_noise]
    assert len(free) == 3 * len(kalman.places) + len(names)
    fitter = Fitter(kalman, [np.ones(len(r.time), bool) for r in kalman.records])
    at = fitter.innovations(values, ())
    made = fitter.columns(values, (), free, *at) if at else None
    assert made is not None
    for k, f in enumerate(free):
        z = f.coordinate(values[f.name])
        ends = [fitter.innovations(values | {f.name: f.value(z + by)}, ()) for by in (-1e-5, 1e-5)]
        assert ends[0]
        assert ends[1]
        by_e, by_s = ends[1][0] - ends[0][0], np.log(ends[1][1]) - np.log(ends[0][1])
        for found, change in zip(made, (by_e, by_s), strict=True):
            true = np.nan_to_num(change) / 2e-5
            np.testing.assert_allclose(
                found[:, k], true, atol=1e-6 + 1e-3 * np.abs(true).max(), err_msg=f.name
            )


def by_itself(folder: Folder, substeps: int, step: float, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """States [steps, NX] of a model that runs by itself from a recorded start, and that start."""
    time = step * np.arange(steps + 2)
    one = models.run({}, {"angle": (time, np.full(len(time), 2.0)), "rate": (time, np.zeros(len(time)))})
    kalman = Kalman(folder, (), models.recorded(one), ["angle", "rate"])
    kalman.substeps = substeps
    window = np.r_[0, np.ones(steps + 1, int)]
    run = kalman.run(models.noise(kalman), (), windows=[window], states=True)
    assert run is not None
    return run[0].zfree[1:], run[0].z[0, :2]


def test_a_step_is_of_order_two_for_a_model_that_is_not_linear():
    step, steps = 0.1, 20
    errors = []
    for substeps in (1, 2, 4, 8):
        found, start = by_itself(models.pendulum(), substeps, step, steps)
        time = step * np.arange(1, steps + 2)
        true = solve_ivp(
            lambda t, z: [z[1], -9.0 * np.sin(z[0])],
            (0, time[-1]),
            start,
            t_eval=time,
            rtol=1e-11,
            atol=1e-12,
        )
        errors.append(np.abs(found - true.y.T).max())
    assert np.array(errors[1:-1]) / np.array(errors[2:]) == pytest.approx([4.0, 4.0], rel=0.25)


def sliding(
    step: float, velocity: float, force: float, steps: int = 150, creep: float = STILL, drag: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """A carriage with 1 N of dry friction: its position and speed [steps], by itself from a speed."""
    folder = models.spring(stiffness=0.0, drag=drag)
    (friction,) = (
        a for a in candidates(folder, ["force", "position", "velocity"]) if a.key == "coulomb_friction@v"
    )
    time = step * np.arange(steps)
    one = models.run(
        {"force": (time, np.full(steps, force))},
        {
            "position": (time[:1], np.zeros(1)),
            "velocity": (time, np.r_[velocity, np.full(steps - 1, np.nan)]),
        },
    )
    kalman = Kalman(folder, (friction,), models.recorded(one), ["position", "velocity"])
    values = models.noise(kalman) | {
        friction.name("Fc"): 1.0,
        friction.name("width"): 1e-3,
        CREEP + "v": creep,
    }
    run = kalman.run(values, (friction,), windows=[np.r_[0, np.ones(steps - 1, int)]])
    assert run is not None
    return run[0].zfree[1:, 0], run[0].zfree[1:, 1]


NOTHING = 1e-20  # m/s


@pytest.mark.parametrize("step", [1e-5, 1e-2, 4.0])
def test_dry_friction_holds_what_does_not_break_away_and_does_not_creep(step):
    x, v = sliding(step, 0.0, 0.999)
    assert np.abs(v).max() < NOTHING
    assert np.abs(x).max() < 1e-12 * step**2  # of what a step without friction would make: rounding


@pytest.mark.parametrize("step", [0.01, 0.1])
def test_dry_friction_brings_a_speed_to_rest_and_there_it_stays(step):
    x, v = sliding(step, 0.5, 0.0)
    assert v[0] == pytest.approx(0.5 - 0.5 * step)  # 1 N on 2 kg
    stopped = np.flatnonzero(np.abs(v) < NOTHING)[0]
    assert step * (stopped + 1) == pytest.approx(1.0, abs=1.01 * step)
    assert np.abs(v[stopped:]).max() < NOTHING
    assert np.ptp(x[stopped:]) < 1e-12
    assert x[-1] == pytest.approx(0.25, abs=0.3 * step)


def test_what_breaks_away_is_pushed_by_what_friction_leaves():
    _, v = sliding(0.01, 0.0, 3.0)
    assert v[-1] == pytest.approx(0.01 * len(v) * 1.0, rel=1e-6)  # (3 - 1) N on 2 kg


def test_dry_friction_beside_drag_is_of_second_order_and_lets_go_at_its_level():
    drag, mass, errors = 4.0, 2.0, []
    for step in (0.08, 0.04, 0.02):
        _, v = sliding(step, 0.0, 3.0, steps=round(0.8 / step), drag=drag)
        true = (3.0 - 1.0) / drag * (1.0 - np.exp(-drag / mass * step * np.arange(1, len(v) + 1)))
        errors.append(np.abs(v - true).max())
    assert errors[0] < 2e-3
    assert np.array(errors[:-1]) / np.array(errors[1:]) == pytest.approx([4.0, 4.0], rel=0.3)
    assert np.abs(sliding(0.08, 0.0, 0.999, drag=drag)[1]).max() < NOTHING
    assert sliding(0.08, 0.0, 1.001, drag=drag)[1][-1] == pytest.approx(0.001 / drag, rel=0.1)


@pytest.mark.parametrize("creep", [1e-4, 0.01, 0.3])
@pytest.mark.parametrize("force", [0.0, 0.3, 0.97, -0.6, -1.0, 1.0, 3.0])
@pytest.mark.parametrize("velocity", [0.0, 0.02, 0.4])
def test_dry_friction_that_gives_way_moves_as_its_equation_says(velocity, force, creep):
    """v' = (force − tanh(v / creep)) / mass, whatever the step."""
    step, mass = 0.05, 2.0
    x, v = sliding(step, velocity, force, creep=creep)
    true = solve_ivp(
        lambda t, z: [z[1], (force - np.tanh(z[1] / creep)) / mass],
        (0.0, step * len(x)),
        [0.0, velocity],
        method="LSODA",
        t_eval=step * np.arange(1, len(x) + 1),
        rtol=1e-9,
        atol=1e-13,
    )
    np.testing.assert_allclose(v, true.y[1], atol=3e-3 * creep + 1e-6 * np.abs(true.y[1]).max())
    along = np.abs(true.y[0]).max() + creep * step
    np.testing.assert_allclose(x, true.y[0], atol=0.01 * along)


@pytest.mark.parametrize(
    ("key", "late"),
    [("input_delay@force", 0.0137), ("sensor_delay@velocity", 0.0137), ("sensor_delay@velocity", 0.037)],
)
def test_a_delay_of_a_fraction_of_a_sample_is_the_likeliest_there(key, late):
    folder, period, fine = models.spring(), 0.02, 1e-4
    rng = np.random.default_rng(2)
    steps = round(12.0 / period)
    command = np.repeat(rng.uniform(-5, 5, steps // 20 + 1), 20)[:steps]
    time = period * np.arange(steps)
    t = fine * np.arange(round(12.0 / fine))
    shift = late if key.startswith("input") else 0.0
    felt = command[np.clip(np.floor((t - shift) / period + 1e-9).astype(int), 0, steps - 1)]
    x = np.zeros((len(t) + 1, 2))
    for k in range(len(t)):
        v = x[k, 1] + fine * (felt[k] - DRAG * x[k, 1] - STIFFNESS * x[k, 0]) / MASS
        x[k + 1] = x[k, 0] + fine * 0.5 * (v + x[k, 1]), v
    moment = time - (late if key.startswith("sensor") else 0.0)
    y = np.column_stack([np.interp(time, t, x[:-1, 0]), np.interp(moment, t, x[:-1, 1])])
    y += 1e-3 * rng.standard_normal(y.shape)
    (delay,) = (
        a
        for a in candidates(folder, ["force", "position", "velocity"], [e for e in ALL if e.delays])
        if a.key == key
    )
    one = models.run({"force": (time, command)}, {"position": (time, y[:, 0]), "velocity": (time, y[:, 1])})
    kalman = Kalman(folder, (delay,), models.recorded(one), ["position", "velocity"])
    kalman.substeps = 2
    fitter = Fitter(kalman, [np.ones(len(time), bool)])
    values = models.noise(kalman, sigma=0.01, out=1e-3)
    grid = late + period * np.arange(-0.5, 0.51, 0.1)
    found = [fitter.innovations(values | {delay.name("delay"): d}, (delay,)) for d in grid]
    loss = np.array([fitter.loss(*f).sum() for f in found if f is not None])
    assert grid[np.argmin(loss)] == pytest.approx(late, abs=0.11 * period)
    assert loss[0] > loss.min() + 100.0
    assert loss[-1] > loss.min() + 100.0


def in_steps(key: str, length: float) -> tuple[Fitter, Attached, dict]:
    """A model in steps with an effect in its recording, at whose steps it is known what shows."""
    period, n = 0.02, 1200
    rng = np.random.default_rng(5)
    time, command = period * np.arange(n), np.repeat(rng.uniform(-2, 2, n // 12), 12)
    felt, lagged, q, v = command.copy(), 0.0, np.zeros(n), np.zeros(n)
    for k in range(n) if key.startswith("input_lag") else ():
        felt[k] = lagged = lagged + (1.0 - np.exp(-period / length)) * (command[k] - lagged)
    for k in range(n - 1):
        v[k + 1] = v[k] + 0.4 * (felt[k] - v[k])
        q[k + 1] = q[k] + period * v[k + 1]
    shown, seen = v.copy(), v[0]
    for k in range(n) if key.startswith("sensor_lag") else ():
        shown[k] = seen = seen + (1.0 - np.exp(-period / length)) * (v[k] - seen)
    if key.startswith("sensor_delay"):
        shown = np.interp(time - length, time, v)
    y = np.column_stack([q, shown]) + 1e-3 * rng.standard_normal((n, 2))
    folder = models.stepped(period)
    (a,) = (x for x in candidates(folder, ["wanted", "angle", "rate"], ALL) if x.key == key)
    one = models.run({"wanted": (time, command)}, {"angle": (time, y[:, 0]), "rate": (time, y[:, 1])})
    kalman = Kalman(folder, (a,), models.recorded(one), ["angle", "rate"])
    scored = np.arange(n) % 100 < 70  # in blocks, as data to fit are
    values = models.noise(kalman, sigma=0.01, out=1e-3) | {"pull": 0.4}
    fitter = Fitter(kalman, [scored], np.full(len(kalman.outputs), 1e-3))
    return fitter, a, values | ({a.name("gate"): 1.0} if a.effect.gated else {})


@pytest.mark.parametrize(
    ("key", "length"),
    [
        ("sensor_lag@rate", 0.03),
        ("input_lag@wanted", 0.03),
        ("sensor_delay@rate", 0.003),
        ("sensor_delay@rate", 0.0131),
        ("sensor_delay@rate", 0.0246),
    ],
)
def test_lags_and_delays_of_a_model_in_steps_are_found_again(key, length):
    fitter, a, values = in_steps(key, length)
    name = a.name(a.effect.parameters[0].name)
    free = [Free(name, length, 0.3, True, 1e-4, 1.0)]
    found = fitter.fit(values | {name: 0.8 * length}, (a,), free, 20)
    assert found is not None
    error = 0.3 * length * np.sqrt(found.covariance()[0, 0])
    assert error < 0.02 * length
    assert found.values[name] == pytest.approx(length, abs=3.0 * error)


@pytest.mark.parametrize("samples", [1, 2])
def test_a_delay_of_a_whole_sample_and_one_next_to_it_are_as_likely(samples):
    edge = samples * 0.02
    fitter, a, values = in_steps("sensor_delay@rate", edge)
    found = [
        fitter.innovations(values | {a.name("delay"): d}, (a,))
        for d in (edge - 1e-7, edge + 1e-7, edge - 1e-3)
    ]
    short, beyond, other = (float(fitter.loss(*f).sum()) for f in found if f is not None)
    assert short == pytest.approx(beyond, abs=2.0)  # one more sample is beyond the beginning
    assert other > short + 10.0


@pytest.mark.parametrize(("name", "length"), [("input_delay", "delay"), ("input_lag", "time")])
def test_inputs_that_change_within_a_step_move_the_model_as_they_do(name, length):
    """Steps of 20 ms with a change in each, 7 ms late or with a lag of 7 ms: the model by itself."""
    folder, period, late = models.spring(drag=QUICK), 0.02, 0.007
    command = np.random.default_rng(5).uniform(-5, 5, 80)
    time = period * np.arange(len(command))
    nothing = np.zeros(len(time))
    one = models.run({"force": (time, command)}, {"position": (time, nothing), "velocity": (time, nothing)})
    (effect,) = candidates(folder, ["force", "position", "velocity"], [e for e in ALL if e.name == name])
    kalman = Kalman(folder, (effect,), models.recorded(one), ["position", "velocity"])
    kalman.substeps = 4
    values = models.noise(kalman) | {effect.name(length): late, effect.name("gate"): 1.0}
    run = kalman.run(values, (effect,), windows=[np.r_[0, np.ones(len(time) - 1, int)]])
    assert run is not None
    true = moved_by(command, period, late, name == "input_delay")
    assert (
        np.abs(run[0].zfree[1:, 1] - true[1:]).max() < 6e-3 * np.abs(true).max()
    )  # a mean over the step: 7e-2


def moved_by(command: np.ndarray, period: float, late: float, delayed: bool) -> np.ndarray:
    """Speeds [n] of the quick spring at rest under a held command that arrives late, or with a lag."""
    z, found = np.array([0.0, 0.0, command[0]]), []
    for k, target in enumerate(command):
        found.append(z[1])
        before = command[max(k - 1, 0)]
        for end, late_force in ((late, before), (period - late, target)):

            def rates(_: float, z: np.ndarray, u: float = target, felt: float = late_force) -> list[float]:
                force = felt if delayed else z[2]
                return [z[1], (force - QUICK * z[1] - STIFFNESS * z[0]) / MASS, (u - z[2]) / late]

            z = solve_ivp(rates, (0.0, end), z, rtol=1e-10, atol=1e-12).y[:, -1]
    return np.array(found)


@pytest.mark.parametrize(
    "folder",
    [models.cooling(), models.cooling(driven=False), models.chain(3), models.spring()],
    ids=lambda f: f.model.name,
)
def test_the_filter_of_any_model_compiles_without_a_warning(folder, tmp_path):
    pushed = [] if folder.ports.axes else [v.name for v in folder.model.states]
    code, header = Stepped(Extended(folder, ()), [v.name for v in folder.model.outputs], pushed).code()
    assert f"#define NX {len(folder.model.states)}\n" in header
    (tmp_path / "filter.h").write_text(header, encoding="utf-8")
    (tmp_path / "equations.c").write_text(code, encoding="utf-8")
    assert "-Werror" in compiler.WARNINGS
    include = [f"-I{SHIM}", f"-I{tmp_path}"]
    warns(["filter"], tmp_path, include)


def test_the_filter_of_all_models_compiles_without_a_warning(tmp_path):
    headers(tmp_path)
    warns(["filter", "tape"], tmp_path, ["-DANY_MODEL", f"-I{HERE}", f"-I{SHIM}", f"-I{tmp_path}"])


def warns(sources: list[str], folder: Path, include: list[str]) -> None:
    """Compile sources with all warnings as errors."""
    for level in ("-O1", "-O2"):  # what the optimiser sees it warns of
        for name in sources:
            out = folder / f"{name}{level}.o"
            compiler.compile_object(HERE / f"{name}.c", out, compiler.host().name, [*include, level])
            assert out.stat().st_size


def clocks(measured: Measurement, rig: Folder) -> list[np.ndarray]:
    """The time that effects which drift are given, by stretch of a recording [n]."""
    rows = [r for run in runs_of(measured, rig, "run") for r in models.recorded(run)]
    kalman = Kalman(rig, (), rows, ["position", "velocity"])
    values = np.array(list(kalman.whole.base_start().values()))
    return [kalman._rows(k, values).u[:, len(rig.model.inputs)] for k in range(len(rows))]


def test_a_drift_counts_from_where_the_recording_begins_and_goes_on_through_a_gap(rig):
    measured = record(Truth(), seconds=8.0)

    def changed(kept, shift: float) -> Measurement:
        channels = {
            n: replace(c, time=c.time[kept(c.time)] + shift, values=c.values[kept(c.time)])
            for n, c in measured.channels.items()
        }
        return replace(measured, channels=channels)

    (here,) = clocks(measured, rig)
    (later,) = clocks(changed(lambda t: t > -1.0, 4321.0), rig)
    assert later == pytest.approx(here, abs=1e-9)
    assert here[0] == 0.0
    first, second = clocks(changed(lambda t: (t < 3.0) | (t > 5.0), 0.0), rig)
    assert first[-1] < 3.0 < 4.9 < second[0]


def test_by_itself_a_model_knows_of_no_noise_however_late_its_sensor_is():
    """The position's noise has a memory, which the filter follows; what the model shows by itself has not."""
    folder, period = models.spring(), 0.02
    rng = np.random.default_rng(7)
    time = period * np.arange(200)
    lasting = np.convolve(rng.standard_normal(len(time)), 0.9 ** np.arange(40))[: len(time)]
    one = models.run({"force": (time, rng.uniform(-5, 5, len(time)))}, {"position": (time, 0.1 * lasting)})
    (effect,) = candidates(folder, ["force", "position"], [e for e in ALL if e.name == "sensor_delay"])
    kalman = Kalman(folder, (effect,), models.recorded(one), ["position"], correlated=["position"])
    lasts = {f"sigma of {CORRELATED}position": 0.1, f"tau of {CORRELATED}position": 0.2}
    shown = []
    for delay in (0.0, 1e-9):
        values = models.noise(kalman) | lasts | {effect.name("delay"): delay}
        run = kalman.run(values, (effect,), windows=[np.r_[0, np.ones(len(time) - 1, int)]])
        assert run is not None
        shown.append(run[0].free[1:])
    np.testing.assert_allclose(*shown, atol=1e-6)
