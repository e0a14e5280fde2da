"""A free form that has to be fitted: dry friction whose level changes along the way.

Where an axis sticks moves with the level of its friction, so that slopes at a fit (freeform.py) say little of
such a form; it is tried in simulation.  Friction that a random force makes up for is no less friction: both
fits are judged by the noise that is likeliest for each.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from reconcile import evidence
from reconcile.catalogue import ALL
from reconcile.catalogue.effect import ANY, Effect, Namespace, Parameter, Result
from reconcile.fit.solve import Fitted
from reconcile.freeform import NONE, FreeForm
from reconcile.model import Attached
from reconcile.search import Answer
from reconcile.study import Study

DRY = ("coulomb_friction", "asymmetric_coulomb_friction", "stribeck_friction")
ROUNDS = 2  # of fits, each with the noise judged by the one before
SHAPE = (
    Parameter("slope", "1/({q})", lambda s: (0.0,), "Change of the level along the way", low=ANY),
    Parameter("bend", "1/({q})^2", lambda s: (0.0,), "Change of that", low=ANY),
)


def examine(study: Study, answer: Answer) -> FreeForm:
    """What the answer would gain if the level of one of its dry frictions changed along the way."""
    if study.lost:
        return NONE
    places = {axis.name for axis in study.folder.ports.axes if axis.position}
    found = [_gained(study, answer, a) for a in answer.present if a.effect.name in DRY and a.port in places]
    return max(found, key=lambda f: f.gain - f.price, default=NONE)


def changing(friction: Effect) -> Effect:
    """The same friction times 1 + slope q + bend q², nowhere below nothing."""
    even: Any = friction.build

    def build(c: Namespace, p: Namespace, w: Namespace) -> Result:
        made, level = even(c, p, w), ca.fmax(1.0 + p.slope * c.q + p.bend * c.q**2, 0.0)
        dry: Any = made.dry and tuple(level * x for x in made.dry)
        return replace(made, value=level * made.value, dry=dry)

    return replace(
        friction, form="changing", parameters=(*friction.parameters, *SHAPE), build=build, becomes={}
    )


def _gained(study: Study, answer: Answer, friction: Attached) -> FreeForm:
    """What it gains if the level of this friction changes."""
    form = changing(friction.effect)
    keys = {a.effect.key for a in answer.present}
    own = study.beside((*(e for e in ALL if e.key in keys), form))
    known = {a.key: a for a in own.candidates}
    even = tuple(known[a.key] for a in answer.present)
    new = Attached(form, friction.port)
    uneven = (*(a for a in even if a.key != friction.key), new)
    named = study.named(answer.fitted.point.p)
    start = {n: named.get(n, v) for n, v in own.values.items()}
    before = _fitted(own, own.fit_set(own.fit_problem.start(start), even, start, near=True), even)
    if before is None:
        return NONE
    as_it_was = own.named(before.point.p)
    same = {new.name(q.name): as_it_was[friction.name(q.name)] for q in friction.effect.parameters}
    gain = own.deviance(before) - _left(own, before, uneven, same)
    count = evidence.count_of(before)
    above = max(before.cost - count, gain, 1e-9)
    terms = tuple(f"{friction.port}: {n} sgn v" for n in ("q", "q²"))
    return FreeForm(terms, gain, len(SHAPE) * float(np.log(count)), gain / above)


def _left(study: Study, before: Fitted, present: Sequence[Attached], values: dict[str, float]) -> float:
    """Minus twice the log-likelihood of a set fitted from near a fit, under its noise and under none."""
    found = [_fitted(study, study.fit_set(before.point, present, values, near=True), present)]
    study.fit_problem.whiteners = None  # that noise may stand for all that the level's change does
    found.append(_fitted(study, study.fit_set(before.point, present, values, near=True), present))
    return min((study.deviance(f) for f in found if f is not None), default=np.inf)


def _fitted(study: Study, found: Fitted | None, present: Sequence[Attached]) -> Fitted | None:
    """A fit again under the noise that it leaves itself, and judged by that from here on."""
    for _ in range(ROUNDS):
        if found is None:
            return None
        study.estimate_noise(found)
        found = study.fit_set(found.point, present, {}, near=True)
    return found
