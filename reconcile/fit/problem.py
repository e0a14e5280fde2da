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
from reconcile.fit.compiled import Compiled
from reconcile.fit.late import Late
from reconcile.fit.library import Columns, Cut
from reconcile.fit.modes import by_guards
from reconcile.fit.point import Linear, Piece, Point, joined, projected
from reconcile.fit.reading import Readings
from reconcile.fit.whitening import Whitener
from reconcile.fit.windows import Edge, InputTable, Window
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
        self.tables = {id(w.run): InputTable(w.run, names, defaults) for w in windows}
        self.scale = np.ones(compiled.nx)
        self.tolerance = np.full(compiled.nx, 1e-3)
        self.patience = 1.0  # times the tolerance: more where sets are only ranked
        self.heat = 1.0  # times the noise: more far from an answer, where steps at full sharpness overshoot
        self.readings = Readings(model.kind)
        self._driven: dict[tuple[int, float, int], tuple[tuple[float, ...], Any]] = {}
        self.whiteners: list[Whitener] | None = None
        self._modes: dict[tuple[int, float, int], np.ndarray] = {}

    # ---------------------------------------------------------------- parameters

    def parameter(self, name: str) -> int:
        """Index of a parameter."""
        return self.extended.index[name]

    def active_states(self, present: Sequence[Attached]) -> np.ndarray:
        """Indices of the model's states and the hidden ones of `present` effects."""
        names = self.extended.state_names
        own = [names.index(a.name(h)) for a in present for h in a.effect.hidden]
        return np.array([*range(len(self.model.states)), *own], dtype=np.int32)

    def freedom(self, active: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Spread of the initial values of states: effects' own are within the size of what they follow.

        Those in play lie within it: parameters `p` [NP] say how wide it is.
        """
        spread = np.where(np.arange(len(self.scale)) < len(self.model.states), LOOSE, 1.0) * self.scale
        for state, parameter, share in self._play:
            spread[state] = np.clip(share * p[parameter], LEAST * spread[state], spread[state])
        return spread[active]

    @cached_property
    def _play(self) -> list[tuple[int, int, float]]:
        """Hidden states in play, the parameter that says how wide it is, and their share of it."""
        states = self.extended.state_names
        return [
            (states.index(a.name(hidden)), self.parameter(a.name(name)), share)
            for a in self.extended.attached
            for hidden, (name, share) in a.effect.within.items()
        ]

    def with_present(self, point: Point, present: Sequence[Attached]) -> Point:
        """The point with other effects present; hidden states new to it start where they rest."""
        fresh = [a for a in present if a not in point.present and a.effect.hidden]
        x0 = point.x0
        if fresh:
            x0 = x0.copy()
            rows = self.active_states(fresh)[len(self.model.states) :]
            for k, window in enumerate(self.windows):
                u = self._inputs(window, point.p)[0]
                rest = np.asarray(
                    self.compiled.start_function(x0[k], u[0], self._mode(window)[0], point.p)
                ).ravel()
                x0[k, rows] = rest[rows - len(self.model.states)]
        return replace(point, x0=x0, present=tuple(present))

    def set_scale(self, scale: np.ndarray) -> None:
        """Sizes of the states; steps are halved until right to a share of the noise, where it shows."""
        self.scale, self.tolerance = scale, ACCURACY * scale
        for state, (output, order) in self.shown.items():
            if order == 0:
                self.tolerance[state] = min(self.tolerance[state], SHARE_OF_NOISE * self.sigma[output])
        states = self.extended.state_names
        for hidden, role, axis in self.extended.beside():
            if (own := getattr(axis, role)) is not None:
                self.tolerance[states.index(hidden)] = self.tolerance[states.index(own)]

    # ---------------------------------------------------------------- simulation

    def _inputs(self, window: Window, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, Edge | None]:
        """Inputs [steps, inputs, clock, axes], their slopes by delays, and where steps are cut."""
        delays = self.late.of_inputs(p)
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
        axes = len(self.extended.folder.ports.axes)
        return np.hstack([u, np.zeros((len(u), axes))]), np.hstack([slope, np.ones((len(u), axes))]), edge

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
        window = self.windows[k]
        chosen = pushed if columns is None else self._columns(window, columns)
        run = self.follow(window, point.x0[k], point, chosen, pushed is not None)
        if run is None or columns is None:
            return run
        x, y, ys = run
        first = len(self.active_states(point.present))
        for extra, (c, _) in enumerate(self._shifted(columns)[len(columns) :], first + len(columns)):
            ys[:, first + c] += ys[:, extra]
        return x, y, ys[:, : first + len(columns)]

    def follow(
        self,
        window: Window,
        x0: np.ndarray,
        point: Point,
        columns: Columns | None = None,
        pushed: bool = False,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Follow a window from x0 with the parameters of a point."""
        u, slope, edge = self._inputs(window, point.p)
        return self.compiled.follow(
            x0,
            u,
            np.ones_like(slope) if pushed else slope,
            self._mode(window),
            point.p,
            window.step_s,
            self.active_states(point.present),
            self.scale,
            self.tolerance * self.patience,
            columns,
            None if edge is None else Cut(edge.input, edge.share, edge.after, not pushed),
        )

    def _columns(self, window: Window, columns: Sequence[int]) -> Columns:
        """Columns of parameters; a delay of several inputs has more, one each, which come last."""
        shifted = self._shifted(columns)
        more = len(shifted) - len(columns)
        parameters, inputs = [*columns, *[-1] * more], [i for _, i in shifted]
        return Columns(parameters, inputs, [0] * len(shifted), [window.steps] * len(shifted))

    def _shifted(self, columns: Sequence[int]) -> list[tuple[int, int]]:
        """(column, input that its delay shifts, -1: none): each column once, then the further inputs."""
        late = {c: [i for i, qs in self.late.inputs.items() if q in qs] for c, q in enumerate(columns)}
        further = [(c, i) for c, inputs in late.items() for i in inputs[1:]]
        return [(c, inputs[0] if inputs else -1) for c, inputs in late.items()] + further

    def responses(
        self, point: Point, k: int, inputs: Sequence[int], edges: np.ndarray, columns: Sequence[int]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Errors [N] of window k, slopes by what is free [N, states + columns], responses [N, inputs x bins].

        A response is to one unit of an input over one bin; `edges` are the first steps of the bins.
        """
        run = self.simulate(point, k, columns)
        bins = len(edges) - 1
        pushed = Columns(
            [-1] * (bins * len(inputs)),
            [i for i in inputs for _ in range(bins)],
            list(edges[:-1]) * len(inputs),
            list(edges[1:]) * len(inputs),
        )
        moved = self.simulate(point, k, None, pushed)
        if run is None or moved is None:
            return None
        _, y, ys = run
        found, parts = self.compare(point, k, y, ys, columns)
        answer = np.concatenate(self.compare(point, k, moved[1], moved[2], ())[1])
        n = len(self.active_states(point.present))
        return np.concatenate(list(found.values())), np.concatenate(parts), answer[:, n:]

    def compare(self, point: Point, k: int, y: np.ndarray, ys: np.ndarray | None, columns: Sequence[int]):
        """Whitened errors of window k by output, and their slopes output by output."""
        window, errors, slopes = self.windows[k], {}, []
        place = {} if ys is None else {q: ys.shape[1] - len(columns) + c for c, q in enumerate(columns)}
        for name in self.outputs:
            times = window.times.get(name, np.empty(0))
            since = times - window.run.start_s
            late = self.late.of_output(name, point.p, since)
            read = self.readings.of(k, name, window, times - late, len(y))
            column = self.model.index("outputs", name)
            sigma = self.heat * self.sigma[name]
            errors[name] = (window.samples[name] - read.value @ y[:, column]) / sigma
            if ys is None:
                continue
            part = read.value @ ys[:, :, column]
            moved = read.rate @ y[:, column] / window.step_s
            for q, weight in self.late.slopes(name, since):
                if q in place:
                    part[:, place[q]] -= weight * moved
            slopes.append(part / sigma)
        return errors, slopes

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
        x, y, ys = run
        found, parts = self.compare(point, k, y, ys, columns)
        slope, e = np.concatenate(parts), np.concatenate(list(found.values()))
        if self.whiteners is not None:
            slope, e = self.whiteners[k](slope), self.whiteners[k](e)
        loose = 1.0 / self.freedom(self.active_states(point.present), point.p)
        return projected(e, slope, loose, len(self.model.states), found, x)

    def errors(self, point: Point) -> list[dict[str, np.ndarray]] | None:
        """Whitened errors by window and output, initial states as they are."""
        found = []
        for k in range(len(self.windows)):
            run = self.simulate(point, k)
            if run is None:
                return None
            found.append(self.compare(point, k, run[1], None, ())[0])
        return found

    def start(self, values: Mapping[str, float]) -> Point:
        """A point with parameters by name; initial states as `beginning.fresh` finds them."""
        return beginning.start(self, values)

    @cached_property
    def shown(self) -> dict[int, tuple[str, int]]:
        """State -> (output that shows it, 0; or shows what it is the rate of, 1)."""
        return beginning.shown_states(self.model, self.outputs)
