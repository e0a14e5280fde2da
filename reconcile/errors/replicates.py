"""The floor from replicate runs: what differs between recordings in which the machine was told the same.

Two runs are replicates when every control follows the same course from the start of each, and moves.  What
their outputs differ by is what no model of those inputs could predict: sensor noise and disturbances.  Each
stretch as long as a held-out prediction is freed of a straight line first, since runs begin in different
states and a prediction is told its initial state.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from reconcile.recordings.data import Run, Signal

SAME = 0.02  # of the control's rms: difference between inputs that were told the same
LEAST = 50  # samples of a replicate


def pairs(runs: Sequence[Run], controls: Sequence[str]) -> list[tuple[Run, Run]]:
    """Pairs of runs in which all `controls` are the same."""
    return [(a, b) for a, b in combinations(runs, 2) if _same_inputs(a, b, controls)]


def levels(found: Sequence[tuple[Run, Run]], names: Sequence[str], stretch_s: float) -> dict[str, float]:
    """Standard deviation of what cannot be predicted, by output (its unit), from pairs of replicates."""
    result = {}
    for name in names:
        shared = [p for p in found if name in p[0].outputs and name in p[1].outputs]
        squares = np.concatenate([_squares(a, b, name, stretch_s) for a, b in shared] or [np.empty(0)])
        if len(squares):
            result[name] = float(np.sqrt(np.mean(squares)))
    return result


def _same_inputs(a: Run, b: Run, controls: Sequence[str]) -> bool:
    shared = [n for n in controls if n in a.inputs and n in b.inputs]
    length = min(a.end_s - a.start_s, b.end_s - b.start_s)
    if (
        not shared
        or length < LEAST * min(a.period_s, b.period_s)
        or len(shared) != len([n for n in controls if n in a.inputs])
    ):
        return False
    moved = False
    for name in shared:
        first, second = a.inputs[name], b.inputs[name]
        times = np.arange(0.0, length, max(first.period_s, second.period_s))
        one, other = _held(first, a.start_s + times), _held(second, b.start_s + times)
        size = float(np.sqrt(np.mean(one**2)))
        if np.sqrt(np.mean((one - other) ** 2)) > SAME * size:
            return False
        moved = moved or float(np.ptp(one)) > 0.0
    return moved


def _held(signal: Signal, times: np.ndarray) -> np.ndarray:
    return signal.values[np.clip(np.searchsorted(signal.time, times + 1e-6) - 1, 0, None)]


def _squares(a: Run, b: Run, name: str, stretch_s: float) -> np.ndarray:
    """Squares whose mean is the variance of one run, by sample."""
    first, second = a.outputs[name], b.outputs[name]
    times = first.time[first.time - a.start_s <= second.time[-1] - b.start_s] - a.start_s
    other = np.interp(times, second.time - b.start_s, second.values)
    difference, found = first.values[: len(times)] - other, []
    per = max(4, round(stretch_s / first.period_s))
    for k in range(0, len(times) - per + 1, per):
        t, d = times[k : k + per], difference[k : k + per]
        left = d - np.polyval(np.polyfit(t - t[0], d, 1), t - t[0])
        found.append(0.5 * left**2 * per / (per - 2))  # two runs; two numbers of the line
    return np.concatenate(found) if found else np.empty(0)
