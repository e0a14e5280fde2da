"""The plain reference that slew networks are compared with: dead band, delay and first-order lag a direction.

    w' = (W(t) - w) / T,   W(t) = g+ max(u(t - d+) - b+, 0) - g- max(-u(t - d-) - b-, 0)

T is T+ or T- by the sign of W, and by that of w while W = 0; w is the speed as the encoder gives it, so
that the delays hold the encoder's.  Eight parameters.  `coasting` makes it a stronger one: another two lags
while W = 0, and a curve of W over the joystick in place of a line (fourteen parameters).

Fitted by simulation error from the measured speed on, on the measure it is judged by: mean absolute errors of
speed and angle over 10 s windows of the training recordings.  Direct search (Nelder-Mead), deterministic.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize

from fmus.models.slew_nn.network import HISTORY, PERIOD_S
from learning.slew.score import HORIZON, STRIDE, Predictor, score
from learning.slew.trajectory import Trajectory, Windows, windows
from specs.errors import InputError

BEFORE = HISTORY  # rows before a window: the longest delay
MOST_DELAY_S = (BEFORE - 1) * PERIOD_S
SEARCH_WINDOWS, FINAL_WINDOWS = 160, 700  # of the training recordings, evenly spread
STARTS = tuple((b, T) for b in (0.08, 0.16) for T in (0.6, 1.5))  # dead band, lag in s
START_DELAY_S = 0.35
EVALUATIONS = {"search": 250, "final": 700}
LEAST_LAG_S = 0.02
KNEES = (0.3, 0.6)  # of the way from the dead band to the full joystick: where the curve may bend


@dataclass(frozen=True)
class Direction:
    """One direction; `curve` are the slopes between KNEES as shares of the gain, three ones for a line."""

    dead_band: float  # joystick
    gain_rad_s: float  # speed per joystick beyond the dead band
    delay_s: float
    lag_s: float
    coast_lag_s: float  # while the joystick asks for no speed
    curve: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def speed(self, u: np.ndarray) -> np.ndarray:
        """Steady speed (rad/s, >= 0) at joystick `u` towards this direction."""
        if self.curve == (1.0, 1.0, 1.0):
            return self.gain_rad_s * np.maximum(u - self.dead_band, 0.0)
        ends = self.dead_band + (1.0 - self.dead_band) * np.array([0.0, *KNEES, 1.0])
        rises = self.gain_rad_s * np.diff(ends) * np.array(self.curve)
        return np.interp(u, ends, np.concatenate([[0.0], np.cumsum(rises)]))


@dataclass(frozen=True)
class FirstOrder:
    """Positive (counter-clockwise) and negative direction."""

    positive: Direction
    negative: Direction
    coasting: bool = False

    def predictor(self) -> Predictor:
        """Speed of all windows from the last measured one on and the joystick."""
        return lambda of: simulate(self, of)

    def figures(self) -> dict[str, Any]:
        """Parameters by direction, names with units."""
        hidden = set() if self.coasting else {"coast_lag_s", "curve"}
        return {
            way: {k: v for k, v in vars(getattr(self, way)).items() if k not in hidden}
            for way in ("positive", "negative")
        }


def simulate(model: FirstOrder, of: Windows) -> np.ndarray:
    """Speeds [n, ahead] in rad/s: exact steps of 0.1 s, with the mean of W over each."""
    up, down = model.positive, model.negative
    wanted = _delayed(up.speed(of.u), of.before, up.delay_s)
    wanted -= _delayed(down.speed(-of.u), of.before, down.delay_s)
    keep = {d: np.exp(-PERIOD_S / np.array([d.lag_s, d.coast_lag_s])) for d in (up, down)}
    idle = (wanted == 0.0).astype(int).T
    now, found = of.omega[:, of.before - 1], np.empty(wanted.shape[::-1])
    for k, goal in enumerate(np.ascontiguousarray(wanted.T)):
        forward = np.where(idle[k], now, goal) >= 0.0
        share = np.where(forward, keep[up][idle[k]], keep[down][idle[k]])
        now = goal + share * (now - goal)
        found[k] = now
    return found.T


def _delayed(speed: np.ndarray, before: int, delay_s: float) -> np.ndarray:
    """Mean of the delayed steady speed over each step ahead [n, ahead]; row k holds on (k - 1, k]."""
    whole, part = divmod(min(max(delay_s, 0.0), MOST_DELAY_S) / PERIOD_S, 1.0)
    last = before - int(whole)
    ahead = speed.shape[1] - before
    return (1.0 - part) * speed[:, last : last + ahead] + part * speed[:, last - 1 : last - 1 + ahead]


def fit(trajectories: Sequence[Trajectory], coasting: bool = False) -> FirstOrder:
    """Fit to recordings; seconds.  Raises InputError for none of 11 s, or if a direction is never driven."""
    every = _spread(windows(trajectories, BEFORE, HORIZON, STRIDE), FINAL_WINDOWS)
    few = _spread(every, SEARCH_WINDOWS)
    for way, most in (("positive", every.u.max()), ("negative", -every.u.min())):
        if most <= 2 * STARTS[0][0]:
            raise InputError(
                f"the joystick hardly goes {way} (at most {most:.2f}): that direction is unknown"
            )
    found = min((_search(_start(every, *s), few, "search") for s in STARTS), key=lambda m: _cost(m, few))
    if coasting:
        found = replace(found, coasting=True)
    return _search(_search(found, every, "final"), every, "final")


def _spread(of: Windows, count: int) -> Windows:
    """At most `count` windows, evenly spread."""
    chosen = np.unique(np.linspace(0, len(of) - 1, min(count, len(of))).round().astype(int))
    columns = {k: getattr(of, k)[chosen] for k in ("u", "p_l", "p_r", "omega", "inertia", "owner")}
    return replace(of, **columns)


def _start(of: Windows, dead_band: float, lag_s: float) -> FirstOrder:
    """The gain is what the mean speed over the mean joystick beyond the dead band says."""
    asked = np.maximum(np.abs(of.u) - dead_band, 0.0).mean()
    gain = np.abs(of.omega).mean() / max(asked, 1e-3)
    one = Direction(dead_band, float(gain), START_DELAY_S, lag_s, lag_s)
    return FirstOrder(one, one)


def _search(start: FirstOrder, of: Windows, what: str) -> FirstOrder:
    z = _packed(start)
    simplex = np.vstack([z, z + np.diag(_steps(start))])
    options = {
        "initial_simplex": simplex, "maxfev": EVALUATIONS[what] * (1 + start.coasting),
        "xatol": 1e-4, "fatol": 1e-5, "adaptive": True,
    }  # fmt: skip
    found = minimize(
        lambda y: _cost(_unpacked(y, start.coasting), of), z, method="Nelder-Mead", options=options
    )
    return _unpacked(found.x, start.coasting)


def _cost(model: FirstOrder, of: Windows) -> float:
    """Both errors weigh alike relatively."""
    found = score(lambda w: simulate(model, w), of)
    return float(np.log(found.velocity_mae) + np.log(found.position_mae))


def _packed(model: FirstOrder) -> np.ndarray:
    def one(d: Direction) -> list[float]:
        plain = [d.dead_band, np.log(d.gain_rad_s), d.delay_s, np.log(d.lag_s)]
        return plain + ([np.log(d.coast_lag_s), *np.log(d.curve[1:])] if model.coasting else [])

    return np.array([*one(model.positive), *one(model.negative)])


def _steps(model: FirstOrder) -> np.ndarray:
    return np.tile([0.03, 0.1, 0.08, 0.2, *([0.3, 0.2, 0.2] if model.coasting else [])], 2)


def _unpacked(z: np.ndarray, coasting: bool) -> FirstOrder:
    def lag(y: float) -> float:
        return max(LEAST_LAG_S, float(np.exp(y)))

    def one(y: np.ndarray) -> Direction:
        dead_band, delay = float(np.clip(y[0], 0.0, 0.9)), float(np.clip(y[2], 0.0, MOST_DELAY_S))
        plain = Direction(dead_band, float(np.exp(y[1])), delay, lag(y[3]), lag(y[4 if coasting else 3]))
        return replace(plain, curve=(1.0, float(np.exp(y[5])), float(np.exp(y[6])))) if coasting else plain

    first, second = np.split(z, 2)
    return FirstOrder(one(first), one(second), coasting)
