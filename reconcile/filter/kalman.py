"""The filter of a model folder with candidate effects over its recordings: parameters in, innovations out."""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from reconcile.equations.extended import Extended
from reconcile.equations.model import Attached, Folder
from reconcile.equations.reach import behind, dependence
from reconcile.filter.delays import Delays
from reconcile.filter.equations import Stepped
from reconcile.filter.library import Library
from reconcile.filter.record import KEPT, Record
from reconcile.filter.smooth import smoothed

Values = dict[str, float]  # parameters of the model, its effects and the noise, by name
SHOWN = ("e", "s", "z", "v", "free", "zfree", "de", "ds")
BY_SAMPLE = ("e", "s", "de", "ds")  # of these, what goes with samples and not with steps
NOTHING = np.empty((0, 0))
FOLLOWED = 4  # substeps, at least, where an effect of an input moves, or a gear closes, within a step
NOISES = SIGMA, TAU, WHITE, NOISE = "sigma of ", "tau of ", "white of ", "noise of "
CORRELATED = "correlated noise of "  # an output: a disturbance of what it shows
CREEP = "creep of "  # an axis: the speed by which its dry friction gives way at standstill
STILL = 1e-30  # where nothing says so: it stops


@dataclass
class Filtered:
    """What the filter makes of one recording: innovations and their variances [n, NY], and more on demand.

    Innovations stand where their samples would be without delays, so that all delays are told by the same
    samples; what is of states stands at its step.
    """

    e: np.ndarray
    s: np.ndarray
    z: np.ndarray  # states and disturbances [n, NX + NW]
    v: np.ndarray  # their variances
    free: np.ndarray  # outputs [n, NY] of the model by itself in windows
    zfree: np.ndarray
    de: np.ndarray  # slopes of e and of log s by parameters of the noise [n, NY, K]
    ds: np.ndarray
    y: np.ndarray


@dataclass
class _Rows:
    """A recording as the filter steps through it, for some delays: u [m, NU], y [m, NY], modes [m, NM].

    A step in which an input changes has a row for each of its parts; only the first has samples.
    """

    u: np.ndarray
    y: np.ndarray
    modes: np.ndarray
    step: np.ndarray  # [m] of which a row is a part
    later: np.ndarray  # [m] whether it is not the first of them
    first: np.ndarray | None  # rows [n] that are; None where all are
    at: np.ndarray  # [n, NY] numbers, among all steps and outputs, of what would be there without delays
    missing: np.ndarray  # [n, NY] where nothing would

    def of_steps(self, values: np.ndarray) -> np.ndarray:
        """Values [n, ...] of the steps among those [m, ...] of the rows."""
        return values if self.first is None else values[self.first]

    def of_samples(self, values: np.ndarray) -> np.ndarray:
        """Values [n, NY, ...] of the steps where their samples would be without delays, NaN where none is."""
        found = values.reshape(-1, *values.shape[2:])[self.at]
        found[self.missing] = np.nan
        return found


@dataclass
class _Part:
    """A library of some effects: its parameters among all, and its states' names."""

    library: Library
    extended: Extended
    index: np.ndarray


class Kalman:
    """Filters of one model: effects without hidden states all at once, others as they are asked for.

    `places`: names of what the disturbances w push, axes first; `disturbed`: these, and the outputs among
    `correlated`, whose noise has a memory.
    """

    def __init__(
        self,
        folder: Folder,
        candidates: Sequence[Attached],
        records: Sequence[Record],
        outputs: Sequence[str],
        correlated: Sequence[str] = (),
    ):
        self.correlated = tuple(correlated)
        self.folder, self.model, self.records = folder, folder.model, list(records)
        self.candidates, self.outputs = tuple(candidates), tuple(outputs)
        self.all_outputs = [v.name for v in self.model.outputs]
        self.pushed_states = self._pushed()
        self.whole = Extended(folder, self.candidates)
        self.places = [a.name for a in folder.ports.axes] + list(self.pushed_states)
        self.disturbed = self.places + [CORRELATED + n for n in self.correlated]
        self.delays = Delays(self.whole, list(self.outputs))
        self.substeps = 1
        self.extra_s = 0.0  # all outputs are late by so much, beside what the parameters say
        self.scale = np.array([v.nominal or 1.0 for v in self.model.states])
        self.sizes: Mapping[str, Sequence[float]] = {}  # of what is met at a port
        self._begins: tuple[bytes, np.ndarray] | None = None
        self._parts: dict[frozenset, _Part] = {}
        self._kept: dict[tuple, _Rows] = {}
        self.modes: list[np.ndarray] = [self._modes(r) for r in self.records]
        self.done = 0  # steps of the filter, substeps counted one by one, of all runs

    def _pushed(self) -> tuple[str, ...]:
        """States beside the axes' that a disturbance pushes: those that are recorded; without axes, all."""
        axes, names = self.folder.ports.axes, [v.name for v in self.model.states]
        if not axes:
            return tuple(names)
        moving = {n for a in axes for n in (a.position, a.velocity)}
        return tuple(names[i] for i, _, _ in self.shown if names[i] not in moving)

    # ---------------------------------------------------------------- one run of the filter

    def run(
        self,
        values: Values,
        present: Sequence[Attached],
        windows: Sequence[np.ndarray] | None = None,
        states: bool = False,
        smooth: bool = False,
        own: bool = False,
        by_noise: Sequence[np.ndarray] | None = None,
    ) -> list[Filtered] | None:
        """Innovations over every recording; None where the states run away.

        `windows` [n] of each: numbers of the stretches in which the model also runs by itself, without
        disturbance, from the filtered state (0: none).  `states`: what the filter knows of them by then,
        `smooth`: what all of the recording tells of them.  `own`: by equations of these effects alone.
        `by_noise`: slopes of sigma, 1/tau, white [disturbed, K] and variances [outputs, K] by K of the noise.
        """
        part = self._part(present, own)
        full = np.array([values[n] for n in self.whole.index])
        p = full[part.index]
        active = self._active(part, present)
        given = {
            "p": p,
            "sigma": np.array([values[SIGMA + n] for n in self.disturbed]),
            "keep": np.array([1.0 / values[TAU + n] for n in self.disturbed]),
            "white": np.array([values.get(WHITE + n, 0.0) for n in self.disturbed]),
            "r": np.array([values.get(NOISE + n, 1.0) ** 2 for n in self.outputs]),
            "creep": np.array([values.get(CREEP + a.name, STILL) for a in self.folder.ports.axes]),
        }
        memories, substeps = part.library.stepped.memories, self.substeps
        if self.model.kind == "continuous" and any(a in memories or a.effect.width == "gap" for a in present):
            substeps = max(substeps, FOLLOWED)
        found = []
        for k in range(len(self.records)):
            rows = self._rows(k, full)
            x0, p0 = self._start(part, p, rows.y)
            self.done += substeps * len(rows.y)
            more = {"u": rows.u, "m": rows.modes, "y": rows.y, "x0": x0, "p0": p0}
            run = part.library.run(
                substeps,
                self.records[k].period_s,
                active,
                given | more,
                None
                if windows is None
                else windows[k][np.minimum(rows.step + rows.later, len(windows[k]) - 1)],
                states or smooth,
                smooth,
                by_noise,
            )
            if run is None:
                return None
            if smooth:
                columns = np.concatenate([active, part.library.nx + np.arange(part.library.nw)])
                run["z"], run["v"] = smoothed(run, columns)
            whole = {n: rows.of_steps(run[n]) if n in run else NOTHING for n in SHOWN}
            whole |= {n: rows.of_samples(whole[n]) for n in BY_SAMPLE if n in run}
            found.append(Filtered(**whole, y=rows.of_steps(rows.y)))
        return found

    def over(self, records: Sequence[Record]) -> "Kalman":
        """The same filter over other recordings."""
        other = copy(self)
        other.records, other._kept = list(records), {}
        other.modes = [other._modes(r) for r in other.records]
        return other

    def state_names(self, present: Sequence[Attached], own: bool = False) -> list[str]:
        """States of a run with these effects, in the order of its columns."""
        return self._part(present, own).library.stepped.state_names

    def forces(self, values: Values, present: Sequence[Attached], z: Sequence[np.ndarray]) -> np.ndarray:
        """What effects in the motion do at every place [n, places], at states z [n, NX + NW].

        In the unit of the place's disturbance.  Effects of inputs and outputs are no forces.
        """
        part = self._part(present, own=True)
        stepped, stages = part.library.stepped, part.library.stepped.stages
        absent = dict(values)
        for a in present:
            if a.effect.place not in ("input", "output"):
                absent |= dict.fromkeys(a.columns, 0.0)
        names = part.extended.parameter_names
        p, p0 = (np.array([v[n] for n in names]) for v in (values, absent))
        found = []
        full = np.array([values[n] for n in self.whole.index])
        for k, states in enumerate(z):
            rows = self._rows(k, full)
            x, u = states[:, : part.library.nx].T, rows.of_steps(rows.u).T
            n, m = x.shape[1], self.modes[k].T
            rates = [np.asarray(stages["kf_f"].map(n)(x, u, m, np.repeat(q[:, None], n, 1))) for q in (p, p0)]
            dry = np.asarray(stages["kf_dry"].map(n)(x, u, m, np.repeat(p[:, None], n, 1)))
            found.append(self._at_places(stepped, rates[0] - rates[1], dry, x, values))
        return np.vstack(found)

    def _at_places(
        self, stepped: Stepped, change: np.ndarray, dry: np.ndarray, x: np.ndarray, values: Values
    ) -> np.ndarray:
        """Changes of rates [NX, n] and levels of dry friction as forces at the places [n, places]."""
        per = self.model.step if self.model.kind == "discrete" else 1.0
        columns = []
        for k, axis in enumerate(self.folder.ports.axes):
            row = stepped.state_names.index(axis.velocity)
            v = x[row]
            levels = np.where(v > 0.0, dry[k], -dry[len(self.folder.ports.axes) + k])
            slides = np.abs(np.tanh(v / values.get(CREEP + axis.name, STILL)))
            columns.append((change[row] / per - slides * levels) * self.whole.inertia(axis))
        columns += [change[stepped.state_names.index(n)] / per for n in self.pushed_states]
        return np.column_stack(columns)

    def _part(self, present: Sequence[Attached], own: bool) -> _Part:
        """The library for a set: of its effects alone, or with all candidates that it may be compared with.

        Effects with hidden states of their own share one library, the others another one.
        """
        states = [a for a in present if a.effect.hidden and a.effect.place != "input"]
        if own:
            kept = set(present)
        elif not states:
            kept = {a for a in self.candidates if not a.effect.hidden or a.effect.place == "input"}
        else:
            kept = {a for a in self.candidates if a.effect.hidden and a.effect.place != "input"} | set(
                present[:-1]
            )
            if states[-1] != present[-1]:  # what is looked for beside it has no states: all of those
                kept = {a for a in self.candidates if not a.effect.hidden or a.effect.place == "input"} | set(
                    states
                )
        kept = {a for a in kept if not a.effect.over or a in present}  # what is a curve is never looked for
        key = frozenset(kept)
        if key not in self._parts:
            attached = [a for a in self.candidates if a in kept or a.effect.delays]
            extended = Extended(self.folder, attached)
            stepped = Stepped(extended, self.outputs, self.pushed_states, self.correlated)
            library = Library(stepped)
            index = np.array([self.whole.index[n] for n in extended.parameter_names])
            self._parts[key] = _Part(library, extended, index)
        return self._parts[key]

    def _active(self, part: _Part, present: Sequence[Attached]) -> np.ndarray:
        names = part.library.stepped.state_names
        own = [a.name(h) for a in present if a.effect.place != "input" for h in a.effect.hidden]
        return np.array([*self.unsure, *(names.index(n) for n in own)], np.int32)

    @cached_property
    def unsure(self) -> list[int]:
        """The model's states but those that inputs alone move, step by step: these are known."""
        model = self.model
        every = list(range(len(model.states)))
        if model.kind == "continuous":
            return every
        axes = {n for a in self.folder.ports.axes for n in (a.position, a.velocity)} | set(self.pushed_states)
        pushed = [i for i in every if model.states[i].name in axes]
        return sorted(behind(dependence(model, model.f, model.symbols[0]).T, pushed))

    def _rows(self, k: int, p: np.ndarray) -> _Rows:
        """A recording for the delays among the parameters [NP]."""
        late_in = {self.model.inputs[i].name: d for i, d in self.delays.of_inputs(p).items()}
        late_out = {n: self.delays.of_output(n, p) for n in self.outputs}
        if self.extra_s:
            late_out = {n: (d + self.extra_s, drift) for n, (d, drift) in late_out.items()}
        key = (k, tuple(late_in.items()), tuple(late_out.items()))
        if key not in self._kept:
            if len(self._kept) > KEPT:
                self._kept.clear()
            self._kept[key] = self._placed(k, late_in, late_out)
        return self._kept[key]

    def _placed(
        self, k: int, late_in: Mapping[str, float], late_out: Mapping[str, tuple[float, float]]
    ) -> _Rows:
        record, own = self.records[k], self.model.inputs
        n = len(record.time)
        time, step = record.time, np.arange(n)
        if self.model.kind == "continuous":
            time, step = record.parts(late_in)
        later = np.diff(step, prepend=-1) == 0
        first = np.flatnonzero(~later)
        # between two steps of a model in steps its outputs are known, beyond one they are not
        after = self.model.kind == "discrete" and self.substeps == 1
        y, early = np.full((2, len(time), len(late_out)), np.nan)
        early[:] = 0.0
        at = np.empty((n, len(late_out)), int)
        for column, (name, late) in enumerate(late_out.items()):
            y[first, column], early[first, column] = record.output(name, late, after)
            at[:, column] = record.moved(name, late, after)
        edges = np.append(time, record.edges[-1])
        u = np.zeros((len(time), len(own) + 2 + len(self.disturbed) + len(late_out)))
        for column, v in enumerate(own):
            u[:, column] = record.input(v.name, v.start, late_in.get(v.name, 0.0), edges)
        u[:, len(own)] = time - record.run.began_s
        u[:, len(own) + 1 + len(self.disturbed)] = np.diff(edges)
        u[:, u.shape[1] - len(late_out) :] = early
        numbers = np.maximum(at, 0) * len(late_out) + np.arange(len(late_out))
        whole = len(first) == len(time)
        return _Rows(u, y, self.modes[k][step], step, later, None if whole else first, numbers, at < 0)

    def _start(self, part: _Part, p: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Initial state and its variances: outputs that are states begin as recorded."""
        nx, n = part.library.nx, len(self.model.states)
        x0, p0 = np.zeros(nx), np.ones(nx)
        x0[:n] = self._model_start(p[: len(self.model.parameters)])
        p0[:n] = (2.0 * self.scale) ** 2
        first = _first_seen(y)
        for state, output, sign in self.shown:
            seen = first[self.outputs.index(output)]
            if not np.isnan(seen):
                x0[state] = sign * seen
        if nx > n:
            p0[n:] = self._hidden_scale(part) ** 2
        return x0, p0

    def _hidden_scale(self, part: _Part) -> np.ndarray:
        """Sizes of effects' hidden states: of what they follow, or of the motion beside which they are."""
        found = []
        for name in part.library.stepped.state_names[len(self.model.states) :]:
            port = name.split("@")[1].partition(".")[0].split("+")[0]
            sizes = self.sizes.get(port, ())
            found.append(0.1 * max(sizes) if sizes else 0.1)
        return np.array(found)

    def _model_start(self, p: np.ndarray) -> np.ndarray:
        key = p[self._started_by].tobytes()
        if self._begins is None or self._begins[0] != key:
            self._begins = key, np.asarray(self.model.x0(p)).ravel()
        return self._begins[1]

    @cached_property
    def _started_by(self) -> list[int]:
        """Parameters of the model that its start depends on."""
        p = self.model.symbols[3]
        return sorted(set(ca.jacobian_sparsity(ca.vertcat(self.model.x0(p)), p).get_col()))

    @cached_property
    def shown(self) -> list[tuple[int, str, float]]:
        """States that recorded outputs are, up to sign: (state, output, sign)."""
        x, u, m, p = self.model.symbols
        h, found, seen = self.model.h(x, u, m, p), [], set()
        for i in range(x.numel()):
            for k, name in enumerate(self.all_outputs):
                for sign in (1.0, -1.0):
                    if name in self.outputs and i not in seen and ca.is_equal(h[k], sign * x[i], 2):
                        found.append((i, name, sign))
                        seen.add(i)
        return found

    def _modes(self, record: Record) -> np.ndarray:
        if not self.model.modes:
            return np.zeros((len(record.time), 0))
        from reconcile.filter.modes import modes_of

        return modes_of(self.model, record)


def _first_seen(y: np.ndarray) -> np.ndarray:
    """Of each column of y [n, NY] the first value that is not missing, NaN where all are."""
    missing = np.isnan(y[:1])
    if missing.any():
        missing = np.isnan(y)
        return y[np.argmin(missing, axis=0), np.arange(y.shape[1])]
    return y[0]
