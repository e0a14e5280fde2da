"""Excitations of a model's inputs: a few shapes with amplitude, period and offset, within an input's range.

steps       levels of random size and alternating sign, each held for about the period
ladder      levels up to the largest, to either side by turns, each held for about half the period
binary      full to either side, for random times between half of the fastest period and half of the longest
reversals   full to either side, at first once a period, at last as often as `fastest` says
triangle    slopes up and down
sine, multisine (eight periods, the longest of them given), chirp (from twice the period on)
growing     a sine that begins with nothing and ends with all
creep       rest, a slow slope up and down again, rest, the same to the other side
strokes     hold to one side, rest, hold to the other side, rest
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

LEAD = 0.05  # of its duration: rest before it begins, and after it
TICKS = 4  # changes of a command in the shortest period: with fewer no shape is left
FASTER = {"reversals": 4.0, "multisine": 16.0, "chirp": 4.0, "binary": 16.0}  # than the period, at most
RUNGS = 6  # of a ladder
FADE = 0.1  # of a shape's time, over which an oscillation comes up: it does not push the axis away then

Times = np.ndarray  # of a shape, [n] in s from its beginning
Rng = np.random.Generator


@dataclass(frozen=True)
class Excitation:
    """`inputs` are driven, the others rest; `amplitude` and `offset` are shares of half an input's range.

    `period_s`: how long a shape takes.  `start`: outputs (positions) and where they begin, if elsewhere than
    in the recordings.  `shortest_s`: period that no part of it goes below.
    """

    kind: str
    inputs: tuple[str, ...]
    amplitude: float
    period_s: float
    offset: float = 0.0
    duration_s: float = 30.0
    seed: int = 1
    start: tuple[tuple[str, float], ...] = ()
    shortest_s: float = 0.0

    @property
    def fastest_s(self) -> float:
        """The shortest period in it."""
        quick = self.period_s / FASTER.get(self.kind, 1.0)
        return min(self.period_s, max(quick, self.shortest_s))

    def centre(self, low: float, high: float) -> float:
        """Of a range: a small excitation stays near where the input rests."""
        rest, middle = neutral(low, high), 0.5 * (low + high)
        return rest + self.amplitude * (middle - rest) + self.offset * 0.5 * (high - low)

    def as_dict(self) -> dict[str, Any]:
        """For a report; `of_dict` reads it again."""
        return asdict(self) | {"inputs": list(self.inputs), "start": dict(self.start)}


def of_dict(content: Mapping[str, Any]) -> Excitation:
    """The excitation of a report."""
    changed: dict[str, Any] = {"inputs": tuple(content["inputs"]), "start": tuple(content["start"].items())}
    return Excitation(**{**content, **changed})


def commands(
    chosen: Excitation, ranges: Mapping[str, tuple[float, float]], tick_s: float
) -> dict[str, np.ndarray]:
    """What every input of `ranges` (low, high) is told at each tick, [n] each; what is not driven rests."""
    n = max(1, round(chosen.duration_s / tick_s))
    found = {}
    for i, (name, (low, high)) in enumerate(ranges.items()):
        rest, half = neutral(low, high), 0.5 * (high - low)
        found[name] = np.full(n, rest)
        if name in chosen.inputs:
            rng = np.random.default_rng([chosen.seed, i])
            lead = LEAD * chosen.duration_s
            time = tick_s * np.arange(n) - lead
            inside = (time >= 0.0) & (time < chosen.duration_s - 2.0 * lead)
            shape = SHAPES[chosen.kind](time[inside], chosen.period_s, chosen.fastest_s, rng)
            centre = chosen.centre(low, high)
            found[name][inside] = np.clip(centre + chosen.amplitude * half * shape, low, high)
    return found


def neutral(low: float, high: float) -> float:
    """Where an input rests: at 0 if that is within its range, else at the nearer end."""
    return float(np.clip(0.0, low, high))


def smooth(values: np.ndarray, lag: float) -> np.ndarray:
    """Through two first-order lags (in samples)."""
    from scipy.signal import lfilter  # takes half a second, and few runs need it

    keep, found = np.exp(-1.0 / lag), values
    for _ in range(2):
        found = np.asarray(lfilter([1.0 - keep], [1.0, -keep], found))
    return found


def _steps(t: Times, period: float, fast: float, rng: Rng) -> np.ndarray:
    count = int(t[-1] / (0.5 * period)) + 2
    ends = np.cumsum(period * rng.uniform(0.5, 1.5, count))
    levels = rng.uniform(0.2, 1.0, count) * np.where(np.arange(count) % 2, 1.0, -1.0)
    return levels[np.searchsorted(ends, t, side="right")]


def _ladder(t: Times, period: float, fast: float, rng: Rng) -> np.ndarray:
    rung = (t / (0.5 * period)).astype(int) % (2 * RUNGS)
    return np.where(rung % 2, -1.0, 1.0) * (rung // 2 + 1.0) / RUNGS


def _binary(t: Times, period: float, fast: float, rng: Rng) -> np.ndarray:
    count = int(t[-1] / (0.5 * fast)) + 2
    ends = np.cumsum(0.5 * np.exp(rng.uniform(np.log(fast), np.log(period), count)))
    return np.where(np.searchsorted(ends, t, side="right") % 2, -1.0, 1.0)


def _phase(t: np.ndarray, first_s: float, last_s: float) -> np.ndarray:
    """Cycles since the beginning, from one period to another."""
    first, last = 1.0 / first_s, 1.0 / last_s
    return first * t + 0.5 * (last - first) * t * t / max(float(t[-1]), 1e-9)


def _reversals(t: Times, period: float, fast: float, rng: Rng) -> np.ndarray:
    # a quarter period ahead: the first push is half as long, so that speed goes to both sides
    return np.where((_phase(t, period, fast) + 0.25) % 1.0 < 0.5, 1.0, -1.0)


def _triangle(t: Times, period: float, fast: float, rng: Rng) -> np.ndarray:
    return 1.0 - 4.0 * np.abs((t / period + 0.25) % 1.0 - 0.5)


def _sine(t: Times, period: float, fast: float, rng: Rng) -> np.ndarray:
    return _fade(t) * np.sin(2 * np.pi * t / period)


def _multisine(t: Times, period: float, fast: float, rng: Rng) -> np.ndarray:
    lines = 1.0 / np.geomspace(period, fast, 8)
    whole = np.sum([np.sin(2 * np.pi * (f * t + rng.random())) for f in lines], axis=0)
    return _fade(t) * whole / max(float(np.abs(whole).max()), 1e-9)


def _chirp(t: Times, period: float, fast: float, rng: Rng) -> np.ndarray:
    return _fade(t) * np.sin(2 * np.pi * _phase(t, 2.0 * period, fast))


def _growing(t: Times, period: float, fast: float, rng: Rng) -> np.ndarray:
    return t / max(float(t[-1]), 1e-9) * np.sin(2 * np.pi * t / period)


def _creep(t: Times, period: float, fast: float, rng: Rng) -> np.ndarray:
    # of a half cycle the first quarter is rest, then up and down
    half, side = (t / period) % 1.0, np.where((t / period).astype(int) % 2, -1.0, 1.0)
    return side * np.clip(1.0 - np.abs(half - 0.625) / 0.375, 0.0, 1.0)


def _strokes(t: Times, period: float, fast: float, rng: Rng) -> np.ndarray:
    quarter = (4.0 * t / period).astype(int) % 4
    return np.array([1.0, 0.0, -1.0, 0.0])[quarter]


def _fade(t: np.ndarray) -> np.ndarray:
    return np.clip(t / max(FADE * float(t[-1]), 1e-9), 0.0, 1.0)


SHAPES: dict[str, Callable[[Times, float, float, Rng], np.ndarray]] = {
    "steps": _steps,
    "ladder": _ladder,
    "binary": _binary,
    "reversals": _reversals,
    "triangle": _triangle,
    "sine": _sine,
    "multisine": _multisine,
    "chirp": _chirp,
    "growing": _growing,
    "creep": _creep,
    "strokes": _strokes,
}
