"""What errors look like when nothing is missing: sensor noise, forces and input noise that nobody recorded.

A random force at each axis (first-order Gauss-Markov) and noise on each recorded input reach the outputs
through the model; beside the sensors' noise they make the covariance of a window's errors,

    C = I + A D A',

in units of the sensors' noise: A holds the outputs' responses to cosines of force and input, D their
variances.  Errors and slopes are multiplied by C^(-1/2) (generalised least squares, Aitken 1936), so that
sums of squares are likelihoods again.  Sizes and correlation time maximise the likelihood of what is left.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.linalg import lapack

from reconcile.fit.windows import Window
from reconcile.noise import high_pass_level

BIN_S = 0.1  # the responses are computed to forces that are constant over bins
LINES = 48  # cosines of a window, at most
TIMES_S = (0.05, 0.15, 0.4, 1.0, 3.0)
FACTORS = (100.0, 30.0, 10.0, 3.0, 1.0, 0.3, 0.1, 0.03)  # sizes tried at first, as shares of what is left
ALIKE = 1.5  # ratio of sizes within which two noise models judge alike
NEGLIGIBLE = 0.05  # singular values of A D^(1/2) below which a direction is as good as the sensors' noise


@dataclass(frozen=True)
class Source:
    """One cause of coloured errors: `size` (standard deviation) and correlation `time_s` (0: white).

    `column`: where it enters among the inputs; `most`: no larger than that.
    """

    name: str
    column: int
    white: bool
    size: float = 0.0
    time_s: float = 0.4
    most: float = np.inf

    def variances(self, lines: int, length_s: float, step_s: float) -> np.ndarray:
        """Variance of each of the first orthonormal cosines of a window, sampled at `step_s`."""
        if self.white:
            return np.full(lines, self.size**2)
        keep = np.exp(-step_s / self.time_s)
        angle = np.pi * np.arange(lines) * step_s / length_s
        return self.size**2 * (1.0 - keep**2) / (1.0 - 2.0 * keep * np.cos(angle) + keep**2)


@dataclass(frozen=True)
class Whitener:
    """C^(-1/2) of a window: orthonormal `directions` [N, K] in which errors are shrunk by `shrink` [K]."""

    directions: np.ndarray
    shrink: np.ndarray

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Errors [N] or slopes [N, M] in whitened form."""
        inside = self.directions.T @ values
        return values - self.directions @ (
            inside * (self.shrink if inside.ndim == 1 else self.shrink[:, None])
        )


@dataclass(frozen=True)
class Noise:
    """The noise model of a problem: its sources, and their responses by window."""

    sources: tuple[Source, ...]
    responses: "tuple[_Responses, ...]" = field(repr=False, default=())

    @property
    def present(self) -> bool:
        """Whether anything beside the sensors' noise is in it."""
        return any(s.size > 0.0 for s in self.sources)

    @property
    def parameters(self) -> int:
        """How many it has: the size of each source, and its correlation time."""
        return sum(1 if s.white else 2 for s in self.sources if s.size > 0.0)

    def differs(self, other: "Noise") -> bool:
        """Whether a source is larger or smaller by more than ALIKE."""
        known = {s.name: s.size for s in other.sources}
        return {s.name for s in self.sources} != set(known) or any(
            not s.size <= ALIKE * known[s.name] or not known[s.name] <= ALIKE * s.size for s in self.sources
        )

    def deviance(self) -> float:
        """Minus twice the log-likelihood of what it was estimated from, but for a constant."""
        return _Likelihood(self.responses).deviance(self.sources, restricted=False)

    def whiteners(self) -> list[Whitener]:
        """Of every window."""
        return [r.whitener(self.sources) for r in self.responses]


@dataclass(frozen=True)
class _Responses:
    """Of one window: responses [N, lines] to each source, errors left [N], and their slopes [N, ...].

    `free`: by the window's initial state; `shared`: by what is common to all windows.
    """

    window: Window
    sources: tuple[Source, ...]
    by_source: tuple[np.ndarray, ...]
    errors: np.ndarray
    free: np.ndarray
    shared: np.ndarray

    @cached_property
    def period_s(self) -> float:
        """Sample period of the window's recording."""
        return _period(self.window)

    @cached_property
    def alike(self) -> tuple:
        """What windows have in common whose cosines have the same variances."""
        window = self.window
        return window.steps, window.step_s, self.period_s, *(b.shape[1] for b in self.by_source)

    def roots(self, sources: Sequence[Source]) -> list[np.ndarray]:
        """Standard deviations of the cosines of each source."""
        length = self.window.steps * self.window.step_s
        return [
            np.sqrt(s.variances(b.shape[1], length, self.period_s))
            for s, b in zip(sources, self.by_source, strict=True)
        ]

    def whitener(self, sources: Sequence[Source]) -> Whitener:
        """C^(-1/2) with these sources."""
        kept = [b * r for b, r in zip(self.by_source, self.roots(sources), strict=True) if r[0] > 0.0]
        if not kept:
            return Whitener(np.zeros((len(self.errors), 0)), np.zeros(0))
        a = np.hstack(kept)
        values, vectors = np.linalg.eigh(a.T @ a)
        large = values > max(NEGLIGIBLE**2, 1e-12 * values[-1])
        values, vectors = values[large], vectors[:, large]
        return Whitener(a @ (vectors / np.sqrt(values)), 1.0 - 1.0 / np.sqrt(1.0 + values))


class _Likelihood:
    """Log-likelihood of what is left as a function of the sources, freed of what is fitted anyway.

    Initial states are taken out window by window; what all windows share (parameters, and columns that stand
    for effects that may be missing) costs its degrees of freedom (restricted likelihood: Patterson and
    Thompson 1971).
    """

    def __init__(self, responses: Sequence[_Responses]):
        self.responses, self.windows = responses, []
        basis = _basis([r.shared - _within(r.free, r.shared) for r in responses])
        for r, x in zip(responses, basis, strict=True):
            a, e = np.hstack([np.zeros((len(r.errors), 0)), *r.by_source]), r.errors
            a, e = a - _within(r.free, a), e - _within(r.free, e)
            pulls = a.T @ np.column_stack([e, x])
            self.windows.append((a.T @ a, pulls, x.T @ e, x.T @ x, float(e @ e)))
        self.alone = self.deviance([replace(s, size=0.0) for s in responses[0].sources] if responses else [])

    def gain(self, sources: Sequence[Source]) -> float:
        """Twice the log-likelihood over that of sensor noise alone."""
        return self.alone - self.deviance(sources)

    def deviance(self, sources: Sequence[Source], restricted: bool = True) -> float:
        """Minus twice the log-likelihood; not `restricted` it compares fits of different effects."""
        total, inner, pulled = 0.0, 0.0, 0.0
        for root, (gram, pulls, xe, xx, ee) in zip(self._roots(sources), self.windows, strict=True):
            total, inner, pulled = total + ee, inner + xx, pulled + xe
            on = np.flatnonzero(root)
            if not len(on):
                continue
            root = root[on]
            within = gram[np.ix_(on, on)] * np.outer(root, root)
            within.flat[:: len(on) + 1] += 1.0
            pull = pulls[on] * root[:, None]
            factor, solved, _ = lapack.dposv(within, pull, lower=1)  # type: ignore[attr-defined]
            total += 2.0 * float(np.sum(np.log(np.diag(factor))))
            less = pull.T @ solved[:, :1]
            total -= float(less[0, 0])
            inner, pulled = inner - pull[:, 1:].T @ solved[:, 1:], pulled - less[1:, 0]
        if not np.size(pulled):
            return total
        total += float(np.linalg.slogdet(inner)[1]) if restricted else 0.0
        return total - float(pulled @ np.linalg.solve(inner, pulled))

    def _roots(self, sources: Sequence[Source]) -> list[np.ndarray]:
        """By window the standard deviations of all cosines: windows as long have the same."""
        known: dict[tuple, np.ndarray] = {}
        for r in self.responses:
            if r.alike not in known:
                known[r.alike] = np.concatenate([np.zeros(0), *r.roots(sources)])
        return [known[r.alike] for r in self.responses]

    def reach(self, source: int, sources: Sequence[Source]) -> float:
        """The size of a source that moves the outputs by as much as is left of them."""
        sizes = [replace(s, size=float(i == source)) for i, s in enumerate(sources)]
        moved = sum(
            float(np.sum((r.by_source[source] * r.roots(sizes)[source]) ** 2)) for r in self.responses
        )
        left = sum(float(r.errors @ r.errors) for r in self.responses)
        return float(np.sqrt(left / moved)) if moved > 0.0 else 0.0


def estimate(problem, point, columns: Sequence[int], more: Sequence[np.ndarray] = (), blurred=None) -> Noise:
    """The noise model of greatest likelihood for what a fit leaves.

    `columns`: the fit's free parameters; `more`: slopes [N, F] by window of what may be missing, of which the
    errors are freed as well, so that it does not count as noise; `blurred`: the point that responds to the
    sources, if another.
    """
    sources = _sources(problem)
    windows = range(len(problem.windows))
    responses = tuple(_respond(problem, point, k, sources, columns, blurred=blurred) for k in windows)
    if more:
        responses = tuple(
            replace(r, shared=np.hstack([r.shared, m])) for r, m in zip(responses, more, strict=True)
        )
    if not sources:  # no axis is known, and the inputs are without noise
        return Noise((), responses)
    likelihood = _Likelihood(responses)
    for _ in range(2):
        for i in range(len(sources)):
            sources[i] = _best(likelihood, sources, i)
    return Noise(tuple(sources), responses)


def transferred(noise: Noise, problem, point, bin_s: float = BIN_S, blurred=None) -> Noise:
    """The same sources for the windows of another problem; wider bins are quicker and coarser.

    `blurred`: as of estimate.
    """
    sources = noise.sources
    windows = range(len(problem.windows))
    responses = (_respond(problem, point, k, sources, (), bin_s, blurred) for k in windows)
    return Noise(sources, tuple(responses))


def _best(likelihood: _Likelihood, sources: Sequence[Source], i: int) -> Source:
    """A source of greatest likelihood, the others as they are."""
    reach = min(likelihood.reach(i, sources), sources[i].most)
    if reach <= 0.0:
        return replace(sources[i], size=0.0)

    def gain(source: Source) -> float:
        return likelihood.gain([*sources[:i], source, *sources[i + 1 :]])

    times = (sources[i].time_s,) if sources[i].white else TIMES_S
    tried = [replace(sources[i], size=0.0)]
    tried += [
        replace(sources[i], size=f * reach, time_s=t)
        for t in times
        for f in FACTORS
        if f * reach <= sources[i].most
    ]
    best = max(tried, key=gain)
    for step in (1.8, 1.35, 1.15) if best.size > 0.0 else ():
        best = max([best, *_beside(best, step)], key=gain)
    return best


def _beside(source: Source, step: float) -> list[Source]:
    """The same source larger and smaller, slower and quicker by a factor: of one size it is another time."""
    factors = (1.0 / step, 1.0, step)
    pairs = [(f, g) for f in factors for g in ((1.0,) if source.white else factors) if (f, g) != (1.0, 1.0)]
    slowest, quickest = TIMES_S[-1], TIMES_S[0]
    return [
        replace(
            source,
            size=min(source.size * f, source.most),
            time_s=min(max(source.time_s * g, quickest), slowest),
        )
        for f, g in pairs
    ]


def _sources(problem) -> list[Source]:
    """A force at each axis, and noise on each recorded input, no larger than its samples jump about."""
    axes = problem.extended.folder.ports.axes
    found = [Source("force at " + a.name, problem.extended.clock + 1 + i, False) for i, a in enumerate(axes)]
    runs = list({id(w.run): w.run for w in problem.windows}.values())
    for i, v in enumerate(problem.model.inputs):
        levels = [high_pass_level(r.inputs[v.name].values) for r in runs if v.name in r.inputs]
        level = float(np.median(levels)) if levels else 0.0
        if level > 0.0:
            found.append(Source("noise on " + v.name, i, True, most=1.5 * level))
    return found


def _respond(
    problem,
    point,
    k: int,
    sources: Sequence[Source],
    columns: Sequence[int],
    bin_s: float = BIN_S,
    blurred=None,
) -> _Responses:
    """Responses of window k to cosines of each source."""
    window = problem.windows[k]
    bins = int(np.clip(round(window.steps * window.step_s / bin_s), 2, window.steps))
    edges = np.round(np.linspace(0, window.steps, bins + 1)).astype(int)
    found = problem.responses(point, k, [s.column for s in sources], edges, columns, blurred)
    samples = sum(len(t) for t in window.times.values()) if found is None else len(found[0])
    if found is None:
        empty = np.zeros((samples, 1))
        nothing = np.zeros((samples, len(columns)))
        return _Responses(
            window, tuple(sources), tuple(empty for _ in sources), np.zeros(samples), empty, nothing
        )
    errors, free, pushed = found
    shapes = _cosines(bins, min(LINES, bins))
    # a cosine of unit norm over the samples of the recording, held over bins of several samples
    held = np.sqrt(bins * _period(window) / (window.steps * window.step_s))
    by_source = tuple(pushed[:, i * bins : (i + 1) * bins] @ (held * shapes.T) for i in range(len(sources)))
    states = free.shape[1] - len(columns)
    return _Responses(window, tuple(sources), by_source, errors, free[:, :states], free[:, states:])


def _within(free: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The part of values [N, ...] that lies in the span of `free` [N, F]."""
    q = np.linalg.qr(free)[0]
    return q @ (q.T @ values)


def _basis(slopes: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Orthonormal columns, over all windows together, of the span of shared slopes, by window."""
    whole = np.vstack(slopes)
    size = np.linalg.norm(whole, axis=0)
    whole = whole[:, size > 0.0] / size[size > 0.0]
    u, s, _ = np.linalg.svd(whole, full_matrices=False)
    ends = np.cumsum([len(w) for w in slopes])[:-1]
    return np.split(u[:, s > 1e-6 * (s[0] if len(s) else 1.0)], ends)


def _period(window: Window) -> float:
    return min(float(np.median(np.diff(t))) for t in window.times.values() if len(t) > 1)


def _cosines(samples: int, lines: int) -> np.ndarray:
    """The first orthonormal cosines [lines, samples]."""
    k, j = np.arange(samples) + 0.5, np.arange(lines)[:, None]
    found = np.sqrt(2.0 / samples) * np.cos(np.pi * j * k / samples)
    found[0] /= np.sqrt(2.0)
    return found
