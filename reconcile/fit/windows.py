"""Windows of recordings: inputs as the steps see them, delayed without rounding, and the samples to meet.

An input is held between its samples.  Where its delay moves a change of it into the middle of a step, the
step is cut there (`Edge`): a valve with a dead band answers the mean of two openings otherwise than one after
the other.  A step with several changes, or of a further delayed input, sees the mean, which is differentiable
by the delay as well.  Outputs are read between the steps (between.py), which is where sensor delays act.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from scipy.signal import savgol_filter

from reconcile.data import Block, Run, Signal

WINDOW_S = 20.0
FIRST_S = 0.5  # where a model is lost within SHORT_S, as a pendulum that knows of no gravity
FEW = 60  # windows in which strong effects are looked for: a model that is lost is slow to fit
SHORT_S = 2.0  # while strong effects are missing: the model does not get far from the recording
HOLDOUT_S = 4.0
STEP_S = (0.002, 0.01)  # least and largest step
MARGIN_S = 0.3  # before the samples, for sensor delays
ON_GRID = 1e-4  # of a step: changes as near to its ends are at them
AHEAD = 16  # steps by which a window grows: inputs of as many are kept for all clocks that are about alike
GUARD_S = 0.2  # left out where a block follows one of another part
FAST = 0.01  # share of a run by which its outputs' clock may be ahead: samples as near to the end are not met


@dataclass(frozen=True)
class Window:
    """`steps` of `step_s` from `start_s`, and per output the samples [n] to meet and their times."""

    run: Run
    start_s: float
    steps: int
    step_s: float
    times: Mapping[str, np.ndarray]
    samples: Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Edge:
    """Where steps are cut since an input changes in them: by step [n] the share before it (0: it does not).

    `before`, `after`: the input's values there.
    """

    input: int
    share: np.ndarray
    before: np.ndarray
    after: np.ndarray


@dataclass
class InputTable:
    """Inputs of a run by step, for a set of delays; computed again when a delay changes.

    `widths`: by input the samples over which it is smoothed.
    """

    run: Run
    names: Sequence[str]  # all inputs of the model, in order
    defaults: np.ndarray
    forces: int = 0  # at the axes: nobody knows of any
    widths: Mapping[str, int] = field(default_factory=dict)
    _cache: dict[tuple[int, float, float, int, float], tuple[np.ndarray, np.ndarray]] = field(
        default_factory=dict
    )
    _edges: dict[tuple[int, float, float, int, float], Edge] = field(default_factory=dict)
    _held: dict[int, "Held"] = field(default_factory=dict)
    _signals: dict[str, Signal | None] = field(default_factory=dict)

    def rows(self, window: Window, delays: Mapping[int, float]) -> tuple[np.ndarray, np.ndarray]:
        """Inputs of a window, the time since the recording began and forces [steps, NU + 1 + forces]; slopes.

        Slopes are by delay; of forces by themselves.
        """
        n, h, clock = window.steps, window.step_s, len(self.names)
        u, slope = np.zeros((2, n, clock + 1 + self.forces))
        slope[:, clock + 1 :] = 1.0
        for i, name in enumerate(self.names):
            signal = self._signal(name)
            if signal is None:
                u[:, i] = self.defaults[i]
                continue
            key = (i, window.start_s, h, n, delays.get(i, 0.0))
            if key not in self._cache:
                if len(self._cache) > 4000:
                    self._cache.clear()
                if i not in self._held:
                    self._held[i] = Held(signal)
                self._cache[key] = self._held[i].delayed(window.start_s, h, n, delays.get(i, 0.0))
            u[:, i], slope[:, i] = self._cache[key]
        u[:, clock] = window.start_s - self.run.began_s + h * (np.arange(n) + 0.5)
        return u, slope

    def edge(self, window: Window, delays: Mapping[int, float]) -> Edge | None:
        """The edges of the first input whose delay puts them into the middle of steps; None if none is."""
        n, h = window.steps, window.step_s
        for i, delay in delays.items():
            signal = self._signal(self.names[i])
            if signal is None or delay <= 0.0:
                continue
            key = (i, window.start_s, h, n, delay)
            if key not in self._edges:
                if len(self._edges) > 500:
                    self._edges.clear()
                self._edges[key] = _edge(i, signal, window.start_s, h, n, delay)
            if self._edges[key].share.any():
                return self._edges[key]
        return None

    def _signal(self, name: str) -> Signal | None:
        """An input as the model is driven by it; None where it is not recorded."""
        if name not in self._signals:
            signal = self.run.inputs.get(name)
            if signal is not None and name in self.widths:
                signal = smoothed(signal, self.widths[name])
            self._signals[name] = signal
        return self._signals[name]


def smoothed(signal: Signal, width: int) -> Signal:
    """A signal by the parabolas that are nearest to `width` samples each (Savitzky and Golay 1964)."""
    return replace(signal, values=savgol_filter(signal.values, width, 2))


def _edge(i: int, signal: Signal, start: float, h: float, n: int, delay: float) -> Edge:
    """Steps with one change of a held signal, `delay` late, in their middle."""
    at = (signal.time[1:] + delay - start) / h
    step = np.floor(at).astype(int)
    inside = (step >= 0) & (step < n) & (at - step > ON_GRID) & (at - step < 1.0 - ON_GRID)
    alone = np.bincount(step[inside], minlength=n) == 1
    chosen = np.flatnonzero(inside & (np.diff(signal.values) != 0.0))
    chosen = chosen[alone[step[chosen]]]
    share, before, after = np.zeros(n), np.zeros(n), np.zeros(n)
    share[step[chosen]] = (at - step)[chosen]
    before[step[chosen]], after[step[chosen]] = signal.values[chosen], signal.values[chosen + 1]
    return Edge(i, share, before, after)


class Held:
    """A signal that holds each value until the next: `area` under it up to each of its `knots`."""

    def __init__(self, signal: Signal):
        self.signal = signal
        steps = np.diff(signal.time, append=signal.time[-1] + 1e6)
        self._knots = np.concatenate([[signal.time[0] - 1e6], signal.time, [signal.time[-1] + 1e6]])
        area = np.concatenate(
            [[0.0, signal.values[0] * 1e6], signal.values[0] * 1e6 + np.cumsum(signal.values * steps)]
        )
        self._area = area - area[1]

    def delayed(self, start: float, h: float, n: int, delay: float) -> tuple[np.ndarray, np.ndarray]:
        """Mean over each of n steps `h` from `start` on, `delay` late (s), and its slope by the delay."""
        edges = start + h * np.arange(n + 1) - delay
        mean = np.diff(np.interp(edges, self._knots, self._area)) / h
        # a change on an edge moves into the step after it: in the one before, play has nothing to follow yet
        at = np.clip(np.searchsorted(self.signal.time, edges - 1e-9, side="right") - 1, 0, None)
        return mean, -np.diff(self.signal.values[at]) / h


def cut(blocks: Sequence[Block], window_s: float, step_s: float | None) -> list[Window]:
    """Windows that each cover a block, or a part of it; each starts a margin before its samples."""
    windows = []
    for block in blocks:
        length = block.end_s - block.start_s
        margin = min(MARGIN_S, 0.25 * length)
        count = max(1, round((length - margin) / window_s))
        edges = np.linspace(block.start_s + margin, block.end_s, count + 1)
        for a, b in pairwise(edges):
            windows.append(_window(block.run, a - margin, [(a, b)], _step(block.run, step_s)))
    return windows


def span(blocks: Sequence[Block], window_s: float, step_s: float | None) -> list[Window]:
    """Windows over whole runs, or long parts of them, of which only the samples in the blocks are to be met.

    Slow effects show over times that no block has; what lies between the blocks is simulated, not met.
    """
    windows = []
    for run in {id(b.run): b.run for b in blocks}.values():
        own = [b for b in blocks if b.run is run]
        inside = [(b.start_s + (GUARD_S if b.start_s > run.start_s else 0.0), b.end_s) for b in own]
        inside[0] = (inside[0][0] + MARGIN_S, inside[0][1])
        first, last = own[0].start_s, own[-1].end_s
        edges = np.linspace(first, last, max(1, round((last - first) / window_s)) + 1)
        for a, b in pairwise(edges):
            parts = [(max(c, a), min(d, b)) for c, d in inside if min(d, b) > max(c, a)]
            if parts:
                windows.append(
                    _window(run, max(first, min(a, parts[0][0]) - MARGIN_S), parts, _step(run, step_s))
                )
    return windows


def few(blocks: Sequence[Block], window_s: float, step_s: float | None) -> list[Window]:
    """As `cut`, but at most FEW of them, spread evenly: what is strong shows in a part as well."""
    windows = cut(blocks, window_s, step_s)
    chosen = np.unique(np.linspace(0, len(windows) - 1, min(FEW, len(windows))).round().astype(int))
    return [windows[i] for i in chosen]


def _step(run: Run, step_s: float | None) -> float:
    return step_s or float(np.clip(0.5 * run.period_s, *STEP_S))


def _window(run: Run, start: float, parts: Sequence[tuple[float, float]], h: float) -> Window:
    # A fast clock has its last samples from after the recording's end, where nobody knows the inputs.  Were
    # they met by other clocks, each that need not be explained any more would speak for a fast one.
    known = run.end_s - FAST * (run.end_s - run.start_s)
    # on the run's own grid, so that a discrete model's steps are those of the recording
    start = run.start_s + np.floor((start - run.start_s) / h + 1e-6) * h
    times, samples = {}, {}
    for name, signal in run.outputs.items():
        inside = np.zeros(len(signal.time), dtype=bool)
        for first, last in parts:
            inside |= (signal.time >= first - 1e-9) & (signal.time < min(last, known) - 1e-9)
        times[name], samples[name] = signal.time[inside], signal.values[inside]
    return Window(run, float(start), int(np.ceil((parts[-1][1] - start) / h - 1e-6)), h, times, samples)


def longer(window: Window, late: Mapping[str, tuple[float, float]]) -> Window:
    """The window, longer where outputs that come early have their last samples from after its end.

    `late`: by output its delay (s) and what that gains per second of the recording.
    """
    if all(fixed >= 0.0 and drift >= 0.0 for fixed, drift in late.values()):
        return window
    last = {n: t[-1] - window.run.start_s for n, t in window.times.items() if len(t)}
    ahead = -min(fixed + drift * last.get(n, 0.0) for n, (fixed, drift) in late.items())
    more = int(ahead / window.step_s)
    return replace(window, steps=window.steps + AHEAD * -(-more // AHEAD)) if more > 0 else window
