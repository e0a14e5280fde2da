"""What recordings of a closed FMU cannot tell: effects that it cannot carry, parameters that do not show."""

import numpy as np

from reconcile.catalogue import ALL, Effect
from reconcile.closed.candidates import BIAS, candidates
from reconcile.closed.fitted import ClosedFit
from reconcile.closed.problem import ClosedProblem
from reconcile.judging.unidentifiable import NEEDS
from reconcile.tolerances import KNOWN

INSIDE = "the FMU is closed: it would have to change within"
FORCE = "the FMU is closed: only a disturbance input and an output with its speed let a force be told"
CLOCK = "the FMU is closed: nothing at its ports changes the clock of all outputs"
TURNED = "the FMU is closed: nobody says which of its outputs a sensor turns together"
FREE = "where output {0} begins is free, and a bias of it looks the same"
SIZELESS = "it is 0 in the FMU, so nobody knows how large it may be"
UNFELT = "it hardly shows in the recorded outputs"


def effects(problem: ClosedProblem) -> list[dict[str, str]]:
    """Effects that these recordings cannot tell, and because of what: [{"effect", "because"}]."""
    box, recorded = problem.box, problem.recorded
    present = {a.effect.name for a in candidates(box, recorded, problem.free)}
    rows: dict[str, list[str]] = {}
    for n in (n for n in (*box.ports.controls, *box.ports.outputs) if n not in recorded):
        place = "input" if n in box.ports.controls else "output"
        for e in (e for e in ALL if e.place == place):
            rows.setdefault(e.name, []).append(f"{place} {n} is not recorded")
    for n in sorted(problem.free):
        rows.setdefault(BIAS, []).append(FREE.format(n))
    for e in (e for e in ALL if e.name not in present and e.name not in rows):
        rows[e.name] = [_unfit(e)]
    return [{"effect": n, "because": "; ".join(dict.fromkeys(why))} for n, why in sorted(rows.items())]


def _unfit(effect: Effect) -> str:
    """Why an effect fits no port of a closed FMU all of whose signals are recorded."""
    if effect.place == "force" and not effect.port:
        return FORCE
    if effect.place not in ("input", "output"):
        return INSIDE
    lacking = [NEEDS[n] for n in effect.needs if n in NEEDS]
    return next(iter(lacking), CLOCK if effect.clock else TURNED)


def parameters(problem: ClosedProblem, fitted: ClosedFit) -> list[dict[str, object]]:
    """Parameters of the FMU that the recordings say nothing about: [{"parameter", "because", "drive"}].

    `drive` names the inputs that no recording moves; what else would help, a closed FMU does not say.
    """
    errors = dict(zip((f.name for f in fitted.free), np.sqrt(np.diag(fitted.covariance)), strict=True))
    told = {f.name for f in fitted.free if f.prior and errors[f.name] <= KNOWN * f.prior[1]}
    drive = problem.still_inputs
    return [
        {"parameter": v.name, "because": UNFELT if v.start else SIZELESS, "drive": drive if v.start else []}
        for v in problem.box.model.parameters
        if v.name not in told
    ]
