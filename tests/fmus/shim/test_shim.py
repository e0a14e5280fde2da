"""What every FMU must do, tested on a small model that has one of everything, in FMI 2 and FMI 3."""

import shutil
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

from fmus.definition import Model, Variable
from fmus.toolchain import compiler
from fmus.toolchain.build import build_fmu, compile_library, generate_sources
from fmus.toolchain.loader import load_model
from fmus.toolchain.stepper import Stepper
from specs.errors import InputError
from tests.fmus.importer import Imported

OSCILLATOR = Path(__file__).parents[1] / "samples" / "oscillator"
OUTPUTS = ["angle", "measured", "moving", "rate"]


@pytest.fixture(scope="module", params=[2, 3], ids=["FMI2", "FMI3"])
def fmu(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_fmu(OSCILLATOR, request.param, out=tmp_path_factory.mktemp("fmu"))


def test_validates(fmu: Path) -> None:
    assert validate_fmu(str(fmu)) == []


def test_builds_the_same_bytes_again(fmu: Path, tmp_path: Path) -> None:
    version = 2 if "FMI2" in str(fmu) else int(Imported(fmu).version)
    assert build_fmu(OSCILLATOR, version, out=tmp_path).read_bytes() == fmu.read_bytes()


def test_step_follows_the_written_scheme(fmu: Path) -> None:
    """The C step equals ROS2 written out with CasADi's functions and numpy's solver."""
    model = load_model(OSCILLATOR)
    p = model.start_parameters({"torque_delay": 0.0, "friction": 0.05})
    x, u, m, h = np.array([1.0, 0.0, 1.0]), np.array([0.2, 0.0]), np.array([0.0]), model.step
    gamma = 1 - 1 / np.sqrt(2)
    a = np.eye(3)
    for k in range(10):
        if k % model.serves == 0:
            a = np.eye(3) - gamma * h * np.array(model.jacobian(x, u, m, p))
        k1 = np.linalg.solve(a, np.array(model.f(x, u, m, p)).ravel())
        k2 = np.linalg.solve(a, np.array(model.f(x + h * k1, u, m, p)).ravel() - 2 * k1)
        x = x + h * (1.5 * k1 + 0.5 * k2)
    with Imported(fmu, torque_delay=0.0, friction=0.05, switch_delay=1.0) as i:
        i.run(1, {"torque": 0.2}, OUTPUTS)
        assert i.get("state.q", "state.v", "state.follower") == pytest.approx(
            x.tolist(), rel=1e-12, abs=1e-14
        )


def test_integrator_is_second_order(tmp_path: Path) -> None:
    """Halving the step of a smooth, partly stiff problem divides the error by about four."""

    def end_state(step: float) -> np.ndarray:
        model = Model(
            name="smooth",
            description="",
            kind="continuous",
            step=step,
            sample_time=0.02,
            states=(Variable("a", "1", start=1.0), Variable("b", "1")),
            inputs=(Variable("u", "1"),),
            outputs=(Variable("y", "1"),),
            parameters=(),
            rhs=lambda x, u, m, p: {"a": -ca.sin(x.a) * x.b, "b": 50 * (ca.cos(x.a) - x.b)},
            out=lambda x, u, m, p: {"y": x.a},
        )
        a, h, x = np.zeros((2, 2)), step, np.array([1.0, 0.0])
        none = np.zeros(0)
        for _ in range(round(1.0 / step)):
            a = np.eye(2) - (1 - 1 / np.sqrt(2)) * h * np.array(model.jacobian(x, 0, none, none))
            k1 = np.linalg.solve(a, np.array(model.f(x, 0, none, none)).ravel())
            k2 = np.linalg.solve(a, np.array(model.f(x + h * k1, 0, none, none)).ravel() - 2 * k1)
            x = x + h * (1.5 * k1 + 0.5 * k2)
        return x

    fine = end_state(0.0005)
    errors = [float(np.abs(end_state(h) - fine).max()) for h in (0.008, 0.004)]
    assert 1.7 < np.log2(errors[0] / errors[1]) < 2.5


@pytest.mark.parametrize("change", ["parameter", "input"])
def test_a_changed_parameter_or_input_wants_new_factors(fmu: Path, change: str) -> None:
    """One internal step into what the factors serve; setting a value again changes nothing."""
    changed = {"stiffness": 50.0} if change == "parameter" else {"push": 2.0}
    with Imported(fmu, torque_delay=0.0, friction=0.05, switch_delay=1.0) as i:
        stepper = Stepper(
            load_model(OSCILLATOR), {"torque_delay": 0.0, "friction": 0.05, "switch_delay": 1.0}
        )
        i.step(0.002)
        i.set(**changed)
        i.step(0.002)
        i.set(**changed)
        i.step(0.016)
        stepper.advance()
        if change == "parameter":
            stepper.p[stepper.model.index("parameters", "stiffness")] = 50.0
        else:
            stepper.set(push=2.0)
        stepper.advance(9)
        assert i.get("state.q", "state.v") == pytest.approx(stepper.x[:2].tolist(), rel=1e-12, abs=1e-14)


def test_cut_communication_steps_give_the_same_bits(fmu: Path) -> None:
    with Imported(fmu) as whole, Imported(fmu) as cut:
        whole.step(0.04)
        for _ in range(20):
            cut.step(0.002)
        assert cut.get("state.q", "state.v", "angle") == whole.get("state.q", "state.v", "angle")


def test_input_delay_is_exact(fmu: Path) -> None:
    """A torque set now moves the rate only after the delay, to the tick."""
    with Imported(fmu, start_angle=0.0, torque_delay=0.1, friction=0.0) as i:
        rows = i.run(8, {"torque": 1.0}, ["rate"])
    moved = [k for k, (rate,) in enumerate(rows) if rate != 0.0]
    assert moved[0] == 5  # five steps of 0.02 s see nothing, the sixth does


def test_sensor_delay_and_hold(fmu: Path) -> None:
    with Imported(fmu, seed=0, sensor_delay=0.06) as i:
        rows = np.array(i.run(50, {"torque": 0.0}, ["state.follower", "measured"]))
    np.testing.assert_array_equal(rows[3:, 1], rows[:-3, 0])


def test_noise_has_its_deviation_and_depends_on_the_seed(fmu: Path) -> None:
    def noise(seed: int) -> np.ndarray:
        with Imported(fmu, seed=seed, start_angle=0.0, sensor_noise=0.5) as i:
            return np.array(i.run(3000, {"torque": 0.0}, ["measured"])).ravel()

    first, same, other, off = noise(5), noise(5), noise(6), noise(0)
    np.testing.assert_array_equal(first, same)
    assert first.std() == pytest.approx(0.5, rel=0.05)
    assert abs(first.mean()) < 0.05
    assert abs(np.corrcoef(first, other)[0, 1]) < 0.06
    assert abs(np.corrcoef(first[1:], first[:-1])[0, 1]) < 0.06
    assert not off.any()


def test_mode_switches_after_its_guard_has_held(fmu: Path) -> None:
    with Imported(fmu, start_angle=0.5, switch_delay=0.1) as i:
        rows = np.array(i.run(40, {"torque": 0.0}, ["moving", "rate"]))
    fast = int(np.argmax(np.abs(rows[:, 1]) > 0.1))
    switched = int(np.argmax(rows[:, 0] > 0.5))
    assert 4 <= switched - fast <= 6


@pytest.mark.parametrize("ticks", [1, 3, 17, 44])
def test_restored_state_has_the_same_future(fmu: Path, ticks: int) -> None:
    """Also half-way through the delay of a torque step, and in another instance."""
    with Imported(fmu, seed=9) as i, Imported(fmu, seed=4, start_angle=0.2) as other:
        i.run(ticks, {"torque": 0.3}, OUTPUTS)
        i.set(torque=-1.0)
        i.step()
        state = i.saved()
        future = i.run(60, {"push": 0.1}, OUTPUTS)
        i.restore(state)
        assert i.run(60, {"push": 0.1}, OUTPUTS) == future
        other.restore(state)
        assert other.run(60, {"push": 0.1}, OUTPUTS) == future


def test_restored_in_another_process(fmu: Path, tmp_path: Path) -> None:
    with Imported(fmu, seed=9) as i:
        i.run(7, {"torque": 0.3}, OUTPUTS)
        (tmp_path / "state").write_bytes(i.saved())
        future = i.run(20, {"torque": -0.2}, OUTPUTS)
    code = (
        "import sys; from pathlib import Path; from tests.fmus.importer import Imported\n"
        f"i = Imported(Path({str(fmu)!r})); i.restore(Path({str(tmp_path / 'state')!r}).read_bytes())\n"
        f"print(repr(i.run(20, {{'torque': -0.2}}, {OUTPUTS!r})))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == repr(future)


def test_foreign_state_is_refused(fmu: Path) -> None:
    with Imported(fmu) as i:
        state = bytearray(i.saved())
        state[12] ^= 1
        with pytest.raises(FMICallException):
            i.restore(bytes(state))


def test_directional_derivatives_are_partials(fmu: Path) -> None:
    """Against differences of the exposed rates; a delayed input and a held sensor have none."""
    with Imported(fmu, start_angle=0.7) as i:
        i.run(20, {"torque": 0.3, "push": 0.2}, OUTPUTS)
        before = i.get("der(state.v)")[0]
        exact = i.derivative("der(state.v)", "stiffness")
        i.set(stiffness=4.0 + 1e-6)
        assert exact == pytest.approx((i.get("der(state.v)")[0] - before) / 1e-6, rel=1e-4)
        assert i.derivative("der(state.v)", "push") == 1.0
        assert i.derivative("der(state.v)", "torque") == 0.0
        assert i.derivative("angle", "state.q") == 1.0
        assert i.derivative("measured", "state.follower") == 0.0


def test_parameter_out_of_bounds_is_refused(fmu: Path) -> None:
    with Imported(fmu) as i, pytest.raises(FMICallException):
        i.set(stiffness=-1.0)


def test_wrong_step_size_is_refused(fmu: Path) -> None:
    with Imported(fmu) as i, pytest.raises(FMICallException):
        i.step(0.0213)


def test_not_a_number_fails_the_step(fmu: Path) -> None:
    with Imported(fmu, torque_delay=0.0) as i, pytest.raises(FMICallException):
        i.run(1, {"push": float("nan")}, OUTPUTS)


def test_feed_through_is_refused() -> None:
    direct = Variable("u", "1")
    model = Model(
        name="direct",
        description="",
        kind="discrete",
        step=0.02,
        states=(Variable("x", "1"),),
        inputs=(direct,),
        outputs=(Variable("y", "1"),),
        parameters=(),
        rhs=lambda x, u, m, p: {"x": u.u},
        out=lambda x, u, m, p: {"y": x.x + u.u},
    )
    from fmus.toolchain.codegen import check_no_feedthrough

    with pytest.raises(InputError, match="output y depends on input u at the same instant"):
        check_no_feedthrough(model)


def test_step_needs_no_allocation_and_no_libm(tmp_path: Path) -> None:
    """What the objects of a step import: memory copies and the formatting of an error, nothing else."""
    model, host = load_model(OSCILLATOR), compiler.host().name
    generate_sources(model, tmp_path)
    for name in ("core.c", "integrator.c", "model.c"):
        built = compiler.compile_object(tmp_path / name, tmp_path / "o.o", host, generated=True)
        done = subprocess.run(["nm", "-u", str(built)], capture_output=True, text=True, check=True)
        imported = {line.split()[-1] for line in done.stdout.splitlines()}
        outside = {n for n in imported if not n.startswith(("slw_", "_GLOBAL", "__stack_chk"))}
        assert outside <= {"memcpy", "memset", "memcmp", "snprintf", "__snprintf_chk"}, (name, outside)


CALLS_LIBM = """
import casadi as ca

from fmus.definition import Model, Variable

MODEL = Model(
    name="calls_libm",
    description="Functions that slw_math.h has not",
    kind="continuous",
    step=0.01,
    states=(Variable("x", "1", "State", start=4.0),),
    inputs=(),
    outputs=(Variable("y", "1", "Value"),),
    parameters=(),
    rhs=lambda x, u, m, p: {"x": 0.0 * x.x},
    out=lambda x, u, m, p: {"y": ca.hypot(x.x, 3.0) * x.x**1.5 + ca.asin(0.1 * x.x)},
)
"""


@pytest.mark.parametrize("zig", ["", "1"], ids=["cc", "ziglang"])
def test_a_model_may_call_functions_that_our_mathematics_has_not(tmp_path: Path, monkeypatch, zig: str):
    """Compilers of today refuse a function that is not declared; who loads a library may have no libm."""
    monkeypatch.setenv(compiler.ALWAYS_ZIG, zig)
    for cached in ("command", "identity"):
        monkeypatch.setattr(compiler, cached, getattr(compiler, cached).__wrapped__)
    folder = tmp_path / "calls_libm"
    folder.mkdir()
    (folder / "model.py").write_text(CALLS_LIBM, encoding="utf-8")
    fmu = Imported(build_fmu(folder, 3, out=tmp_path / "out"))
    assert fmu.get("y") == [pytest.approx(5.0 * 8.0 + np.arcsin(0.4), rel=1e-15)]


def test_cache_compiles_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    model, host = load_model(OSCILLATOR), compiler.host().name
    generate_sources(model, tmp_path)
    first = compile_library(model, tmp_path, 2, host)
    monkeypatch.setattr(compiler, "compile_object", lambda *a, **k: pytest.fail("compiled again"))
    assert compile_library(model, tmp_path, 2, host) == first


@pytest.mark.long
def test_using_an_fmu_keeps_its_other_platforms(tmp_path: Path) -> None:
    """Built for two platforms, then asked for without saying which: nothing is lost."""
    host = compiler.host().name
    both = build_fmu(OSCILLATOR, 3, [host, "aarch64-linux"], out=tmp_path).read_bytes()
    assert build_fmu(OSCILLATOR, 3, out=tmp_path).read_bytes() == both
    assert build_fmu(OSCILLATOR, 3, [host], out=tmp_path).read_bytes() != both


@pytest.mark.parametrize("above", ["work", "systems"])
def test_a_changed_model_is_built_again_wherever_it_lies(above: str, tmp_path: Path) -> None:
    """`systems` and the like are passed over inside the project, not when a folder above is called so."""
    folder = tmp_path / above / "oscillator"
    shutil.copytree(OSCILLATOR, folder)
    first = build_fmu(folder, out=tmp_path).read_bytes()
    text = (folder / "model.py").read_text()
    (folder / "model.py").write_text(text.replace('description="', 'description="Changed: ', 1))
    assert (folder / "model.py").read_text() != text
    assert build_fmu(folder, out=tmp_path).read_bytes() != first
