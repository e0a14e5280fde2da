"""A part that recordings may show in more than one way: the one that its plain model follows best.

A difference equation in leapfrog form has its rates half a step before its angles.  A machine has not;
another simulation of the same equations has.  Which it is the recordings tell: taken the wrong way, half a
step of delay would be named that is in neither.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from reconcile.equations.model import Folder
from reconcile.recordings.data import Run, split
from reconcile.search.core import Core
from reconcile.system.parts import Part
from specs.errors import InputError

Sets = Sequence[Sequence[Run]]  # to fit, to confirm, to hold out


def followed(part: Part, folder: Folder, read: Callable[[Part], Sets]) -> Sets:
    """Runs of a part in the way that its model, its own parameters fitted, follows best; `read` makes them.

    Raises InputError as `read` does.
    """
    ways = [read(part)]
    if part.otherwise is not None:
        ways.append(read(replace(part, derive=part.otherwise, later={}, otherwise=None)))
    return ways[0] if len(ways) == 1 else min(ways, key=lambda sets: _left(folder, sets))


def _left(folder: Folder, sets: Sets) -> float:
    """Nats a sample of the base model, its parameters and the noise fitted."""
    try:
        core = Core(folder, split(*sets, *[()] * (3 - len(sets))), ())
    except InputError:  # said where the answer is looked for
        return np.inf
    return core.base.total / max(1, int(np.isfinite(core.base.e).sum()))
