"""A lead of the outputs: inputs that act earlier than they are recorded, by up to a sample and a half.

The model holds an input's sample until the next one.  An input that varies in between acts half a sample
earlier than that; so does the position of a simulation by the semi-implicit Euler method.  An input that is
logged a cycle late acts a whole sample earlier.  None of this is the machine's, and no effect of the catalogue
is early: a hidden shaft would have to stand for it.  So the search may take a lead as it takes an effect.
"""

from collections.abc import Sequence

from reconcile.catalogue.effect import Effect, Parameter, none
from reconcile.recordings.data import Run
from reconcile.recordings.leading import input_period
from reconcile.search.sets import Sets
from reconcile.tolerances import LEAD_GAIN

NAME = "lead"
MOST = 1.5  # samples: a cycle, and half a sample in between


def effect(runs: Sequence[Run]) -> Effect:
    """Outputs earlier, by so many samples of these runs' inputs at most."""
    most = MOST * input_period(runs)
    return Effect(
        NAME,
        "output",
        "y'(t) = y(t − delay), delay < 0",
        (Parameter("delay", "s", none, amplitude=True, low=-most, high=0.0),),
        None,
        "",
        delays=True,
    )


def found(sets: Sets) -> dict[str, float]:
    """Leads (s) of the best set, by output or group; {} unless it is likelier than every set without any."""
    leads = {k: [a for a in k if a.effect.name == NAME] for k in sets.ranked()}
    best = next(iter(leads))
    without = next(k for k, own in leads.items() if not own)
    if sets.evidence(best) < sets.evidence(without) + LEAD_GAIN:
        return {}
    return {a.port: -sets.points[best].values[a.name("delay")] for a in leads[best]}
