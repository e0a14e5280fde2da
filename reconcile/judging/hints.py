"""Where nothing is named: the effects with which the model by itself would err least.

A large disturbance may do the work of an effect, and the likelihood then says nothing of it.  By its output
error the model does.  That is a hint and no answer: what lasts is no noise, and no probability follows.
"""

import numpy as np

from reconcile import words
from reconcile.equations.model import Attached
from reconcile.errors.ahead import beyond_noise, by_stretch
from reconcile.filter.point import Point
from reconcile.judging.answer import Answer
from reconcile.search.alone import alone, fit
from reconcile.search.core import Core
from reconcile.search.screen import Screen
from reconcile.tolerances import AT_FLOOR

TRIED, SHOWN = 8, 3  # effects that are fitted, and those in the sentence
LESS = 0.25  # of the error, that a hint takes away at least
ALIKE = 0.1  # of the least error, within which effects are hints alike


def by_output_error(answer: Answer) -> str:
    """A sentence on single effects; "" where something is named, or nothing unexplained is left."""
    core = answer.core
    if answer.present or beyond_noise(core, answer.point) <= AT_FLOOR or not alone(core):
        return ""
    plain = alone(core)[0]
    scores = Screen(core, plain, answer.beam.shapes).all(core.candidates, {})[:TRIED]
    tried = [(s.attached, fit(core, [plain.values | s.values], (s.attached,))) for s in scores]
    errs = {a: _error(core, point) for a, point in tried if point}
    least, without = min(errs.values(), default=np.inf), _error(core, plain)
    if least > (1.0 - LESS) * without:
        return ""
    alike = sorted((a for a in errs if errs[a] < (1.0 + ALIKE) * least), key=_parameters)[:SHOWN]
    names = words.listed([f"{a.effect.name} ({a.port})" for a in alike], "or")
    return (
        f"A hint: by itself, without any disturbance, the model errs by {words.percent(least)} instead of "
        f"{words.percent(without)} with {names}."
    )


def _error(core: Core, point: Point) -> float:
    """Error ahead (rms) in all that is not held out, noise and all, in spreads of the outputs."""
    squares, _, count = np.vstack([by_stretch(core, point, w) for w in ("fit", "confirm")]).sum(axis=0)
    return float(np.sqrt(squares / max(count, 1.0)))


def _parameters(a: Attached) -> int:
    return len(a.effect.parameters)
