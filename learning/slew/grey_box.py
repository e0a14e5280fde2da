"""The hydraulic `slew` model refitted to recordings: what equations instead of networks give.

Each window is simulated from the measured history on: over its last second, the run-in, the chambers take
the measured pressures and the carriage the measured speed row by row, while spool, relief valves and brake
follow the joystick; then nothing is taken any more but joystick and inertia.  The encoder's speed is one
sensor delay late: the history tells the speed that long ago, and what is predicted is the late speed.

Fitted by the same least squares as the model itself (fmus/models/slew/fit.py): errors of speed, of angle (the
sum of the speed) and of both pressures over 10 s windows, exact sensitivities, the parameters in specs and
the spreads of start.toml as prior.  The sensor delay is fitted too, unless the speed is not
late.  Deterministic.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from fmus.models.slew import fit as slew_fit
from fmus.models.slew.model import MODEL
from fmus.models.slew.simulation import Course, Simulator
from fmus.models.slew_nn.network import HISTORY, PERIOD_S
from learning.slew.score import HORIZON, STRIDE, Predictor
from learning.slew.trajectory import REST, Trajectory, Windows, windows
from specs import parameters as parameter_specs
from specs.progress import Report

STEP_S = 0.004  # of the simulation; against 0.002 s the figures move by less than 1 %
RUN_IN = HISTORY  # rows of the history that are used
SENSOR_DELAY = "encoder_velocity_delay"
DELAY_SPREAD_S = 0.02  # of the datasheet's figure, which is approximate
DELAY_STEP_S = 0.02  # of the difference that its sensitivity is taken from
KNEE = 0.01  # rad/s: dry friction is rounded in the regression for the delay
WINDOWS, EVALUATIONS = 160, 20
TINY = {"count": 8, "evaluations": 2}  # for tests of the machinery
STATE_OF = {"p_a": "p_r", "p_b": "p_l"}  # state of the model -> chamber of a trajectory


@dataclass(frozen=True)
class GreyBox:
    """Fitted parameters by name in SI units, the sensor delay (s) among them, and what they came from."""

    values: Mapping[str, float]
    windows: int
    evaluations: int
    cost: float

    def predictor(self) -> Predictor:
        """Late speed of all windows from a second of history, the joystick and the inertia."""
        return lambda of: simulate(of, self.values)

    def figures(self) -> dict[str, Any]:
        """Fitted values, and what was fitted on."""
        return {
            "values": dict(self.values),
            "windows": self.windows,
            "evaluations": self.evaluations,
            "cost": self.cost,
        }


def fit(
    trajectories: Sequence[Trajectory],
    tiny: bool = False,
    report: Report | None = None,
    count: int = WINDOWS,
    evaluations: int = EVALUATIONS,
) -> GreyBox:
    """Fit to `count` windows spread over inertia and joystick; a minute.  InputError if there is none."""
    if tiny:
        count, evaluations = TINY["count"], TINY["evaluations"]
    chosen = _chosen(windows(trajectories, RUN_IN, HORIZON, STRIDE), count)
    delay = sensor_delay(trajectories)
    prior = _prior(delay)

    def blocks(values: Mapping[str, float]) -> Iterator[slew_fit.Block]:
        return _blocks(chosen, values)

    limits = slew_fit.limits("slew", slew_fit.starts()) | slew_fit.limits("machine", [SENSOR_DELAY])
    rows = [HORIZON] * len(chosen)
    problem = slew_fit.Problem(prior, limits, rows, blocks, report, evaluations)
    found = problem.solve({name: start for name, (start, _) in prior.items()})
    values = {SENSOR_DELAY: delay} | found.values
    return GreyBox(values, len(chosen), found.evaluations, found.cost)


def simulate(of: Windows, values: Mapping[str, float]) -> np.ndarray:
    """Late speeds [n, ahead] in rad/s."""
    return np.array([found["qd"] for found in _simulated(of, values)]).reshape(len(of), -1)


def _simulated(of: Windows, values: Mapping[str, float]) -> Iterator[dict[str, np.ndarray]]:
    run, delay = _simulator(()), values.get(SENSOR_DELAY, 0.0)
    p = run.parameters({n: v for n, v in values.items() if n != SENSOR_DELAY})
    for course in _courses(of, delay, run):
        yield _seen(run, run.follow(course, p)[0], delay)


def _seen(run: Simulator, states: np.ndarray, delay: float) -> dict[str, np.ndarray]:
    """What sensors show of `states` [rows, ..., NX] after the run-in: late speed, pressures [ahead, ...]."""
    ahead = len(states) - RUN_IN
    pressures = {n: states[-ahead:, ..., run.column(n)] for n in STATE_OF}
    return {"qd": _late(states[..., run.column("qd")], delay, ahead), **pressures}


def sensor_delay(trajectories: Sequence[Trajectory]) -> float:
    """An encoder's delay (s) in specs, or 0 if the speed is not late: what balances the pressures better.

    Regression of I w' + I' w on p_r - p_l, w and its sign.  It tells late speeds (recordings) from others
    (the slew traces) but is no estimate: the swinging tool turns the best lag of the balance to 0.15 s where
    the sensor's is 0.2 s.
    """
    datasheet = float(parameter_specs.load("machine")[SENSOR_DELAY].value)
    return max(0.0, datasheet, key=lambda delay: _explained(trajectories, delay))


def _explained(trajectories: Sequence[Trajectory], delay: float) -> float:
    parts = [_balance(t, delay) for t in trajectories]
    torque, causes = np.concatenate([a for a, _ in parts]), np.vstack([b for _, b in parts])
    fitted = causes @ np.linalg.lstsq(causes, torque, rcond=None)[0]
    return 1.0 - float(np.sum((torque - fitted) ** 2) / max(np.sum(torque**2), 1e-9))


def _balance(t: Trajectory, delay: float) -> tuple[np.ndarray, np.ndarray]:
    """Torque at rows 4.. by the late speed, and its causes as long ago; the differences span 0.2 s."""
    rows = np.arange(5, len(t) - 1)
    momentum = t.inertia * t.omega
    torque = (momentum[rows + 1] - momentum[rows - 1]) / (2 * PERIOD_S)
    pressure = np.interp(rows - delay / PERIOD_S, np.arange(len(t)), t.p_r - t.p_l)
    speed = t.omega[rows]
    return torque, np.stack([pressure / 1e3, speed * 1e5, np.tanh(speed / KNEE) * 1e4], axis=1)


def _prior(delay: float) -> dict[str, tuple[float, float]]:
    """Mean and spread: the values in specs, the spreads of start.toml; no sensor delay if there is none."""
    known = parameter_specs.load("slew")
    prior = {n: (float(known[n].value), spread) for n, (_, spread) in slew_fit.starts().items()}
    return prior | ({SENSOR_DELAY: (delay, DELAY_SPREAD_S)} if delay else {})


def _chosen(of: Windows, count: int) -> Windows:
    """At most `count` windows: evenly over quarters of the inertia and in each over the mean joystick."""
    inertia, joystick = of.inertia.mean(axis=1), of.u.mean(axis=1)
    quarter = np.searchsorted(np.quantile(inertia, [0.25, 0.5, 0.75]), inertia)
    order = np.lexsort((joystick, quarter))
    rows = order[np.linspace(0, len(of) - 1, min(count, len(of))).round().astype(int)]
    columns = {k: getattr(of, k)[rows] for k in ("u", "p_l", "p_r", "omega", "inertia", "owner")}
    return replace(of, **columns)


@cache
def _simulator(fitted: tuple[str, ...]) -> Simulator:
    return Simulator(fitted, replace(MODEL, step=STEP_S))


def _courses(of: Windows, delay: float, run: Simulator) -> Iterator[Course]:
    """What each window's run follows, from RUN_IN rows before it on; nothing measured after its beginning."""
    rows = slice(of.before - RUN_IN, None)
    inertia, joystick = of.inertia[:, rows], of.u[:, rows]
    step = np.diff(inertia, axis=1, prepend=inertia[:, :1])
    known = _known(of, delay, run)
    past = of.omega[:, : of.before], of.u[:, : of.before]
    threshold = run.start[run.model.index("parameters", "slew_brake_threshold")]
    released = (np.abs(past[0]) > REST).any(axis=1) | (np.abs(past[1]) > threshold).any(axis=1)
    for k in range(len(of)):
        yield Course(joystick[k], inertia[k] - step[k] / 2, step[k] / PERIOD_S, known[k], bool(released[k]))


def _known(of: Windows, delay: float, run: Simulator) -> np.ndarray:
    """States that the history tells [n, rows, NX]: pressures now, the speed as the encoder tells it later."""
    start = of.before - RUN_IN
    known = np.full((len(of), of.u.shape[1] - start, len(run.model.states)), np.nan)
    for state, chamber in STATE_OF.items():
        known[:, :RUN_IN, run.column(state)] = getattr(of, chamber)[:, start : of.before]
    late, share = divmod(delay / PERIOD_S, 1.0)
    told = RUN_IN - int(np.ceil(delay / PERIOD_S))
    first = start + int(late)
    speed = (1.0 - share) * of.omega[:, first : first + told]
    if share > 0.0:
        speed = speed + share * of.omega[:, first + 1 : first + 1 + told]
    known[:, :told, run.column("qd")] = speed
    known[:, 0, run.column("q")] = 0.0
    known[:, 0, run.column("spool")] = of.u[:, start]
    known[:, 0, run.column("relief")] = of.p_r[:, start] - of.p_l[:, start]
    return known


def _late(values: np.ndarray, delay: float, ahead: int) -> np.ndarray:
    """The last `ahead` rows of `values` [rows, ...] as they were `delay` ago."""
    late, share = divmod(delay / PERIOD_S, 1.0)
    end = len(values) - int(late)
    return (1.0 - share) * values[end - ahead : end] + share * values[end - ahead - 1 : end - 1]


def _blocks(of: Windows, values: Mapping[str, float]) -> Iterator[slew_fit.Block]:
    """Scaled errors of each window and their slopes by `values`, the sensor delay's by a difference."""
    names = tuple(n for n in values if n != SENSOR_DELAY)
    run, delay = _simulator(names), values.get(SENSOR_DELAY, 0.0)
    p = run.parameters({n: values[n] for n in names})
    late = SENSOR_DELAY in values
    moved = _simulated(of, {**values, SENSOR_DELAY: delay + DELAY_STEP_S}) if late else None
    for k, course in enumerate(_courses(of, delay, run)):
        states, sens = run.follow(course, p, sensitivities=True)
        now, slopes = _seen(run, states, delay), _seen(run, sens, delay)
        if moved is not None:
            slopes = {
                n: np.column_stack([slopes[n], (later - now[n]) / DELAY_STEP_S])
                for n, later in next(moved).items()
            }
        yield _block(_errors(of, k, now), slopes)


def _errors(of: Windows, k: int, now: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    measured = {"qd": of.omega, **{n: getattr(of, chamber) for n, chamber in STATE_OF.items()}}
    return {n: now[n] - measured[n][k, of.before :] for n in now}


def _block(errors: dict[str, np.ndarray], slopes: dict[str, np.ndarray]) -> slew_fit.Block:
    """The angle is the sum of the speed."""
    found = [parts | {"q": np.cumsum(parts["qd"], axis=0) * PERIOD_S} for parts in (errors, slopes)]
    scales = slew_fit.SCALES.items()
    return np.concatenate([found[0][n] / s for n, s in scales]), np.vstack(
        [found[1][n] / s for n, s in scales]
    )
