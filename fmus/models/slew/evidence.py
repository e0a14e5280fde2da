"""What the traces say about the slew model: which parameters they identify, where it errs, where they err.

Figures for the validation dossier; all from the shipped parameters and the traces, none fitted here.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fmus.models.slew import fit as fitting, traces
from fmus.models.slew.score import BAR, Run
from fmus.models.slew.traces import PERIOD, Trace
from specs import parameters as parameter_specs

MOVING = np.radians(1.0)  # rad/s
NEUTRAL = 0.02  # joystick
STEADY = np.radians(1.5)  # rad/s2: less than this is steady motion
REGIMES = (
    "rest",
    "break-away",
    "accelerating",
    "steady",
    "slowing under drive",
    "coasting",
    "against motion",
)


@dataclass(frozen=True)
class Identifiability:
    """How much the traces say about each fitted parameter, linearised at the fit, everything in spreads.

    `resolution` is the share of a value that comes from the traces, the rest from its start; `deviation` its
    standard deviation with both taken into account; `singular_values` are those of the data's Jacobian.
    """

    names: tuple[str, ...]
    resolution: np.ndarray
    deviation: np.ndarray
    correlation: np.ndarray
    singular_values: np.ndarray

    @property
    def coupled(self) -> list[tuple[str, str, float]]:
        """Pairs of parameters that the fit can hardly tell apart (|correlation| > 0.7), strongest first."""
        n = len(self.names)
        pairs = [(i, j) for i in range(n) for j in range(i + 1, n) if abs(self.correlation[i, j]) > 0.7]
        found = [(self.names[i], self.names[j], float(self.correlation[i, j])) for i, j in pairs]
        return sorted(found, key=lambda pair: -abs(pair[2]))


def identifiability(result: fitting.Fit) -> Identifiability:
    """From the Jacobian of a fit; the errors' size scales the deviations."""
    information = result.jacobian.T @ result.jacobian
    prior = fitting.PRIOR_WEIGHT**2 * np.eye(len(information))
    covariance = np.linalg.inv(information + prior)
    deviation = np.sqrt(np.diag(covariance))
    return Identifiability(
        names=tuple(result.values),
        resolution=np.diag(covariance @ information).copy(),
        deviation=fitting.PRIOR_WEIGHT * deviation,
        correlation=covariance / np.outer(deviation, deviation),
        singular_values=np.linalg.svd(result.jacobian, compute_uv=False),
    )


def shipped() -> fitting.Fit:
    """The fit's errors and Jacobian at the shipped parameters, without fitting."""
    values = {n: p.value for n, p in parameter_specs.load("slew").items()}
    return fitting.fit(start={n: values[n] for n in fitting.starts()}, evaluations=1)


def parameters(result: fitting.Fit) -> dict[str, Any]:
    """Every fitted parameter: value, start, spread, deviation (SI), resolution, and the shipped value."""
    known, prior, found = parameter_specs.load("slew"), fitting.starts(), identifiability(result)
    table = {}
    for i, (name, value) in enumerate(result.values.items()):
        start, spread = prior[name]
        table[name] = {
            "value": value,
            "unit": known[name].unit,
            "start": start,
            "spread": spread,
            "deviation": float(found.deviation[i] * spread),
            "resolution": float(found.resolution[i]),
            "shipped": known[name].value,
        }
    return table


def regime(trace: Trace) -> np.ndarray:
    """Index into REGIMES of every row of a trace, by its joystick and its motion."""
    acceleration = np.gradient(trace.qd, PERIOD)
    moving, driven = np.abs(trace.qd) > MOVING, np.abs(trace.u_slew) > NEUTRAL
    along = np.sign(trace.u_slew) == np.sign(trace.qd)
    gaining = acceleration * np.sign(trace.qd)
    conditions = [
        ~moving & ~driven,
        ~moving & driven,
        driven & along & (gaining > STEADY),
        driven & along & (np.abs(gaining) <= STEADY),
        driven & along,
        ~driven,
    ]
    return np.select(conditions, range(6), 6)


def residuals(chosen: Iterable[Trace], values: Mapping[str, float] | None = None) -> list[dict[str, Any]]:
    """Model minus traces by regime and direction of the motion (or of the joystick at rest).

    Each row: regime, direction, samples, and bias and mean absolute error of speed (°/s) in the direction of
    the motion and of the pressure difference (bar).
    """
    chosen = list(chosen)
    runs = fitting.simulate(chosen, values)
    columns = [_columns(t, runs[t.name]) for t in chosen]
    index, sign, speed, pressure = (np.concatenate(c) for c in zip(*columns, strict=True))
    rows = []
    for k, name in enumerate(REGIMES):
        for direction in (1, -1):
            rows_here = (index == k) & (sign == direction)
            if rows_here.any():
                rows.append(_row(name, direction, speed[rows_here], pressure[rows_here]))
    return rows


def asymmetry(known: Mapping[str, Trace]) -> list[dict[str, Any]]:
    """Per mirrored pair: half the traces' difference, beyond any symmetric model, and the model's error.

    Where the first is of the size of the second, the traces cannot say more about the model.
    """
    pairs = [(t, known[t.partner]) for t in known.values() if t.partner > t.name and t.partner in known]
    runs = fitting.simulate(t for pair in pairs for t in pair)
    rows = []
    for one, other in pairs:
        settled = slice(one.first, None)
        halves = np.abs(one.qd + other.qd)[settled] / 2
        errors = [np.abs(runs[t.name].qd - t.qd[settled]).mean() for t in (one, other)]
        rows.append(
            {
                "trace": one.name,
                "inertia_kg_m2": one.inertia,
                "u_max": float(np.abs(one.u_slew).max()),
                "speed_max_deg_s": float(np.degrees(np.abs(one.qd[settled]).max())),
                "mirror_half_difference_deg_s": float(np.degrees(halves.mean())),
                "model_mae_deg_s": float(np.degrees(np.mean(errors))),
            }
        )
    return rows


def speed_lag(
    chosen: Iterable[Trace], lags: Iterable[float] = (-0.1, 0.0, 0.1, 0.2, 0.3)
) -> dict[float, float]:
    """R2 of I dw/dt = D dp - b w - T sign(w) with the pressures taken `lag` s earlier, by lag.

    The best lag tells whether the traces' speed is later than their pressures.
    """
    chosen = list(chosen)
    return {lag: _r_squared(chosen, lag) for lag in lags}


def _r_squared(chosen: list[Trace], lag: float) -> float:
    left, right = [], []
    for trace in chosen:
        middle = (trace.time[1:] + trace.time[:-1]) / 2
        speed = (trace.qd[1:] + trace.qd[:-1]) / 2
        pressure = np.interp(middle - lag, trace.time, trace.p_a - trace.p_b)
        used = (middle > traces.SETTLED + 0.5) & (np.abs(speed) > MOVING)
        left.append((trace.inertia * np.diff(trace.qd) / PERIOD)[used])
        right.append(np.column_stack([pressure, speed, np.sign(speed)])[used])
    torque, terms = np.concatenate(left), np.vstack(right)
    rest = torque - terms @ np.linalg.lstsq(terms, torque, rcond=None)[0]
    return float(1.0 - rest.var() / torque.var())


def _columns(trace: Trace, run: Run) -> tuple[np.ndarray, ...]:
    settled = slice(trace.first + 1, None)
    moving = np.where(np.abs(trace.qd) > MOVING, np.sign(trace.qd), np.sign(trace.u_slew))
    sign = np.where(moving == 0, 1 if trace.u_slew.sum() >= 0 else -1, moving)[settled]
    pressure = (run.p_a - run.p_b)[1:] - (trace.p_a - trace.p_b)[settled]
    return regime(trace)[settled], sign, (run.qd[1:] - trace.qd[settled]) * sign, pressure * sign


def _row(name: str, direction: int, speed: np.ndarray, pressure: np.ndarray) -> dict[str, Any]:
    return {
        "regime": name,
        "direction": direction,
        "samples": int(speed.size),
        "speed_bias_deg_s": float(np.degrees(speed.mean())),
        "speed_mae_deg_s": float(np.degrees(np.abs(speed).mean())),
        "pressure_bias_bar": float(pressure.mean() / BAR),
        "pressure_mae_bar": float(np.abs(pressure).mean() / BAR),
    }
