"""Slopes by what candidates are scored by, as simulated at a fit, and kept for the next look at it.

Scores are asked for at about one fit several times: to judge the noise, then without the noise, and to grow
from the set once it was fitted again under the noise judged.  Simulating all hidden states is what takes the
time; whitening the slopes and freeing them of initial states, which is what differs, takes next to none.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from reconcile.fit.point import Point, freed
from reconcile.fit.problem import Problem
from reconcile.fit.solve import Fitted
from reconcile.model import Attached
from reconcile.starting import WIDTHS

if TYPE_CHECKING:
    from reconcile.study import Study

SAME = 0.02  # of a free parameter's size: fits that differ by less have the same slopes, to rank by


@dataclass(frozen=True)
class _Pass:
    """Some effects simulated together: by window slopes by all initial states, then by the effects' columns.

    Steps are rough, and differ from pass to pass: only slopes of one pass can be freed of its states.
    """

    slopes: list[np.ndarray] | None  # None: the model runs away
    loose: np.ndarray  # one over the freedom of each state
    place: dict[Attached, slice]  # of an effect among the columns

    def all(self, problem: Problem) -> np.ndarray:
        """Slopes [N, columns], whitened and freed of what initial states could explain."""
        return np.vstack([self._window(problem, w) for w in range(len(problem.windows))])

    def _window(self, problem: Problem, w: int) -> np.ndarray:
        if self.slopes is None:
            rows = sum(len(problem.windows[w].times.get(n, ())) for n in problem.outputs)
            return np.zeros((rows, max(s.stop for s in self.place.values())))
        slope = self.slopes[w] if problem.whiteners is None else problem.whiteners[w](self.slopes[w])
        return freed(slope, self.loose)


@dataclass
class _Kept:
    """Of a set on a problem: where it was fitted, and the passes made there, by effect and start."""

    problem: Problem
    fitted: Fitted
    passes: dict[tuple[Attached, int], _Pass]


class Slopes:
    """Slopes of a study's candidates."""

    def __init__(self, study: "Study"):
        self.study = study
        self._kept: _Kept | None = None

    def of(self, fitted: Fitted, chosen: Sequence[Attached], k: int) -> np.ndarray:
        """Slopes [N, columns] by the columns of effects at their k-th start, as the problem in use sees them.

        Zeros for all of them if the model runs away with one of them; those of a fit about the same will do.
        """
        kept = self._about(fitted)
        new = [a for a in chosen if (a, k) not in kept.passes]
        if new:
            found = self._simulate(kept, new, k)
            kept.passes |= {(a, k): found for a in new}
        passes = [kept.passes[a, k] for a in chosen]
        whole = {i: x.all(kept.problem) for i, x in {id(x): x for x in passes}.items()}
        return np.hstack([whole[id(x)][:, x.place[a]] for a, x in zip(chosen, passes, strict=True)])

    def _about(self, fitted: Fitted) -> _Kept:
        """What is kept of this fit or one about the same; begun afresh if there is none."""
        kept, problem = self._kept, self.study.fit_problem
        if kept is None or kept.problem is not problem or not self._same(kept.fitted, fitted):
            kept = self._kept = _Kept(problem, fitted, {})
        return kept

    def _simulate(self, kept: _Kept, new: Sequence[Attached], k: int) -> _Pass:
        """One pass: slopes of all windows by the k-th starts of some effects."""
        problem, index = kept.problem, self.study.extended.index
        point, names = self._at(kept.fitted.point, new, k), [index[n] for a in new for n in a.columns]
        ends = np.cumsum([len(a.columns) for a in new])
        place = {a: slice(int(e) - len(a.columns), int(e)) for a, e in zip(new, ends, strict=True)}
        slopes: list[np.ndarray] | None = []
        for w in range(len(problem.windows)):
            run = problem.simulate(point, w, names)
            if run is None:
                slopes = None
                break
            slopes.append(problem.compare(point, w, run, names)[2])
        return _Pass(slopes, problem.common(point).loose, place)

    def _at(self, point: Point, new: Sequence[Attached], k: int) -> Point:
        """The fit's point with effects beside it, switched off, at their k-th start."""
        study, p = self.study, point.p.copy()
        for a in new:
            start = a.effect.start(study.port_scales(a), k)
            shape = {a.name(q.name): start[q.name] for q in a.effect.parameters if not q.amplitude}
            if a.effect.width:
                shape[a.name("width")] = study.values[a.name("width")] * WIDTHS[1] / WIDTHS[-1]
            for n, v in shape.items():
                p[study.extended.index[n]] = v
        hidden = [a for a in new if a.effect.hidden]
        return study.fit_problem.with_present(replace(point, p=p), [*point.present, *hidden])

    def _same(self, known: Fitted, fitted: Fitted) -> bool:
        """Whether two fits are of the same set and about the same, with kinks as wide."""
        present = known.point.present
        if set(present) != set(fitted.point.present) or len(known.free) != len(fitted.free):
            return False
        index, moved = self.study.extended.index, np.abs(known.point.p - fitted.point.p)
        widths = [index[a.name("width")] for a in present if a.effect.width]
        return not moved[widths].any() and all(moved[index[f.name]] <= SAME * f.size for f in fitted.free)
