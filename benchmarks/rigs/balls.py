"""What the recordings of falling balls tell by themselves: `python -m benchmarks.rigs.balls`.

Plain least squares, without anything of `reconcile`: for each law of a force against the motion its one
coefficient, and height and speed at the start of each drop.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

DATA = Path(__file__).resolve().parents[2] / "tests" / "data" / "ball_drops"
GRAVITY = 9.81  # m/s2

LAWS: dict[str, tuple[Callable[[float, float], float], float, str]] = {  # force by mass, first guess, unit
    "nothing": (lambda _c, _v: 0.0, 0.0, ""),
    "drag, c v |v|": (lambda c, v: c * v * abs(v), 0.01, "1/m"),
    "viscous, c v": (lambda c, v: c * v, 0.1, "1/s"),
    "constant, c sgn v": (lambda c, v: c * float(np.tanh(1000.0 * v)), 0.5, "m/s2"),
}


def drops() -> list[np.ndarray]:
    """Time (s) and height (m) of each drop, [samples, 2]."""
    return [np.loadtxt(f, delimiter=",", skiprows=1) for f in sorted(DATA.glob("*.csv"))]


def fit(law: Callable[[float, float], float], guess: float) -> tuple[float, float]:
    """Coefficient of a law, and the error of the heights that is left (m, rms)."""
    recorded = drops()

    def errors(p: np.ndarray) -> np.ndarray:
        return np.concatenate(
            [_fall(law, p[-1], d[:, 0], p[2 * i : 2 * i + 2]) - d[:, 1] for i, d in enumerate(recorded)]
        )

    start = [x for d in recorded for x in (d[0, 1], 0.0)] + [guess]
    found = least_squares(errors, start)
    return float(found.x[-1]), float(np.sqrt(np.mean(found.fun**2)))


def _fall(law: Callable[[float, float], float], c: float, time: np.ndarray, start: np.ndarray) -> np.ndarray:
    def rates(_t: float, x: np.ndarray) -> list[float]:
        return [x[1], -GRAVITY - law(c, x[1])]

    return solve_ivp(rates, (time[0], time[-1]), start, t_eval=time, rtol=1e-8, atol=1e-9).y[0]


if __name__ == "__main__":
    for name, (law, guess, unit) in LAWS.items():
        c, left = fit(law, guess)
        print(f"{name:18} {f'c = {c:.4f} {unit}' if unit else '':20} {left:.3f} m left (rms)")
