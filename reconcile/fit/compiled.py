"""An extended model as machine code: compiled once, called for every window, candidate and step of a fit."""

from dataclasses import dataclass, field, replace

import numpy as np

from reconcile.extended import Extended
from reconcile.fit.equations import Equations
from reconcile.fit.library import FUNCTIONS, NO_COLUMNS, Columns, Cut, Followed, Library, Prepared

# what compiling takes, in operations that a processor does in that time: in all, and by operation compiled
STARTING, BY_OPERATION = 5.0e8, 4.0e5


class Compiled:
    """The equations of `extended`: whole, without effects that have hidden states, and for sets of effects.

    A step of the first two costs a multiple of what the few effects need that are present or asked for.  A
    set that is followed for so long that compiling it by itself pays gets equations of its own; the numbers
    are the same, since what is absent adds nothing.
    """

    def __init__(self, extended: Extended):
        self.extended = extended
        self._effects = [a for a in extended.attached if not a.effect.delays]
        lean = [not a.effect.hidden for a in self._effects]
        self._whole = self._part(Library(Equations(extended)))
        self._lean = self._whole
        if not all(lean):
            few = [a for a in extended.attached if not a.effect.hidden]
            self._lean = self._part(Library(Equations(Extended(extended.folder, few))))
        self.nx, self.ny = self._whole.library.nx, self._whole.library.ny
        self.start_function = extended.functions[2]
        self._hidden = np.array([not x for x in lean], dtype=bool)
        self._sets: dict[bytes, _Set] = {}
        self._known: dict[tuple[bytes, bytes, bytes], tuple[_Set, np.ndarray]] = {}
        self._last: tuple[tuple, _Part, Prepared] | None = None
        self.sample = self._whole.library.sample
        self._index()

    def _index(self) -> None:
        """By parameter and by state the effect that it belongs to, -1: the model, or a delay."""
        index, states = self.extended.index, {n: i for i, n in enumerate(self.extended.state_names)}
        self._of_parameter = np.full(len(index) + 1, -1)  # the last: no parameter
        self._of_state = np.full(len(states), -1)
        switches = {}
        for i, a in enumerate(self._effects):
            named = (*a.columns, *a.free, *((a.name("width"),) if a.effect.width else ()))
            self._of_parameter[[index[n] for n in named]] = i
            self._of_state[[states[a.name(h)] for h in a.effect.hidden]] = i
            switches |= {index[n]: i for n in a.columns}
        self._switches, self._switched = np.array(list(switches), int), np.array(list(switches.values()), int)

    def follow(
        self,
        x0: np.ndarray,
        u: np.ndarray,
        shift: np.ndarray,
        m: np.ndarray,
        p: np.ndarray,
        step_s: float,
        active: np.ndarray,
        scale: np.ndarray,
        tolerance: np.ndarray,
        columns: Columns | None = None,
        cut: Cut | None = None,
    ) -> Followed | None:
        """States [n + 1, NX], outputs [n + 1, NY], their slopes [n + 1, active + columns, NY] over n steps.

        `scale`, `tolerance` [NX]: sizes of the states, and errors above which a step is halved.
        None if the states run away.
        """
        part, prepared = self._prepared(p, active, scale, tolerance, columns)
        if part is self._whole:
            return part.library.follow(prepared, x0, u, shift, m, step_s, cut)
        found = part.library.follow(prepared, x0[part.states], u, shift, m, step_s, cut)
        if found is None:
            return None
        x = np.empty((len(found[0]), self.nx))
        x[:] = x0
        x[:, part.states] = found[0]
        return x, found[1], found[2]

    def _prepared(self, *given) -> "tuple[_Part, Prepared]":
        """The equations to follow with and what they need: as for the window before if that is the same."""
        if self._last is not None and all(a is b for a, b in zip(self._last[0], given, strict=True)):
            return self._last[1:]
        p, active, scale, tolerance, columns = given
        used = self._for(p, active, columns.parameter if columns else NO_COLUMNS)
        part, s = used.part, used.part.states
        if part is not self._whole:
            p, active, scale, tolerance = p[part.kept], part.state[active], scale[s], tolerance[s]
            columns = columns and replace(columns, parameter=part.parameter[columns.parameter])
        prepared = part.library.prepared(p, active, scale, tolerance, columns, used.calls)
        self._last = given, part, prepared
        return part, prepared

    def _for(self, p: np.ndarray, active: np.ndarray, wanted: np.ndarray) -> "_Set":
        """The set of what is present or asked for, with equations that hold it."""
        on = p[self._switches] != 0.0
        known = on.tobytes(), active.tobytes(), wanted.tobytes()
        if known not in self._known:
            self._known[known] = self._set(on, active, wanted)
        found, needed = self._known[known]
        if not found.own and found.calls @ found.part.library.equations.operations > STARTING:
            self._own(found, needed)
        return found

    def _set(self, on: np.ndarray, active: np.ndarray, wanted: np.ndarray) -> "tuple[_Set, np.ndarray]":
        """The set of what is switched on, has active states or is differentiated by, and its effects."""
        needed = np.zeros(len(self._effects) + 1, dtype=bool)  # the last: of no effect
        needed[self._switched[on]] = True
        needed[self._of_state[active]] = True
        needed[self._of_parameter[wanted]] = True
        key = needed[:-1].tobytes()
        if key not in self._sets:
            self._sets[key] = _Set(self._whole if needed[:-1][self._hidden].any() else self._lean)
        return self._sets[key], needed

    def _own(self, found: "_Set", needed: np.ndarray) -> None:
        """Give a set equations of its own once what they would have saved pays for compiling them."""
        if found.equations is None:
            few = [a for a, n in zip(self._effects, needed, strict=False) if n]
            found.equations = Equations(Extended(self.extended.folder, few))
        own, present = found.equations, found.part.library.equations
        if found.calls @ (present.operations - own.operations) > STARTING + BY_OPERATION * own.size:
            found.part, found.own = self._part(Library(own, quick=True)), True

    def _part(self, library: Library) -> "_Part":
        """How a library's parameters and states lie among all."""
        names, states = library.extended.parameter_names, library.extended.state_names
        kept = np.array([self.extended.index[n] for n in names], dtype=int)
        parameter = np.full(len(self.extended.index) + 1, -1)
        parameter[kept] = np.arange(len(kept))
        place = {n: i for i, n in enumerate(self.extended.state_names)}
        inside = np.array([place[n] for n in states], dtype=int)
        state = np.full(len(place), -1)
        state[inside] = np.arange(len(inside))
        return _Part(library, kept, parameter, inside, state)


@dataclass(frozen=True)
class _Part:
    """Equations of some effects: `kept` their parameters and `states` their states among all; and back."""

    library: Library
    kept: np.ndarray
    parameter: np.ndarray  # -1: it has none; so has the last, which stands for none
    states: np.ndarray
    state: np.ndarray


@dataclass
class _Set:
    """A set of effects: the equations in use, whether they are its `own`, and calls of each function."""

    part: _Part
    own: bool = False
    equations: Equations | None = None
    calls: np.ndarray = field(default_factory=lambda: np.zeros(FUNCTIONS, np.int64))
