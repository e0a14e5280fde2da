"""What a disagreement may go with, and regimes of it in plain words: slow, towards one end, small command.

A regressor is a quantity over time: speed, position and acceleration of an axis, a command and its changes, a
load, a reading.  A regime is a stretch of one, as `|v| < 0.03 rad/s, at rest and at reversals`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from reconcile.recordings.data import Parts
from reconcile.words import written

CHANGE = 10  # samples over which a command's change is looked at


class Known(Protocol):
    """What regressors are made of: a study, or the channels of a closed FMU in its form."""

    model: Any
    folder: Any
    parts: Parts
    floors: Any


@dataclass(frozen=True)
class Regressor:
    """A quantity: `kind` is speed, pose, acceleration, command, step, load or reading; `port` where it is.

    `over_s`: of a step the time over which the command's change is taken.
    """

    kind: str
    port: str
    label: str
    unit: str
    over_s: float = 0.0


@dataclass(frozen=True)
class Regime:
    """Where a regressor (with `size` its magnitude) lies between `low` and `high`; `words` say it."""

    regressor: Regressor
    low: float
    high: float
    size: bool
    words: str

    def mask(self, values: np.ndarray) -> np.ndarray:
        """Which values [N] of the regressor lie in it."""
        x = np.abs(values) if self.size else values
        return (x >= self.low) & (x < self.high)


def regressors(study: Known) -> list[Regressor]:
    """All that the model and the recordings know."""
    units, found = _units(study), []
    for axis in study.folder.ports.axes:
        v, per = axis.velocity, units[axis.velocity]
        found.append(Regressor("speed", axis.velocity, v, per))
        if axis.position:
            found.append(Regressor("pose", axis.position, axis.position, units[axis.position]))
        rate = per + "2" if per.endswith("/s") else f"{per}/s"
        found.append(Regressor("acceleration", axis.velocity, f"d{v}/dt", rate))
    runs = [b.run for b in study.parts.fit]
    over_s = CHANGE * min(r.period_s for r in runs)
    inputs = [n for n in (v.name for v in study.model.inputs) if all(n in r.inputs for r in runs)]
    for name in inputs:
        kind = "command" if name in study.folder.ports.controls else "load"
        found.append(Regressor(kind, name, name, units[name]))
        if kind == "command":
            found.append(Regressor("step", name, f"change of {name} in {over_s:.3g} s", units[name], over_s))
    seen = {r.unit for r in found}
    found += [Regressor("reading", n, n, units[n]) for n in study.floors if units[n] not in seen]
    return found


def values(study: Known, r: Regressor, window: Any, times: np.ndarray, states: np.ndarray) -> np.ndarray:
    """A regressor [n] at times [n] of a window, where the model's states are `states` [n, NX]."""
    if r.kind in ("speed", "pose"):
        return states[:, study.model.index("states", r.port)]
    if r.kind == "acceleration":
        v = states[:, study.model.index("states", r.port)]
        return np.gradient(v, times) if len(v) > 1 else np.zeros(len(v))
    signal = window.run.outputs[r.port] if r.kind == "reading" else window.run.inputs[r.port]
    now = _held(signal, times)
    return now - _held(signal, times - r.over_s) if r.kind == "step" else now


def regimes(r: Regressor, x: np.ndarray) -> list[Regime]:
    """Candidate regimes of a regressor whose values met are `x` [N]."""
    if r.kind in ("pose", "load", "reading"):
        return _ranges(r, x)
    top = float(np.quantile(np.abs(x), 0.98)) or 1.0
    low, high, side = WORDS[r.kind]
    found = [_made(r, 0.0, s * top, True, low) for s in (0.02, 0.04, 0.07, 0.12, 0.2, 0.3)]
    found += [_made(r, s * top, np.inf, True, high) for s in (0.5, 0.7, 0.85)]
    for s in (0.0, 0.1, 0.3, 0.6):
        found.append(_made(r, s * top, np.inf, False, side[0]))
        found.append(_made(r, -np.inf, -s * top, False, side[1]))
    return found


WORDS = {
    "speed": ("slow, at rest and at reversals", "moving fast", ("moving forwards", "moving backwards")),
    "acceleration": ("at steady speed", "speeding up or braking hard", ("forwards", "backwards")),
    "command": ("small commands", "large commands", ("commands forwards", "commands backwards")),
    "step": ("while it rests", "just after large changes", ("after it rose", "after it fell")),
}  # fmt: skip
ENDS = {  # low, high, between
    "pose": ("towards the lower end", "towards the upper end", "about the middle of the travel"),
    "load": ("where it is small", "where it is large", "in between"),
    "reading": ("where it is low", "where it is high", "in between"),
}


def _ranges(r: Regressor, x: np.ndarray) -> list[Regime]:
    lower, upper, middle = ENDS[r.kind]
    found = [_made(r, -np.inf, float(np.quantile(x, s)), False, lower) for s in (0.1, 0.2, 0.35, 0.5)]
    found += [_made(r, float(np.quantile(x, s)), np.inf, False, upper) for s in (0.5, 0.65, 0.8, 0.9)]
    pairs = ((0.2, 0.5), (0.35, 0.65), (0.5, 0.8))
    between = [np.quantile(x, p).tolist() for p in pairs]
    found += [_made(r, low, high, False, middle) for low, high in between]
    return found


def _made(r: Regressor, low: float, high: float, size: bool, said: str) -> Regime:
    symbol, unit = (f"|{r.label}|" if size else r.label), written(r.unit)
    low, high = _rounded(low), _rounded(high)
    unit = f" {unit}" if unit else ""
    if np.isfinite(low) and np.isfinite(high) and not (size and low == 0.0):
        words = f"{low:g} < {symbol} < {high:g}{unit}"
    else:
        words = f"{symbol} < {high:g}{unit}" if np.isfinite(high) else f"{symbol} > {low:g}{unit}"
    return Regime(r, low, high, size, f"{words}, {said}")


def _rounded(value: float) -> float:
    return float(f"{value:.2g}") if np.isfinite(value) else value


def _held(signal, times: np.ndarray) -> np.ndarray:
    return signal.values[np.clip(np.searchsorted(signal.time, times + 1e-9) - 1, 0, None)]


def _units(study: Known) -> dict[str, str]:
    model = study.model
    return {v.name: v.unit for v in (*model.states, *model.inputs, *model.outputs)}


def distinct(chosen: Sequence[Regime]) -> list[Regime]:
    """One regime of each regressor."""
    return list({r.regressor: r for r in reversed(list(chosen))}.values())[::-1]
