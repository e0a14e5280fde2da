"""The predictive controller: its model against the machine's, solver against known optima, fallback."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from baselines.nmpc import cost, estimator, lateness, prediction, solver
from baselines.nmpc.model import MODEL, PERIOD
from fmus.definition import Model
from fmus.equations import kinematics
from fmus.toolchain.build import build_fmu
from fmus.toolchain.discrete import DiscreteStepper
from fmus.toolchain.loader import load_model
from fmus.toolchain.stepper import Stepper
from tests.fmus.importer import Imported

POSE = (1.3, -1.9)
G = kinematics.geometry()
TASK = {
    "load": 0.0, "boom": POSE[0], "stick": POSE[1], "speed_limit": 0.5, "error": 4.0, "huber": 0.05,
    "tool": 3.0, "over": 100.0, "arm": 20.0, "arm_huber": 0.1, "end_error": 40.0, "end_speed": 20.0,
    "end_tool": 20.0, "step": 0.02,
}  # fmt: skip
STILL = np.zeros(3)


def _task(**changes: float) -> np.ndarray:
    return np.array([{**TASK, **changes}[name] for name in cost.TASK])


def _before(degrees: float) -> np.ndarray:
    """At rest, that far before the target."""
    x = prediction.rest(*POSE)
    x[0] = -np.radians(degrees)
    return x


def inputs(degrees: float, **changes: float) -> dict[str, float]:
    x, y, z = kinematics.grab_point(np.radians(degrees), *kinematics.arm_tip(*POSE, G), G)
    values = {"target_x": x, "target_y": y, "target_z": z, "pace": 1.0, "q_boom": POSE[0], "q_stick": POSE[1]}
    return values | {"p_slew_a": 1.6e6, "p_slew_b": 1.6e6, **changes}


def test_prediction_follows_the_machine_through_start_and_braking() -> None:
    """2.5 s of a slew with a tool that swings: 1 deg of slew and 4 deg of roll."""
    machine = Stepper(load_model("machine"), dict(zip(("start_q_boom", "start_q_stick"), POSE, strict=True)))
    x, u, load = ca.SX.sym("x", solver.NX), ca.SX.sym("u", 3), ca.SX.sym("load")  # type: ignore[call-arg]
    step = ca.Function("step", [x, u, load], [prediction.step(x, u, load, 0.05)])
    band = prediction.figures().slew_dead_band
    delay = round(machine.p[machine.model.index("parameters", "slew_delay")] / machine.step_s)
    believed, worst = prediction.rest(*POSE), np.zeros(2)
    machine.advance(1)
    machine.set(u_slew=float(prediction.joystick(0.4, band, 0.005)))
    machine.advance(delay)
    for k in range(50):
        opening = 0.4 if k < 25 else 0.1
        machine.set(
            u_slew=float(
                prediction.joystick(0.4 if k * 0.05 + delay * machine.step_s < 1.25 else 0.1, band, 0.005)
            )
        )
        machine.advance(100)
        believed = np.array(step(believed, [opening, 0, 0], 0)).ravel()
        seen = machine.state("slew_angle"), machine.state("tool_roll")
        worst = np.maximum(worst, np.abs(np.array(seen) - believed[[0, 5]]))
    assert machine.state("slew_angle") > np.radians(10)
    assert np.degrees(worst[0]) < 1.0
    assert np.degrees(worst[1]) < 4.0


def test_solver_ends_where_a_general_one_does() -> None:
    """IPOPT on the same plan and cost finds nothing better."""
    solve, start, task = solver.solver(), _before(40.0), _task()
    plan = np.zeros(solver.SIZE)
    for _ in range(4):
        plan, gain, own = solve(start, plan, STILL, task)
    z = ca.MX.sym("z", solver.SIZE)  # type: ignore[call-arg]
    value = solver.plan_cost(solver.stage(), cost.of_target())(start, z, STILL, task)
    low, high = solver.bounds()
    options = {"ipopt.print_level": 0, "print_time": False, "ipopt.hessian_approximation": "limited-memory"}
    options["ipopt.max_iter"] = 30
    found = ca.nlpsol("check", "ipopt", {"x": z, "f": value}, options)(x0=plan, lbx=low, ubx=high)
    assert float(gain) < 1e-6
    assert float(own) <= float(found["f"]) * (1 + 1e-4)
    assert np.all(np.array(plan).ravel() <= high + 1e-9)


def test_a_far_target_is_planned_with_full_commands_and_never_more() -> None:
    """Each solve goes on where the last one ended, and none makes the plan worse."""
    solve, x0 = solver.solver(), _before(100.0)
    plan, last = np.full(solver.SIZE, 0.1), np.inf
    low, high = solver.bounds()
    for _ in range(3):
        plan, _, value = solve(x0, plan, STILL, _task(speed_limit=5.0))
        assert float(value) <= last
        last = float(value)
    plan = np.array(plan).ravel()
    assert np.all((plan >= low - 1e-9) & (plan <= high + 1e-9))
    assert plan.max() == pytest.approx(1.0, abs=1e-6)


def test_a_dearer_change_of_opening_makes_a_smoother_plan() -> None:
    """Largest step of the opening from stage to stage, from one begin with the same state."""
    solve, steps = solver.solver(), []
    for price in (0.02, 0.2, 2.0):
        plan = np.zeros(solver.SIZE)
        for _ in range(3):
            plan, _, _ = solve(_before(60.0), plan, STILL, _task(step=price))
        steps.append(np.abs(np.diff(np.array(plan).ravel()[: solver.STAGES])).max())
    assert steps[0] > 1.2 * steps[1] > 1.44 * steps[2]


def test_the_state_ahead_is_as_many_ticks_later_as_commands_are_on_their_way() -> None:
    """A slew that turns evenly, the commands in neutral: 0.12 s and 0.2 s of its way."""
    x = prediction.rest(*POSE)
    x[1] = 0.2
    ways = []
    for ticks in (6, 10):
        later = estimator.ahead(ca.DM(x), ca.DM.zeros(3 * ticks), 0.0)
        ways.append(float(later[0]))
    assert ways == pytest.approx([0.2 * 0.12, 0.2 * 0.2], rel=0.1)


def test_of_the_commands_on_their_way_only_as_many_are_counted_on_as_asked_for() -> None:
    """The last ones, bit for bit as if there were no more; all of them where all are asked for."""
    x, sent = ca.DM(_before(20.0)), np.tile(np.linspace(0.1, 0.3, 10), (3, 1))
    for ticks in (6, 8, 10):
        some = estimator.ahead(x, ca.DM(sent.ravel()), 0.0, ca.DM(ticks))
        alone = estimator.ahead(x, ca.DM(sent[:, 10 - ticks :].ravel()), 0.0)
        assert np.array_equal(np.array(some), np.array(alone))


@pytest.mark.parametrize(("late", "found"), [(0, 0), (4, 0), (8, 4), (10, 4)])
@pytest.mark.parametrize("inertia", [300e3, 900e3])
def test_a_speed_that_is_late_behind_the_pressures_is_found_whatever_the_inertia(
    late: int, found: int, inertia: float
) -> None:
    """Torques of starts and stops for 30 s, a gyro with noise: late are 0.16 s and more."""
    stepper, turned = _driven(inertia, late, seconds=30.0)
    assert lateness_of(stepper) == found
    assert turned > np.radians(5)


def test_a_machine_that_stands_tells_no_lateness() -> None:
    """Noise of gyro and pressures, as if everything was late."""
    stepper, _ = _driven(400e3, 4, seconds=30.0, torque=0.0)
    assert lateness_of(stepper) == 0


def _driven(
    inertia: float, late: int, seconds: float, torque: float = 100e3
) -> tuple[DiscreteStepper, float]:
    """`lateness` alone beside a free inertia with friction; its angle's largest size."""
    stepper, draw = DiscreteStepper(_alone()), np.random.default_rng(5)
    displacement = stepper.p[stepper.model.index("parameters", "control_displacement")]
    speeds, speed, angle, most = [0.0] * (late + 1), 0.0, 0.0, 0.0
    for tick in range(round(seconds / 0.02)):
        wanted = torque * float(np.sign(np.sin(0.9 * 0.02 * tick))) * (np.sin(2.3 * 0.02 * tick) > 0)
        speed += 0.02 * (wanted - 0.3 * inertia * speed) / inertia
        angle += 0.02 * speed
        most = max(most, abs(angle))
        speeds = [*speeds[1:], speed]
        noise = draw.normal(0, (0.002, 2e4))
        stepper.set(
            imu_cabin_rate_z=speeds[0] + noise[0],
            p_slew_a=5e6 + wanted / displacement + noise[1],
            p_slew_b=5e6,
        )
        stepper.advance()
    return stepper, most


def _alone() -> Model:
    """The equations of `lateness` as a model of their own."""
    return Model(
        name="lateness", description="", kind="discrete", step=MODEL.step, states=lateness.STATES, modes=(),
        inputs=tuple(v for v in MODEL.inputs if v.name in ("imu_cabin_rate_z", "p_slew_a", "p_slew_b")),
        outputs=(), parameters=MODEL.parameters, symbolic="MX",
        rhs=lambda x, u, m, p: lateness.told(x, u, u.imu_cabin_rate_z, p), out=lambda x, u, m, p: {},
    )  # fmt: skip


def lateness_of(stepper: DiscreteStepper) -> int:
    """Ticks that the states of `lateness` tell."""
    alike = {name: ca.DM(stepper.state(name)) for name in (f"alike_{k}" for k in (0, lateness.LATE))}
    margin = stepper.p[stepper.model.index("parameters", "nmpc_margin")]
    return round(float(lateness.ticks(SimpleNamespace(**alike), SimpleNamespace(nmpc_margin=margin))))


def test_a_plan_that_is_not_good_enough_is_counted_and_not_used() -> None:
    """With a tolerance that nothing meets, every solve falls back: slowly to the target, the arm at rest."""
    model = load_model("nmpc")
    stepper = DiscreteStepper(model, {"nmpc_tolerance": 1e-6})
    stepper.set(**inputs(80.0, q_boom=1.0))
    stepper.advance(1)
    assert stepper.state("fallbacks") == stepper.state("solves") == 1.0
    assert stepper.state("boom_reference") == 0.0
    assert 0.1 < stepper.state("slew_command") < 0.5
    own = DiscreteStepper(model)
    own.set(**inputs(80.0, q_boom=1.0))
    own.advance(2 * PERIOD + 1)
    assert own.state("solves") == 3.0
    assert own.state("fallbacks") < 3.0
    assert own.state("boom_reference") > 0.0


def test_fmu_gives_the_equations_numbers() -> None:
    """The generated C against CasADi over three solves, to rounding: sine and sums of products differ.

    Later the plans part: each begins where the last one ended, and a machine that does not answer commands,
    as here, lets a difference grow.  That the C repeats itself to the last bit is what `bench nmpc` checks.
    """
    stepper = DiscreteStepper(MODEL)
    names = [v.name for v in MODEL.inputs]
    outputs = [v.name for v in MODEL.outputs]
    with Imported(build_fmu("nmpc", 2)) as instance:
        for tick in range(2 * PERIOD + 1):
            values = inputs(60.0, q_slew=0.002 * tick, imu_tool_roll=0.05 * np.sin(0.1 * tick))
            stepper.set(**values)
            instance.set(**{n: values[n] for n in names if n in values})
            stepper.advance()
            instance.step()
            np.testing.assert_allclose(instance.get(*outputs), list(stepper.outputs().values()), atol=1e-6)


@pytest.mark.parametrize("load", [0.0, 2000.0])
def test_pendulum_lengths_are_the_machines(load: float) -> None:
    """Periods of roll and pitch as the machine's model has them (fmus/models/machine/README.md)."""
    roll, pitch, mass = (float(v) for v in prediction.tool_lengths(load))
    periods = [2 * np.pi * np.sqrt(length / 9.81) for length in (roll, pitch)]
    np.testing.assert_allclose(periods, (2.66, 2.84), rtol=0.02)
    assert 0.7 * (1720 + load) < mass < 1720 + load
