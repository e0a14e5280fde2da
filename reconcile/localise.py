"""Where a fit and the recordings disagree, in words: which signal, in which regime, with what share of it.

The disagreement of each window is what is left after its initial state is free.  It is binned by regimes of
the motion; the share of a bin is its part of the squared error, set against its part of the time.
"""

from collections.abc import Sequence

import numpy as np

from reconcile.fit.solve import Fitted
from reconcile.study import Study

LIFT = 1.3  # a regime is named when its share of the error is this much above its share of the time
MOST = 6


def localise(study: Study, fitted: Fitted) -> list[dict]:
    """Regimes with the largest excess share of the error, largest first."""
    problem, rows = study.fit_problem, []
    for name in problem.outputs:
        errors, regimes = [], []
        for k, window in enumerate(problem.windows):
            e = fitted.linear.raw[k][name]
            at = np.clip(
                np.round((window.times[name] - window.start_s) / window.step_s).astype(int), 0, window.steps
            )
            errors.append(_local(e))
            regimes.append(_regimes(study, fitted.linear.states[k][at], window, window.times[name]))
        rows += _shares(name, np.concatenate(errors), regimes)
    rows.sort(key=lambda r: -r["share"] * np.log(r["lift"]))
    return [{k: v for k, v in r.items() if k != "lift"} for r in rows[:MOST]]


def _local(e: np.ndarray) -> np.ndarray:
    """What an error grows by, over some samples: errors add up, their growth shows where they come from."""
    width = 5
    if len(e) <= width:
        return e**2
    grown = np.zeros(len(e))
    grown[width:] = (e[width:] - e[:-width]) ** 2
    return grown


def _regimes(study: Study, states: np.ndarray, window, times: np.ndarray) -> dict[str, np.ndarray]:
    found: dict[str, np.ndarray] = {}
    for axis in study.folder.ports.axes:
        s = study.scales[axis.name]
        unit = next(v.unit for v in study.model.states if v.name == axis.velocity)
        v = states[:, study.model.index("states", axis.velocity)]
        label = f"{axis.velocity}"
        slow = 0.05 * s.v
        found[f"|{label}| < {slow:.2g} {unit}, at rest and at reversals"] = np.abs(v) < slow
        found[f"{label} > {0.5 * s.v:.2g} {unit}"] = v > 0.5 * s.v
        found[f"{label} < {-0.5 * s.v:.2g} {unit}"] = v < -0.5 * s.v
        if axis.position:
            q = states[:, study.model.index("states", axis.position)]
            unit = next(x.unit for x in study.model.states if x.name == axis.position)
            high, low = s.q_high - 0.15 * (s.q_high - s.q_low), s.q_low + 0.15 * (s.q_high - s.q_low)
            found[f"{axis.position} > {high:.2g} {unit}"] = q > high
            found[f"{axis.position} < {low:.2g} {unit}"] = q < low
    for name in study.folder.ports.controls:
        signal = window.run.inputs.get(name)
        if signal is None:
            continue
        unit = next(x.unit for x in study.model.inputs if x.name == name)
        u = signal.values[np.clip(np.searchsorted(signal.time, times) - 1, 0, None)]
        size = study.scales[name].u
        found[f"|{name}| < {0.1 * size:.2g} {unit}"] = np.abs(u) < 0.1 * size
        found[f"{name} > {0.6 * size:.2g} {unit}"] = u > 0.6 * size
        found[f"{name} < {-0.6 * size:.2g} {unit}"] = u < -0.6 * size
    return found


def _shares(name: str, squares: np.ndarray, regimes: Sequence[dict[str, np.ndarray]]) -> list[dict]:
    total, rows = float(np.sum(squares)) or 1.0, []
    for label in regimes[0]:
        inside = np.concatenate([r[label] for r in regimes])
        time, share = float(np.mean(inside)), float(np.sum(squares[inside])) / total
        if time > 0.005 and share > LIFT * time:
            rows.append(
                {
                    "signal": name,
                    "subsystem": "",
                    "regime": label,
                    "share": round(share, 3),
                    "lift": share / time,
                }
            )
    return rows
