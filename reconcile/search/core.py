"""The core's ground: one folder, its recordings, the filter, and sizes of everything that is fitted."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from reconcile import words
from reconcile.catalogue import ALL, Effect, Scales, freeform
from reconcile.catalogue.offset import NAME as OFFSET
from reconcile.equations.model import Attached, Folder, candidates
from reconcile.equations.reach import Reach
from reconcile.filter.fit import Fitter
from reconcile.filter.kalman import CORRELATED, CREEP, NOISE, NOISES, SIGMA, TAU, WHITE, Kalman, Values
from reconcile.filter.point import Free, Point
from reconcile.filter.record import Record, records
from reconcile.recordings import ends
from reconcile.recordings.data import Parts, Run, still
from reconcile.search.free import FreeParameters, stated
from reconcile.search.sizes import Floor, Sizes
from reconcile.tolerances import MOST_SAMPLES, OUTPUT_FLOOR
from specs.errors import InputError

STEPPED = 0.03  # deviations by which innovations may depend on the filter's own steps
STEPPED_NATS = 5.0  # the same of all nats: an effect that stands for errors of the steps would gain as much …
OF_SAMPLES = 1e-3  # … or of so many by sample, where there are more of them
MOST_SUBSTEPS = 32  # of a step
BEGUN, BEGUN_SHARE = 8, 0.02  # samples, beside one a state, that are not scored; at most that share of a run
QUIET = 0.2  # of the noise of the motion, from which fits begin as well
# of an axis's speed, by which dry friction gives way at standstill: least, usual, and what no friction does
CREEPS = (1e-7, 3e-4, 0.1)
LOUDER = 3.0  # times the disturbance of the model without effects: a fit on its way may need more than that
# effects that show only in a signal that does that
SHOWN_BY = {
    "absolute_value_sensor": ends.turns_at_nothing,
    "sensor_backlash": ends.turns_round,
    "input_backlash": ends.turns_round,
}
OF_MEMORY = 0.5  # of the time in which the outputs forget, that their noise may last
CLOSING = 0.1  # of a gear's gap, over which it closes: where it closes at once, fits do not find its gap
# times in which the outputs forget, that a disturbance may remember: where what is missing is looked at, and
# where effects are looked for, since one that remembers long takes over what is constant
SHOWN_MEMORY, FITTED_MEMORY = 30.0, 4.0


class Core:
    """A folder against its recordings."""

    def __init__(
        self,
        folder: Folder,
        parts: Parts,
        catalogue: Sequence[Effect] = ALL,
        floor: float = OUTPUT_FLOOR,
        correlated: bool = False,
    ):
        """`correlated`: noise of the outputs may have a memory."""
        self.catalogue = catalogue
        self.share = floor  # of an output's spread: its least noise
        self.folder, self.model, self.parts = folder, folder.model, parts
        blocks = {"fit": parts.fit, "confirm": parts.confirm, "holdout": parts.holdout}
        runs = unique([b.run for own in blocks.values() for b in own])
        recorded = set.intersection(*({*r.inputs, *r.outputs} for r in runs))
        self.still = still(runs, [n for n in folder.ports.outputs if n in recorded])
        recorded -= self.still
        units = {v.name: v.unit for v in self.model.outputs}
        recorded -= {n for n in units if n in recorded and units[n] in ("", "1") and _switches(runs, n)}
        self.outputs = [n for n in folder.ports.outputs if n in recorded]
        if not self.outputs:
            raise InputError(
                f"the recordings hold no output of {self.model.name} that varies{_still(self.still, runs)}"
            )
        constant = still(runs, [v.name for v in self.model.inputs])
        found = candidates(folder, sorted(recorded), (*catalogue, *freeform.FORMS), constant=constant)
        found = [a for a in found if _shows(a, runs)]
        self.candidates = [a for a in found if not a.effect.over]
        self.curves = [a for a in found if a.effect.over]
        self.records = records(runs, blocks, MOST_SAMPLES)
        self.runs = runs
        lasting = self.outputs if correlated else ()
        self.kalman = Kalman(folder, found, self.records, self.outputs, lasting)
        self.scored = {
            w: [getattr(r, w) & (np.arange(len(r.time)) >= self._begun(r)) for r in self.records]
            for w in blocks
        }
        self.fitter = Fitter(self.kalman, self.scored["fit"])
        self.period = self.fitter.period
        self.sizes = Sizes(self.kalman, runs, self.period)
        self.spread, self.memory_s = self.sizes.spread, self.sizes.memory_s
        self.kalman.scale = self.sizes.states()
        self.scales: dict[str, Scales] = {}
        # by another reading of the recordings: error ahead and fit of the model without effects
        self.turned: dict[Any, tuple[float, Point] | None] = {}
        self.slow: Point | None = None  # the base model with little noise, as slow motion has it
        self.alone: list[Point] | None = None  # the base model by its output error (alone.py), once asked for
        self.shown: Point  # the base model whose disturbance holds all that is missing, what is constant too
        self.values = self._first_values()
        noise = {n: v for n, v in self.values.items() if n.startswith(NOISES)}
        self.little = noise | {n: QUIET * v for n, v in noise.items() if n.startswith((SIGMA, WHITE))}
        self._choose_substeps()
        self.settle()

    def _begun(self, record: Record) -> int:
        """Samples of a recording in which the filter learns where it is, effects' hidden states among it."""
        return len(self.model.states) + min(BEGUN, int(BEGUN_SHARE * len(record.time)))

    @property
    def offset(self) -> Attached | None:
        """The candidate of an offset in time of all outputs, if there is one."""
        holds, found = self.folder.ports.holds, (a for a in self.candidates if a.effect.name == OFFSET)
        return next((a for a in found if holds(a.port, self.outputs)), None)

    @cached_property
    def reach(self) -> Reach:
        """Which outputs an effect can move."""
        return Reach(self.folder, self.outputs)

    # ---------------------------------------------------------------- sizes

    def _first_values(self) -> Values:
        """All effects absent, noise by what the recordings show, disturbances of a tenth of the motion."""
        kalman = self.kalman
        values = kalman.whole.base_start() | self._absent()
        for k, place in enumerate(kalman.places):
            size, tau = self._force(k)
            values |= {
                SIGMA + place: 0.1 * size,
                TAU + place: tau,
                WHITE + place: 1e-3 * size * np.sqrt(self.period),
            }
        self.floor = {n: self.share * self.spread[n] for n in self.outputs}
        for n in self.outputs:
            self.floor[n] = max(self.floor[n], self.sizes.step[n] / np.sqrt(12.0))
            values[NOISE + n] = max(self.sizes.noise(n), self.floor[n])
        for n in kalman.correlated:
            values |= {SIGMA + CORRELATED + n: values[NOISE + n], TAU + CORRELATED + n: 5.0 * self.period}
        self.fitter.noise = np.array([values[NOISE + n] for n in self.outputs])
        return values

    def _force(self, k: int) -> tuple[float, float]:
        """Size of a force at a place, and the time over which the motion there forgets."""
        axes = self.folder.ports.axes
        if k < len(axes):
            v = self.kalman.scale[self.model.index("states", axes[k].velocity)]
            return float(self.kalman.whole.inertia(axes[k]) * v / self.memory_s), self.memory_s
        state = self.model.index("states", self.kalman.pushed_states[k - len(axes)])
        return float(self.kalman.scale[state] / self.memory_s), self.memory_s

    def _choose_substeps(self) -> None:
        """Fewest substeps of which twice as many change the innovations by little of their deviation."""
        if self.model.kind == "discrete":
            self.kalman.substeps = max(1, round(self.period / self.model.step))
            return
        before = None
        for n in (2**k for k in range(MOST_SUBSTEPS.bit_length())):
            self.kalman.substeps = n
            found = self.fitter.innovations(self.values, ())
            if found and before:
                moved = np.nanmedian(np.abs(found[0] - before[0]) / np.sqrt(found[1]))
                nats = np.sum(self.fitter.loss(*found)) - np.sum(self.fitter.loss(*before))
                if moved < STEPPED and abs(nats) < max(STEPPED_NATS, OF_SAMPLES * len(found[0])):
                    self.kalman.substeps = n // 2
                    return
            before = found

    @property
    def shows_all(self) -> bool:
        """Whether every state of the model is recorded: none of it is hidden at first."""
        return len(self.kalman.shown) == len(self.model.states)

    @property
    def floors(self) -> dict[str, Floor]:
        """Noise of every output, as its sensor or the recording has it."""
        return self.sizes.floors

    def mean(self, output: str) -> float:
        """Of what the recordings show of an output."""
        return float(np.nanmean(self.sizes.values(output)))

    def force_size(self, place: str) -> float:
        """Size of what moves a place, in the unit of its disturbance."""
        if place in self.scales:
            return self.scales[place].f
        return self._force(self.kalman.places.index(place))[0]

    def disturbances(self, values: Values) -> dict[str, float]:
        """By place the size of the disturbance, as a share of the forces there."""
        return {p: values[SIGMA + p] / self.force_size(p) for p in self.kalman.places}

    def noise(self, values: Values, output: str) -> float:
        """Deviation of an output's noise, with what of it has a memory."""
        return float(np.hypot(values[NOISE + output], values.get(SIGMA + CORRELATED + output, 0.0)))

    @property
    def fresh(self) -> Values:
        """The model as it came, without effects and with little noise."""
        return self.values | self.little | {v.name: v.start for v in self.model.parameters}

    @property
    def slowly(self) -> Values:
        """The same where slow motion was fitted: before a disturbance takes up what effects do."""
        moved = {f.name: self.slow.values[f.name] for f in self.slow.free} if self.slow else {}
        return self.fresh | moved

    def nominal(self, found: Point | None = None) -> Point:
        """The model as it came, with the noise that was found: that of the base fit, or of another."""
        values = (found or self.base).values | {v.name: v.start for v in self.model.parameters}
        return replace(self.base, values=values, present=())

    def known(self, point: Point) -> dict[str, float]:
        """By base parameter the deviation that the recordings leave it, as a share of its prior's."""
        size = np.sqrt(np.maximum(np.diag(point.covariance()), 0.0))
        found = {f.name: float(s) for f, s in zip(point.free, size, strict=True)}
        well = {v.name for v in self.model.parameters if stated(v)}  # known well enough without
        return {f.name: found[f.name] for f in self.base_free if f.name not in well}

    def strain(self, point: Point) -> float:
        """Nats that parameters cost which lie beside what the model states of them."""
        well = {v.name for v in self.model.parameters if stated(v)}
        return 0.5 * sum(f.coordinate(point.values[f.name]) ** 2 for f in self.base_free if f.name in well)

    def settle(self) -> None:
        """Scales, and the fit of the base model with its noise, one after the other, twice."""
        for first in (True, False):
            self._measure()
            self.noise_free = self._noise_free(SHOWN_MEMORY if first else FITTED_MEMORY)
            self.base_free = self._free.of_base()
            self.base = self._base_fit(first)
            self.values = self.base.values
            if first:  # with the noise that was found, smaller errors of a step show
                self.shown = self.base
                self._choose_substeps()
        self.noise_free = [self._no_louder(f) for f in self.noise_free]

    def _no_louder(self, f: Free) -> Free:
        """Noise of a set of effects: what explains something leaves no larger disturbance than there was."""
        if not f.name.startswith((SIGMA, WHITE)):
            return f
        return replace(f, high=min(f.high, LOUDER * self.base.values[f.name]))

    def _base_fit(self, first: bool) -> Point:
        """The model without effects: from where it is, and at `first` from slow motion too."""
        free = [*self.base_free, *self.noise_free]
        points = [self.fitter.fit(self.values, (), free, 25, own=True, every=2)]
        self.slow = self.fitter.fit(self.slowly, (), self.base_free, 25, own=True)
        if first:
            points.append(self.fitter.fit(self.slowly, (), free, 25, own=True, every=2))
        found = [p for p in points if p is not None]
        if not found and self.model.kind == "continuous" and self.kalman.substeps < MOST_SUBSTEPS:
            self.kalman.substeps *= 2
            return self._base_fit(first)
        if not found:
            raise InputError(self._runs_away())
        return min(found, key=lambda p: p.total)

    def _runs_away(self) -> str:
        return (
            f"model {self.model.name} runs away on the recordings from its start parameters: is it stable, "
            "and are the recordings in its units?"
        )

    def _measure(self) -> None:
        """Scales at all ports from the filtered states; widths of kinks and shapes of effects follow."""
        run = self.kalman.run(self.values, (), states=True)
        if run is None:
            raise InputError(self._runs_away())
        self.scales = found = self.sizes.scales(run)
        self.kalman.sizes = {
            n: (s.u, s.y) if n in self.outputs or n in [v.name for v in self.model.inputs] else (s.q, s.v)
            for n, s in found.items()
        }
        self.values |= self._absent()

    def _absent(self) -> Values:
        """All effects absent: amplitudes and gates at nothing, shapes at their first start."""
        values: Values = {}
        for a in (*self.candidates, *self.curves):
            s = self.scales.get(a.port, Scales(period_s=self.period, memory_s=self.memory_s))
            values |= {a.name(n): v for n, v in a.effect.start(s, 0).items()}
            values |= {a.name(q.name): 0.0 for q in a.effect.amplitudes}
            if a.effect.gated:
                values[a.name("gate")] = 0.0
            if a.effect.width:
                values[a.name("width")] = _width(a, s)
            if a.effect.over:
                values[a.name("middle")], values[a.name("spacing")] = freeform.grid(a.effect, s)
        for axis in self.folder.ports.axes:
            values[CREEP + axis.name] = CREEPS[1] * self._speed(axis.name)
        return values

    def _speed(self, axis: str) -> float:
        return self.scales[axis].v if axis in self.scales else 1.0

    # ---------------------------------------------------------------- what is fitted

    def _noise_free(self, memory: float) -> list[Free]:
        found = []
        for k, place in enumerate(self.kalman.places):
            size, tau = self._force(k)
            if place in self.scales:
                size = self.scales[place].f
            found += [
                Free(SIGMA + place, 0.1 * size, 1.5, True, 1e-4 * size, 30.0 * size),
                Free(TAU + place, tau, 1.0, True, 2.0 * self.period, memory * max(tau, self.period)),
                Free(
                    WHITE + place,
                    0.02 * size * np.sqrt(self.period),
                    2.0,
                    True,
                    1e-5 * size * np.sqrt(self.period),
                    size * np.sqrt(self.period),
                ),
            ]
        for n in self.outputs:
            start = max(self.values[NOISE + n], self.floor[n])
            found.append(Free(NOISE + n, start, 1.0, True, self.floor[n], self.spread[n]))
        for n in self.kalman.correlated:  # shorter than the motion's memory, else it takes up what effects do
            size, least = self.values[NOISE + n], 2.0 * self.period
            longest = max(OF_MEMORY * self.memory_s, 4.0 * least)
            found += [
                Free(SIGMA + CORRELATED + n, size, 1.5, True, 0.01 * size, self.spread[n]),
                Free(TAU + CORRELATED + n, 5.0 * self.period, 1.0, True, least, longest),
            ]
        return found

    def free_of(self, *effects: Attached) -> list[Free]:
        """Effects' parameters as they are fitted, and how far the dry friction among them gives way."""
        found = [f for a in effects for f in self._free.of_effect(a, self.scales)]
        for axis in dict.fromkeys(
            a.port for a in effects if a.effect.dry and self.model.kind == "continuous"
        ):
            least, usual, most = (c * self._speed(axis) for c in CREEPS)
            found.append(Free(CREEP + axis, usual, 4.0, True, least, most, scaleless=True))
        return found

    @cached_property
    def _free(self) -> FreeParameters:
        return FreeParameters(self.folder, self.sizes.duration_s, self.memory_s)


def unique(runs: Sequence[Run]) -> list[Run]:
    """Each run once, in order."""
    return list({id(r): r for r in runs}.values())


def _shows(a: Attached, runs: Sequence[Run]) -> bool:
    """Whether an effect may show in some run, by the signal where it acts."""
    asked = SHOWN_BY.get(a.effect.name)
    signals = [s for r in runs if (s := r.outputs.get(a.port) or r.inputs.get(a.port))]
    return asked is None or any(asked(s.values) for s in signals)


def _switches(runs: Sequence[Run], name: str) -> bool:
    return all(np.isin(r.outputs[name].values, (0.0, 1.0)).all() for r in runs if name in r.outputs)


def _width(a: Attached, s: Scales) -> float:
    sizes = {"u": s.u, "v": s.v, "q": s.q, "y": s.y}
    if a.effect.width == "time":
        return 0.01 * s.period_s
    if a.effect.width == "gap":
        return CLOSING
    return 3e-3 * sizes[a.effect.width or "u"]


def _still(outputs: Collection[str], runs: Sequence[Run]) -> str:
    """Which outputs keep one value, and which inputs may have been taken for outputs."""
    driven = {n for r in runs for n in r.inputs}
    moving = words.listed(sorted(driven - still(runs, driven)))
    kept = f": {words.listed(sorted(outputs))} at one value all the time" if outputs else ""
    return f"{kept}, {moving} not; are their columns exchanged?" if kept and moving else kept
