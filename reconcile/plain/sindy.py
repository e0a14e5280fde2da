"""SINDy (Brunton, Proctor, Kutz, PNAS 113 (2016) 3932) with pysindy, its terms read as effects.

For every axis of the model: the measured speed is differentiated (smoothed finite differences) and regressed
on a library of its position, speed and the inputs (STLSQ; of the thresholds, the largest that is hardly worse
than the best on the confirm part).  The same is done with what the fitted plain model predicts at the same
instants; a term that is in the first and not in the second is read as the effect that it stands for.  It is
a generous reading: thresholds of dead zones and limits are in the library on a grid, and a term needs no
right coefficient.  It cannot say what no such term stands for: delays, lags, play, sensors.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from reconcile.equations.model import Folder
from reconcile.equations.ports import Axis
from reconcile.errors import holdout
from reconcile.errors.holdout import Stretch, Trace
from reconcile.recordings.data import Parts, Signal
from reconcile.search.core import Core

THRESHOLDS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4)  # of a term's share of the acceleration (rms)
RIDGE = 0.01  # times the samples: terms that are nearly the same must not stand against each other
HARDLY = 1.1  # times the least error on confirm: as good as the best
Columns = dict[
    str, np.ndarray
]  # library: "effect: term" -> values; a term without effect has none before ":"


@dataclass(frozen=True)
class Motion:
    """An axis in one window: times, position, speed, inputs."""

    time: np.ndarray
    q: np.ndarray
    v: np.ndarray
    inputs: dict[str, np.ndarray]


def name(folder: Folder, parts: Parts) -> list[str]:
    """Names of the effects that stand in the equations found, strongest first."""
    core = Core(folder, parts, catalogue=())
    fit, confirm = (holdout.predict(core, core.base, (which,)) or [] for which in ("fit", "confirm"))
    found: dict[str, float] = {}
    for axis in folder.ports.axes:
        measured, predicted = (
            terms(*(list(_motions(core, axis, traces, of_model)) for traces in (fit, confirm)))
            for of_model in (False, True)
        )
        for effect, share in measured.items():
            if effect not in predicted:
                found[effect] = max(share, found.get(effect, 0.0))
    return sorted(found, key=lambda e: -found[e])


def terms(motions: Sequence[Motion], confirm: Sequence[Motion]) -> dict[str, float]:
    """Effects in the sparse equation of an axis, and their terms' share of its acceleration (rms)."""
    if not motions or not confirm:
        return {}
    names, columns, wanted = _regression(motions)
    size = np.sqrt(np.mean(columns**2, axis=0))
    scale = float(np.sqrt(np.mean(wanted**2))) or 1.0
    seen = np.flatnonzero(size > 1e-9 * size.max())
    _, others, theirs = _regression(confirm)
    shares = _sparse(
        columns[:, seen] / size[seen], wanted / scale, others[:, seen] / size[seen], theirs / scale
    )
    found = {names[i].split(":")[0]: float(s) for i, s in zip(seen, np.abs(shares), strict=True) if s > 0}
    return {effect: share for effect, share in found.items() if effect}


def _regression(motions: Sequence[Motion]) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names and values of the library's terms, and the acceleration."""
    parts = [library(m) for m in motions]
    columns = np.column_stack([np.concatenate([p[n] for p in parts]) for n in parts[0]])
    return list(parts[0]), columns, np.concatenate([_derivative(m) for m in motions])


def library(m: Motion) -> Columns:
    """Terms of one axis; before the colon stands the effect that a term is read as."""
    q, v, top = m.q, m.v, float(np.quantile(np.abs(m.v), 0.98)) or 1.0
    found: Columns = {
        ":v": v,
        "constant_load:1": np.ones_like(v),
        "stiffness:q": q,
        "cubic_stiffness:q3": q**3,
        "gravity_load:sin q": np.sin(q),
        "coulomb_friction:sgn v": np.sign(v),
        "stribeck_friction:sgn v exp": np.sign(v) * np.exp(-((v / (0.2 * top)) ** 2)),
        "asymmetric_viscous_friction:|v|": np.abs(v),
        "quadratic_drag:v|v|": v * np.abs(v),
    }
    for n, u in m.inputs.items():
        most = float(np.abs(u).max()) or 1.0
        found |= {
            f":{n}": u,
            f"asymmetric_gain:|{n}|": np.abs(u),
            f"valve_flow_curve:{n}|{n}|": u * np.abs(u),
        }
        found[f"load_dependent_friction:|{n}| sgn v"] = np.abs(u) * np.sign(v)
        found[f"pose_dependent_inertia:{n} cos q"] = u * np.cos(q)
        for share in (0.1, 0.3):
            found[f"input_dead_zone:{n} beyond {share}"] = np.sign(u) * np.maximum(
                np.abs(u) - share * most, 0
            )
        for share in (0.5, 0.75):
            found[f"input_saturation:{n} within {share}"] = np.clip(u, -share * most, share * most)
    return found


def _sparse(columns: np.ndarray, wanted: np.ndarray, others: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """Coefficients [K] of scaled columns: STLSQ at the largest threshold that does on confirm (others)."""
    from pysindy import STLSQ

    fits = []
    for threshold in THRESHOLDS:
        fitted = STLSQ(threshold=threshold, alpha=RIDGE * len(wanted)).fit(columns, wanted[:, None])
        c = np.asarray(fitted.coef_).ravel()
        fits.append((float(np.sqrt(np.mean((theirs - others @ c) ** 2))), c))
    least = min(error for error, _ in fits)
    return [c for error, c in fits if error <= HARDLY * least][-1]


def _derivative(m: Motion) -> np.ndarray:
    from pysindy import SmoothedFiniteDifference

    return np.asarray(SmoothedFiniteDifference()(m.v[:, None], t=m.time)).ravel()  # type: ignore[arg-type]


def _motions(core: Core, axis: Axis, traces: Sequence[Trace], of_model: bool) -> Iterator[Motion]:
    """The axis in every stretch: as measured, or as the plain model's fit has it."""
    speed, place = (_shown(core.folder, s) for s in (axis.velocity, axis.position))
    for trace in traces:
        window, values = trace.window, trace.predicted if of_model else trace.window.samples
        main = speed or place
        if main is None or main not in values or len(window.times[main]) < 20:
            continue
        time = window.times[main]
        v = values[main] if speed else np.gradient(values[main], time)
        q = np.zeros(len(v))
        if place is not None and place in values:
            q = np.interp(time, window.times[place], values[place])
        yield Motion(time, q, v, _inputs(core, window, time))


def _inputs(core: Core, window: Stretch, time: np.ndarray) -> dict[str, np.ndarray]:
    named = core.folder.ports.controls
    return {n: _held(window.run.inputs[n], time) for n in named if n in window.run.inputs}


def _held(signal: Signal, time: np.ndarray) -> np.ndarray:
    at = np.searchsorted(signal.time, time + 1e-9, side="right") - 1
    return signal.values[np.clip(at, 0, None)]


def _shown(folder: Folder, state: str | None) -> str | None:
    """The output that is a state itself."""
    if state is None:
        return None
    x, u, m, p = folder.model.symbols
    shown = folder.model.h(x, u, m, p)
    i = folder.model.index("states", state)
    same = [k for k in range(shown.numel()) if ca.is_equal(shown[k], x[i])]
    return folder.model.outputs[same[0]].name if same else None
