"""What the report shows, measured once: held-out predictions, where the disagreement is, floors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from reconcile.errors import holdout, regimes, replicates
from reconcile.errors.ahead import horizon_s
from reconcile.errors.holdout import Trace
from reconcile.errors.localise import Located, locate
from reconcile.errors.regimes import Regime
from reconcile.filter.kalman import NOISES
from reconcile.filter.point import Point
from reconcile.judging.answer import Answer
from reconcile.search.core import Core
from reconcile.search.sizes import Floor

STAGES = ("nominal", "reestimated", "after")
MOST_REGIMES = 4


@dataclass(frozen=True)
class Findings:
    """An answer with predictions of the held-out part by stage (None where the model runs away).

    `located`: where the re-estimated model without effects disagrees; `floors` may rest on replicate runs.
    """

    core: Core
    answer: Answer
    traces: Mapping[str, list[Trace] | None]
    located: list[Located]
    floors: Mapping[str, Floor]

    @property
    def outputs(self) -> list[str]:
        """Signals that are compared."""
        return list(self.core.outputs)

    def gap(self, stage: str, name: str, inside: Sequence[np.ndarray] | None = None) -> float:
        """√max(0, rms² − floor²) of an output on the held-out part; NaN without a prediction.

        `inside`: for each stretch which of the samples count.
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

    def inside(self, regime: Regime, name: str, stage: str) -> list[np.ndarray]:
        """For each held-out stretch, which samples of an output, as a stage predicts them, lie in a regime.

        The states are those of the answer. With another delay of a sensor other samples lie in a stretch.
        """
        known = self.traces["after"] or self.traces["reestimated"] or []
        found = []
        for t, own in zip(known, self.traces[stage] or known, strict=True):
            times = own.window.times[name]
            values = regimes.values(self.core, regime.regressor, own.window, times, t.state_at(times))
            found.append(regime.mask(values))
        return found


def above(rms: float, floor: Floor) -> float:
    """A root mean square error above the floor."""
    return float(np.sqrt(max(0.0, rms**2 - floor.level**2))) if np.isfinite(rms) else float("nan")


def gather(answer: Answer) -> Findings:
    """Measure everything that is shown."""
    core, alone = answer.core, answer.judged.alone
    came = core.nominal(answer.base if alone else None)
    fitted = answer.base, answer.point
    if not alone:
        best = answer.beam.points[answer.judged.answer] if answer.present else core.base
        fitted = _followed(answer.base, core.base), _followed(answer.point, best)
    points = dict(zip(STAGES, (came, *fitted), strict=True))
    traces = {stage: holdout.predict(core, p) for stage, p in points.items()}
    return Findings(core, answer, traces, locate(core, core.shown), _floors(core))


def _followed(point: Point, by_likelihood: Point) -> Point:
    """The point with the disturbance of a fit by likelihood.

    Without one, as by the output error, no filter would follow the recording to where a stretch begins.
    """
    noise = {n: v for n, v in by_likelihood.values.items() if n.startswith(NOISES)}
    return replace(point, values=point.values | noise)


def _floors(core: Core) -> dict[str, Floor]:
    """Floors of what is predicted: from replicate runs where there are some, else those of the fit."""
    found = replicates.pairs(core.runs, core.folder.ports.controls)
    if not found:
        return dict(core.floors)
    levels = replicates.levels(found, list(core.outputs), horizon_s(core))
    names = ", ".join(sorted({r.name for pair in found for r in pair}))
    source = f"replicate runs ({names})"
    return {n: Floor(levels[n], source) if n in levels else f for n, f in core.floors.items()}
