"""What the report shows, measured once: held-out predictions, where the disagreement is, floors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from reconcile import holdout, regimes, replicates
from reconcile.fit.solve import Fitted
from reconcile.holdout import Trace
from reconcile.localise import Located, locate
from reconcile.regimes import Regime
from reconcile.search import Answer
from reconcile.study import Floor, Study, unique

STAGES = ("nominal", "reestimated", "after")
MOST_REGIMES = 4


@dataclass(frozen=True)
class Findings:
    """A study and its answer with predictions of the held-out part by stage (None where the model runs away).

    `located`: where the re-estimated model without effects disagrees; `floors` may rest on replicate runs.
    """

    study: Study
    answer: Answer
    traces: Mapping[str, list[Trace] | None]
    located: list[Located]
    floors: Mapping[str, Floor]

    @property
    def outputs(self) -> list[str]:
        """Signals that are compared."""
        return list(self.study.floors)

    def gap(self, stage: str, name: str, inside: Sequence[np.ndarray] | None = None) -> float:
        """√max(0, rms² − floor²) of an output on the held-out part; NaN without a prediction.

        `inside`: for each window which of the samples scored count.
        """
        traces = self.traces[stage]
        if traces is None:
            return float("nan")
        errors = [t.error(name) for t in traces]
        if inside is not None:
            errors = [e[i] for e, i in zip(errors, inside, strict=True)]
        every = np.concatenate(errors)
        return above(float(np.sqrt(np.mean(every**2))) if len(every) else float("nan"), self.floors[name])

    @property
    def regimes(self) -> list[Regime]:
        """Regimes in which the disagreement gathers, those of the largest quantities first."""
        found = [p.regime for x in self.located for p in x.places]
        return list({r.words: r for r in found}.values())[:MOST_REGIMES]

    def inside(self, regime: Regime, name: str) -> list[np.ndarray]:
        """For each held-out window, which samples scored of an output lie in a regime."""
        traces = self.traces["after"] or self.traces["reestimated"] or []
        found = []
        for t in traces:
            times = t.window.times[name][t.scored[name]]
            values = regimes.values(self.study, regime.regressor, t.window, times, t.state_at(times))
            found.append(regime.mask(values))
        return found


def above(rms: float, floor: Floor) -> float:
    """A root mean square error above the floor."""
    return float(np.sqrt(max(0.0, rms**2 - floor.level**2))) if np.isfinite(rms) else float("nan")


def gather(study: Study, answer: Answer, before: Fitted | None) -> Findings:
    """Measure everything that is shown; `before`: the model as it came."""
    base = _reestimated(study, answer)
    fits = dict(zip(STAGES, (before, base, answer.fitted), strict=True))
    traces = {stage: holdout.predict(study, f) for stage, f in fits.items()}
    return Findings(study, answer, traces, locate(study, base), _floors(study))


def _reestimated(study: Study, answer: Answer) -> Fitted:
    """The model without effects, fitted as well as its own parameters can.

    The search weighs errors by what noise would look like if nothing were missing; what a missing effect does
    is anything but that, so that without the effect the plain sum of squares is what predicts best.
    """
    if not answer.present:
        return answer.base
    problem = study.fit_problem
    weighed, problem.whiteners = problem.whiteners, None
    try:
        return study.fit_set(answer.base.point, (), {}) or answer.base
    finally:
        problem.whiteners = weighed


def _floors(study: Study) -> dict[str, Floor]:
    """Floors of what is predicted: from replicate runs where there are some, else those of the fit."""
    runs = unique([b.run for b in (*study.parts.fit, *study.parts.confirm, *study.parts.holdout)])
    found = replicates.pairs(runs, study.folder.ports.controls)
    if not found:
        return dict(study.floors)
    horizon = (1.0 - holdout.PREFIX) * holdout.WINDOW_S
    levels = replicates.levels(found, list(study.floors), horizon)
    names = ", ".join(sorted({r.name for pair in found for r in pair}))
    source = f"replicate runs ({names})"
    return {n: Floor(levels[n], source) if n in levels else f for n, f in study.floors.items()}
