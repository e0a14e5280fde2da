"""LQR and Kalman gains of slew and swinging tool, by python-control: `python -m baselines.lqr.design`.

The drive is linearised at five inertias (`baselines.analysis.slew_plant`); its slow pole is kept, its
dead time and the spool are two lags.  States, with psi the tool's roll over the radius of its suspension:

    q' = w,  w' = (w2 - w) / T,  w2' = (w1 - w2) / dead,  w1' = (v - w1) / lag
    psi'' = -(g psi + w') / l - b psi'

Weights by Bryson's rule: one over the square of what is still acceptable.  Gains go to gains.toml.
"""

from pathlib import Path

import control
import numpy as np

from baselines.analysis import slew_plant
from specs import parameters

STEP = 0.02  # s
INERTIAS = (250e3, 400e3, 600e3, 900e3, 1400e3)  # kg m2
NOMINAL = 1  # of these: where the Kalman filter is designed
JOYSTICK = 0.25  # where the drive is linearised
HOLD_S = 1.5 * STEP  # a command appears one step late and is held for one
STATES = ("q", "w", "w1", "w2", "psi", "psi_rate")
ACCEPTED = {"q": 0.04, "w": 0.2, "w1": np.inf, "w2": np.inf, "psi": 0.006, "psi_rate": 0.014}  # rad, rad/s
EFFORT = 0.12  # rad/s of v
DISTURBED = {"w": 0.15, "psi_rate": 0.01}  # rad/s2, of the Kalman filter: what the model does not know
NOISE = (0.0005, 0.004, 0.0004, 0.0004)  # q, w, psi, psi_rate: sensors at a radius of 10 m
RADIUS = 10.0  # m, of the pendulum's suspension
GAINS = Path(__file__).with_name("gains.toml")


def time_constants() -> list[float]:
    """Slow pole of the linearised drive at each inertia, as a time constant (s)."""
    found = []
    for inertia in INERTIAS:
        poles = slew_plant(inertia, JOYSTICK).system.poles()
        found.append(-1.0 / max(float(p.real) for p in poles if p.real < -1e-6))
    return found


def matrices(time_constant: float) -> tuple[np.ndarray, np.ndarray]:
    """(A, B) of the continuous model at one time constant of the drive (s)."""
    known = parameters.load("geometry", "tool", "slew")
    lag, dead = known["slew_spool_lag"].value, known["slew_delay"].value + HOLD_S
    length, damping, gravity = (known[n].value for n in ("tool_length_x", "tool_damping_x", "gravity"))
    rate = 1.0 / time_constant
    a = np.zeros((6, 6))
    a[0, 1] = 1.0
    a[1, [1, 3]] = -rate, rate
    a[2, 2] = -1.0 / lag
    a[3, [2, 3]] = 1.0 / dead, -1.0 / dead
    a[4, 5] = 1.0
    a[5] = -a[1] / length
    a[5, [4, 5]] += -gravity / length, -damping
    return a, np.array([[0.0], [0.0], [1.0 / lag], [0.0], [0.0], [0.0]])


def sampled(time_constant: float) -> tuple[np.ndarray, np.ndarray]:
    """The same over a step with v held."""
    a, b = matrices(time_constant)
    system = control.c2d(control.ss(a, b, np.eye(6), 0.0), STEP)
    return np.asarray(system.A), np.asarray(system.B)


def regulator(time_constant: float) -> np.ndarray:
    """LQR gains [6] of v on the states' deviations."""
    a, b = sampled(time_constant)
    weights = np.diag([1.0 / ACCEPTED[name] ** 2 for name in STATES])
    gain, _, _ = control.dlqr(a, b, weights, [[1.0 / EFFORT**2]])
    return np.asarray(gain).ravel()


def estimator(time_constant: float) -> np.ndarray:
    """Kalman gains [6, 4] of the states on what q, w, psi and psi_rate show beside their prediction."""
    a, _ = sampled(time_constant)
    process = np.diag([(DISTURBED.get(name, 1e-6) * STEP) ** 2 for name in STATES])
    sensors = np.eye(6)[[0, 1, 4, 5]]
    gain, _, _ = control.dlqe(a, np.eye(6), sensors, process, np.diag(np.square(NOISE)))
    return np.asarray(gain)


def write() -> Path:
    """Design all gains and write gains.toml; returns its path."""
    times = time_constants()
    lines = [
        "# LQR and Kalman gains; made by python -m baselines.lqr.design, do not edit.",
        f"# States: {', '.join(STATES)}; sensors: q, w, psi, psi_rate.",
        "",
        f"inertia = {_row(np.array(INERTIAS))}  # kg m2",
        f"time_constant = {_row(np.array(times))}  # s, slow pole of the drive there",
        "regulator = [",
        *(f"    {_row(regulator(t))}," for t in times),
        "]",
        "estimator = [",
        *(f"    {_row(row)}," for row in estimator(times[NOMINAL])),
        "]",
    ]
    GAINS.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return GAINS


def _row(values: np.ndarray) -> str:
    return "[" + ", ".join(f"{value:.5g}" if abs(value) > 1e-6 else "0.0" for value in values) + "]"


if __name__ == "__main__":
    print(write())
