"""Which recorded outputs an effect can move: only effects with one in common explain the same error."""

from collections.abc import Iterable, Sequence
from functools import cache

import casadi as ca
import numpy as np

from fmus.definition import Model
from reconcile.catalogue.effect import AXIS_PLACES
from reconcile.equations.model import Attached, Folder


class Reach:
    """The way from the ports of a folder's model to the `outputs` recorded."""

    def __init__(self, folder: Folder, outputs: Sequence[str]):
        self.folder, self.outputs = folder, tuple(outputs)
        model = folder.model
        x, u = model.symbols[:2]
        (hx, fx), (hu, fu) = ([dependence(model, g, by) for g in (model.h, model.f)] for by in (x, u))
        rows = {n: model.index("outputs", n) for n in outputs}
        self._states = {n: behind(fx, np.flatnonzero(hx[k])) for n, k in rows.items()}
        moved = {n: hu[k] | fu[sorted(self._states[n])].any(axis=0) for n, k in rows.items()}
        self._inputs = {n: {model.inputs[i].name for i in np.flatnonzero(m)} for n, m in moved.items()}
        self.of = cache(self._of)

    def common(self, a: Attached, b: Attached) -> bool:
        """Whether both move an output."""
        return not self.of(a).isdisjoint(self.of(b))

    def _of(self, a: Attached) -> frozenset[str]:
        """Outputs that an effect can move; all of them where the model does not tell."""
        model, ports, place = self.folder.model, self.folder.ports, a.effect.place
        signals = {*ports.members(a.port), a.other}
        if place == "output":
            found = signals & {*self.outputs}
        elif place == "input":
            found = {n for n in self.outputs if signals & self._inputs[n]}
        elif place in AXIS_PLACES and any(x.name == a.port for x in ports.axes):
            pushed = model.index("states", ports.axis(a.port).velocity)
            found = {n for n in self.outputs if pushed in self._states[n]}
        else:
            found = set()
        return frozenset(found or self.outputs)


def states_behind(model: Model, rows: Sequence[int]) -> set[int]:
    """States that outputs `rows` depend on, at once or in time."""
    x = model.symbols[0]
    return behind(
        dependence(model, model.f, x), np.flatnonzero(dependence(model, model.h, x)[list(rows)].any(axis=0))
    )


def behind(depends: np.ndarray, rows: Iterable[int]) -> set[int]:
    """`rows`, and all that they depend on in the end; `depends` [n, n]: each row on each column."""
    found = {int(i) for i in rows}
    while more := {int(i) for i in np.flatnonzero(depends[sorted(found)].any(axis=0))} - found:
        found |= more
    return found


def dependence(model: Model, function: ca.Function, by: ca.SX) -> np.ndarray:
    """[n, m] whether each result of a model's function depends on each of the symbols `by`."""
    return np.array(ca.DM(ca.jacobian_sparsity(function(*model.symbols), by), 1)) != 0
