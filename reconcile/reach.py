"""Which recorded outputs an effect can move: only effects with one in common explain the same error."""

from collections.abc import Sequence
from functools import cache

import casadi as ca
import numpy as np

from fmus.definition import Model
from reconcile.model import Attached, Folder

AXIS_PLACES = ("force", "inertia", "coupling")


class Reach:
    """The way from the ports of a folder's model to the `outputs` recorded."""

    def __init__(self, folder: Folder, outputs: Sequence[str]):
        self.folder, self.outputs = folder, tuple(outputs)
        names = [v.name for v in folder.model.outputs]
        self._states = {n: states_behind(folder.model, [names.index(n)]) for n in outputs}
        self._inputs = {n: self._inputs_behind(names.index(n), s) for n, s in self._states.items()}
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

    def _inputs_behind(self, row: int, states: set[int]) -> set[str]:
        """Inputs that an output depends on, at once or through these states."""
        model, symbols = self.folder.model, self.folder.model.symbols
        hu, fu = (_felt(f(*symbols), symbols[1]) for f in (model.h, model.f))
        felt = hu[row] | fu[sorted(states)].any(axis=0)
        return {v.name for v, moves in zip(model.inputs, felt, strict=True) if moves}


def states_behind(model: Model, rows: Sequence[int]) -> set[int]:
    """States that outputs `rows` depend on, at once or in time."""
    symbols = model.symbols
    hx, fx = (_felt(f(*symbols), symbols[0]) for f in (model.h, model.f))
    found = set(np.flatnonzero(hx[list(rows)].any(axis=0)))
    while more := set(np.flatnonzero(fx[sorted(found)].any(axis=0))) - found:
        found |= more
    return {int(i) for i in found}


def _felt(expression: ca.SX, by: ca.SX) -> np.ndarray:
    """[n, m] whether each row depends on each of the symbols."""
    return np.array(ca.DM(ca.jacobian_sparsity(expression, by), 1)) != 0
