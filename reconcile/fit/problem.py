"""The simulation error of an extended model over windows, with the initial states of each projected out.

A point is a parameter vector and one initial state a window.  `Linear` is the problem linearised there: the
whitened errors and their slopes by the parameters, freed of everything that initial states could explain
(variable projection: Golub and Pereyra 1973), so that the rest is a plain least-squares problem.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from reconcile.fit import beginning
from reconcile.fit.common import Common, Wanted
from reconcile.fit.compiled import Compiled
from reconcile.fit.late import Late
from reconcile.fit.library import Columns, Cut, Followed
from reconcile.fit.modes import by_guards
from reconcile.fit.point import Linear, Piece, Point, joined, projected
from reconcile.fit.reading import Readings
from reconcile.fit.whitening import Whitener
from reconcile.fit.windows import Edge, InputTable, Window, longer
from reconcile.model import Attached

ACCURACY = 2e-5  # of a state's size, of one step
SHARE_OF_NOISE = 0.02
LOOSE = 3.0  # sizes of a state by which an initial state is free
LEAST = 1e-6  # of that: no initial state is held closer, however narrow a play


class Problem:
    """Windows to meet with a compiled extended model; `sigma`: noise level of each output."""

    def __init__(self, compiled: Compiled, windows: Sequence[Window], sigma: Mapping[str, float]):
        self.compiled, self.extended = compiled, compiled.extended
        self.windows, self.sigma = list(windows), dict(sigma)
        model = self.extended.model
        self.model = model
        self.outputs = [
            n
            for n in (v.name for v in model.outputs)
            if n in self.sigma and any(len(w.times.get(n, ())) for w in windows)
        ]
        self.late = Late(self.extended, self.outputs)
        defaults = np.array([v.start for v in model.inputs])
        names = [v.name for v in model.inputs]
        forces = len(self.extended.folder.ports.axes)
        self.tables = {id(w.run): InputTable(w.run, names, defaults, forces) for w in windows}
        self.widths: Mapping[str, int] = {}
        self.scale = np.ones(compiled.nx)
        self.tolerance = np.full(compiled.nx, 1e-3)
        self.patience = 1.0  # times the tolerance: more where sets are only ranked
        self.heat = 1.0  # times the noise: more far from an answer, where steps at full sharpness overshoot
        self.readings = Readings(model.kind, {n: model.index("outputs", n) for n in self.outputs})
        self._common: Common | None = None
        self._patient: tuple[float, np.ndarray] | None = None
        self._wanted: dict[tuple[int, ...], Wanted] = {}
        self._place = {n: i for i, n in enumerate(self.extended.state_names)}
        self._driven: dict[tuple[int, float, int], tuple[tuple[float, ...], Any]] = {}
        self.whiteners: list[Whitener] | None = None
        self._modes: dict[tuple[int, float, int], np.ndarray] = {}

    # ---------------------------------------------------------------- parameters

    def parameter(self, name: str) -> int:
        """Index of a parameter."""
        return self.extended.index[name]

    def active_states(self, present: Sequence[Attached]) -> np.ndarray:
        """Indices of the model's states and the hidden ones of `present` effects."""
        own = [self._place[a.name(h)] for a in present for h in a.effect.hidden]
        return np.array([*range(len(self.model.states)), *own], dtype=np.int32)

    def freedom(self, active: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Spread of the initial values of states: effects' own are within the size of what they follow.

        Those in play lie within it: parameters `p` [NP] say how wide it is.
        """
        spread = np.where(np.arange(len(self.scale)) < len(self.model.states), LOOSE, 1.0) * self.scale
        if len(self._play):
            state, parameter = self._play["state"], self._play["parameter"]
            wide = np.maximum(self._play["share"] * p[parameter], LEAST * spread[state])
            spread[state] = np.minimum(wide, spread[state])
        return spread[active]

    def common(self, point: Point) -> Common:
        """What all windows share at a point; kept for the next of them."""
        kept = self._common
        if kept is None or kept.p is not point.p or kept.present is not point.present:
            p, active = point.p, self.active_states(point.present)
            p.setflags(write=False)  # what is kept is of these very numbers
            late = {n: self.late.of_output(n, p) for n in self.outputs}
            loose = 1.0 / self.freedom(active, p)
            kept = self._common = Common(p, point.present, active, loose, self.late.of_inputs(p), late)
        return kept

    def wanted(self, parameters: Sequence[int]) -> Wanted:
        """Parameters to differentiate by, as windows need them."""
        key = tuple(parameters)
        if key not in self._wanted:
            self._wanted[key] = Wanted.of(key, self.late)
        return self._wanted[key]

    @cached_property
    def _play(self) -> np.ndarray:
        """Hidden states in play, the parameter that says how wide it is, and their share of it."""
        found = [
            (self._place[a.name(hidden)], self.parameter(a.name(name)), share)
            for a in self.extended.attached
            for hidden, (name, share) in a.effect.within.items()
        ]
        return np.array(found, [("state", int), ("parameter", int), ("share", float)])

    def with_present(self, point: Point, present: Sequence[Attached]) -> Point:
        """The point with other effects present; hidden states new to it start where they rest."""
        fresh = [a for a in present if a not in point.present and a.effect.hidden]
        x0 = point.x0
        if fresh:
            x0 = x0.copy()
            rows = self.active_states(fresh)[len(self.model.states) :]
            for k, window in enumerate(self.windows):
                u = self._inputs(window, self.late.of_inputs(point.p))[0]
                rest = np.asarray(
                    self.compiled.start_function(x0[k], u[0], self._mode(window)[0], point.p)
                ).ravel()
                x0[k, rows] = rest[rows - len(self.model.states)]
        return replace(point, x0=x0, present=tuple(present))

    def set_scale(self, scale: np.ndarray) -> None:
        """Sizes of the states; steps are halved until right to a share of the noise, where it shows."""
        self.scale, self.tolerance, self._common, self._patient = scale, ACCURACY * scale, None, None
        for state, (output, order) in self.shown.items():
            if order == 0:
                self.tolerance[state] = min(self.tolerance[state], SHARE_OF_NOISE * self.sigma[output])
        for hidden, role, axis in self.extended.beside():
            if (own := getattr(axis, role)) is not None:
                self.tolerance[self._place[hidden]] = self.tolerance[self._place[own]]

    # ---------------------------------------------------------------- simulation

    def smooth(self, widths: Mapping[str, int]) -> None:
        """Drive the model by smoothed inputs from here on: `widths` in samples, by input."""
        self.widths = widths
        self.tables = {
            run: InputTable(t.run, t.names, t.defaults, t.forces, widths) for run, t in self.tables.items()
        }
        self._driven, self._modes = {}, {}

    def _inputs(
        self, window: Window, delays: Mapping[int, float]
    ) -> tuple[np.ndarray, np.ndarray, Edge | None]:
        """Inputs [steps, inputs, clock, axes], their slopes by delays, and where steps are cut."""
        key, late = (id(window.run), window.start_s, window.steps), tuple(delays.values())
        if key not in self._driven or self._driven[key][0] != late:  # most points leave delays as they are
            self._driven[key] = (late, self._driven_by(window, delays))
        return self._driven[key][1]

    def _driven_by(
        self, window: Window, delays: Mapping[int, float]
    ) -> tuple[np.ndarray, np.ndarray, Edge | None]:
        table = self.tables[id(window.run)]
        u, slope = table.rows(window, delays)
        edge = table.edge(window, delays) if self.model.kind == "continuous" else None
        if edge is not None:
            cut = edge.share > 0.0
            u[cut, edge.input], slope[cut, edge.input] = edge.before[cut], 0.0
        return u, slope, edge

    def _mode(self, window: Window) -> np.ndarray:
        """Modes [steps, NM] of a window: as recorded where an output shows them, else by the guards."""
        if not self.model.modes:
            return np.zeros((window.steps, 0))
        key = (id(window.run), window.start_s, window.steps)
        if key not in self._modes:
            self._modes[key] = by_guards(self, window)
        return self._modes[key]

    def simulate(
        self, point: Point, k: int, columns: Sequence[int] | None = None, pushed: Columns | None = None
    ):
        """Follow window k; `columns` are parameters to differentiate by, `pushed` inputs instead of them."""
        window = longer(self.windows[k], self.common(point).outputs)
        chosen = pushed if columns is None else self.wanted(columns).columns(window.steps)
        run = self.follow(window, point.x0[k], point, chosen, pushed is not None)
        if run is None or columns is None:
            return run
        x, y, ys = run
        first, shifted = len(self.common(point).active), self.wanted(columns).shifted
        for extra, (c, _) in enumerate(shifted[len(columns) :], first + len(columns)):
            ys[:, first + c] += ys[:, extra]
        return x, y, np.ascontiguousarray(ys[:, : first + len(columns)])

    def follow(
        self,
        window: Window,
        x0: np.ndarray,
        point: Point,
        columns: Columns | None = None,
        pushed: bool = False,
    ) -> Followed | None:
        """Follow a window from x0 with the parameters of a point."""
        common = self.common(point)
        u, slope, edge = self._inputs(window, common.inputs)
        return self.compiled.follow(
            x0,
            u,
            np.ones_like(slope) if pushed else slope,
            self._mode(window),
            point.p,
            window.step_s,
            common.active,
            self.scale,
            self._tolerance(),
            columns,
            None if edge is None else Cut(edge.input, edge.share, edge.after, not pushed),
        )

    def _tolerance(self) -> np.ndarray:
        """Errors [NX] of the states above which a step is halved."""
        if self._patient is None or self._patient[0] != self.patience:
            self._patient = self.patience, self.tolerance * self.patience
        return self._patient[1]

    def responses(
        self,
        point: Point,
        k: int,
        inputs: Sequence[int],
        edges: np.ndarray,
        columns: Sequence[int],
        pushed_at: Point | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Errors [N] of window k, slopes by what is free [N, states + columns], responses [N, inputs x bins].

        A response is to one unit of an input over one bin; `edges` are the first steps of the bins, and
        `pushed_at` is the point that responds, if another.
        """
        responds = pushed_at or point
        run = self.simulate(point, k, columns)
        bins = len(edges) - 1
        pushed = Columns.of(
            [-1] * (bins * len(inputs)),
            [i for i in inputs for _ in range(bins)],
            list(edges[:-1]) * len(inputs),
            list(edges[1:]) * len(inputs),
        )
        moved = self.simulate(responds, k, None, pushed)
        if run is None or moved is None:
            return None
        _, errors, slopes = self.compare(point, k, run, columns)
        answer = self.compare(responds, k, moved)[2]
        return errors, slopes, answer[:, len(self.common(responds).active) :]

    def compare(
        self, point: Point, k: int, run: Followed, columns: Sequence[int] = ()
    ) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
        """Errors of window k as followed, in units of the noise: by output, all [N], and slopes [N, ...]."""
        window, (_, y, ys) = self.windows[k], run
        reading = self.readings.of(k, window, self.common(point).outputs, len(y))
        at, moved, slopes = self.compiled.sample(reading, y, ys)
        sigma, first = np.empty(len(at)), slopes.shape[1] - len(columns)
        for name, part in reading.parts.items():
            sigma[part] = self.heat * self.sigma[name]
        sigma[reading.past] = np.inf  # they tell nothing
        for name, late in self.wanted(columns).late.items():
            part = reading.parts[name]
            by_time = moved[part] / window.step_s
            for c, drifts in late:
                slopes[part, first + c] -= reading.since[part] * by_time if drifts else by_time
        errors = (reading.samples - at) / sigma
        return {n: errors[part] for n, part in reading.parts.items()}, errors, slopes / sigma[:, None]

    def linear(
        self, point: Point, columns: Sequence[int], known: Linear | None = None, changed: Sequence[int] = ()
    ) -> Linear | None:
        """The problem linearised at a point; None if the model runs away there.

        `known`: the same but for the initial states of the `changed` windows.
        """
        pieces = []
        for k in range(len(self.windows)):
            piece = self.piece(point, k, columns) if known is None or k in changed else known.pieces[k]
            if piece is None:
                return None
            pieces.append(piece)
        return joined(pieces)

    def piece(self, point: Point, k: int, columns: Sequence[int]) -> Piece | None:
        """Window k linearised; None if the model runs away there."""
        run = self.simulate(point, k, columns)
        if run is None:
            return None
        found, e, slope = self.compare(point, k, run, columns)
        if self.whiteners is not None:
            slope, e = self.whiteners[k](slope), self.whiteners[k](e)
        return projected(e, slope, self.common(point).loose, len(self.model.states), found, run[0])

    def errors(self, point: Point) -> list[dict[str, np.ndarray]] | None:
        """Whitened errors by window and output, initial states as they are."""
        found = []
        for k in range(len(self.windows)):
            run = self.simulate(point, k)
            if run is None:
                return None
            found.append(self.compare(point, k, run)[0])
        return found

    def start(self, values: Mapping[str, float]) -> Point:
        """A point with parameters by name; initial states as `beginning.fresh` finds them."""
        return beginning.start(self, values)

    @cached_property
    def shown(self) -> dict[int, tuple[str, int]]:
        """State -> (output that shows it, 0; or shows what it is the rate of, 1)."""
        return beginning.shown_states(self.model, self.outputs)
