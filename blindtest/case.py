"""One hidden-effect case: a machine, its effects and runs, drawn until every effect is clearly there or not.

`draw` gives the case, `write` its folder and the sealed truth: recordings and plain model in one folder,
the truth in another, its SHA-256 with the recordings.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from blindtest import sensors
from blindtest.effects.axis import SHORTEST_S
from blindtest.effects.effect import Effect, Scale, Values, combine
from blindtest.known import least
from blindtest.likelihood import Fit, Problem, Run
from blindtest.sensors import Surroundings
from blindtest.systems.axis import absent
from blindtest.systems.drives import Driven
from blindtest.systems.kit import KITS, Kit
from blindtest.systems.system import STEP, Drive, System, Trace
from blindtest.whitening import BEGINNING, LINES, Whitening, whitening
from specs.errors import InputError, RunError, nearest

VISIBLE, INVISIBLE = 20.0, 3.0
WITHOUT_HIDDEN = 4.0  # lambda(T) of the visible effects alone: below the 5 of an equivalent
COUNTS = ((1, 0.5), (2, 0.3), (3, 0.2))
TARGETS = (60.0, 6000.0)  # lambda that visible effects are sized for
DISTRACTING = (0.05, 1.0)
ATTEMPTS = 60
TOO_SHORT_S = 1e-4  # of lags, of distractors too: steps of runs get as short, and draws as slow
ROUNDS_BEYOND = 3  # of the size of an effect outside the catalogue
LOST = 1e6  # lambda beyond which fits without an effect come to nothing that could be relied on
INPUT_DRAWS = 24  # of the noise on recorded inputs, for its covariance


@dataclass(frozen=True)
class Placed:
    """An effect of a case with its magnitude and shape."""

    effect: Effect
    magnitude: float
    shape: dict[str, float]
    target: float  # lambda that it is sized for

    def parameters(self, scale: Scale) -> Values:
        """Its parameters as the contract counts them."""
        return self.effect.size(self.magnitude, self.shape, scale)


@dataclass(frozen=True)
class Recorded:
    """One run as the workflow gets it, and what was applied."""

    kind: str
    commands: np.ndarray  # as recorded [n, inputs]
    outputs: np.ndarray  # as recorded [n, outputs]
    applied: np.ndarray


@dataclass(frozen=True)
class Case:
    """A drawn case; `placed` are the effects put in, `seen` lambda(T0 without each)."""

    seed: int
    noise: str
    kit: Kit
    system: System
    scale: Scale
    surroundings: Surroundings
    placed: tuple[Placed, ...]
    seen: tuple[float, ...]
    runs: tuple[Recorded, ...]
    problem: Problem
    truth_fit: Fit  # of the visible effects
    redrawn: int

    @property
    def visible(self) -> tuple[Effect, ...]:
        """T: the effects that the recordings show."""
        return tuple(p.effect for p, s in zip(self.placed, self.seen, strict=True) if s >= VISIBLE)


class _Redraw(Exception):
    """A draw with an effect between visible and invisible, or one that does not run or leaves its range."""


def draw(
    seed: int,
    noise: str = "low",
    system: str = "servo",
    visible: int | None = None,
    outside: bool = False,
    kit: Kit | None = None,
) -> Case:
    """The case of a seed; `visible` effects (drawn when None), `outside`: one that is not in the catalogue.

    A `kit` takes the place of the system's own (fewer effects, say).

    Raises InputError for an unknown noise or system.
    """
    if noise not in sensors.FACTOR:
        raise InputError(f"no noise '{noise}'; {nearest(noise, sensors.FACTOR)}")
    if system not in KITS:
        raise InputError(f"no system '{system}'; {nearest(system, KITS)}")
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([seed, attempt])
        try:
            return _Draft(kit or KITS[system], noise, rng, visible, outside).case(seed, attempt)
        except (_Redraw, RunError):
            continue
    raise RunError(f"seed {seed}: no clear case of {system} in {ATTEMPTS} draws")


class _Draft:
    """A case in the making."""

    def __init__(
        self, kit: Kit, noise: str, rng: np.random.Generator, visible: int | None, outside: bool
    ) -> None:
        self.kit, self.noise, self.rng = kit, noise, rng
        self.system = kit.draw(rng)
        self.drives: list[Driven] = kit.drives(self.system, rng)
        self.scale = kit.scale(self.system, self.drives)
        self.base = {b.name: b.value for b in self.system.base}
        self.surroundings = sensors.draw(
            noise, self.system.outputs, self.system.inputs, self.scale.force, rng
        )
        self.keys = rng.integers(2**31, size=len(self.drives))  # of each run's noise: the same in every round
        self.placed = self._choose(visible, outside)

    def case(self, seed: int, attempt: int) -> Case:
        """Sizes, recordings and the check that every effect is clearly visible or clearly not."""
        self._size()
        self._size_beyond()
        kept = [p for p in self.placed if p.target >= VISIBLE]
        # no lag of a fit could stand for it, and E(T) would lack that lag
        if any(p.parameters(self.scale).get("delay", np.inf) < SHORTEST_S for p in kept):
            raise _Redraw
        problem, runs = self._problem()
        if any(
            s.beyond(run.outputs[:, i]) for run in problem.runs for i, s in enumerate(self.system.outputs)
        ):
            raise _Redraw
        seen = tuple(self._lambda(problem, i).value for i in range(len(self.placed)))
        for placed, value in zip(self.placed, seen, strict=True):
            wanted = VISIBLE <= value < LOST if placed.target >= VISIBLE else value <= INVISIBLE
            if not wanted:
                raise _Redraw
        if any(self._acted(p) < VISIBLE for p in kept):
            raise _Redraw
        truth = problem.fit([p.effect for p in kept], self._start(problem, kept))
        if truth.value > WITHOUT_HIDDEN or any(self._beyond(problem, p) < VISIBLE for p in self._strangers()):
            raise _Redraw
        return Case(
            seed, self.noise, self.kit, self.system, self.scale, self.surroundings,
            tuple(self.placed), seen, tuple(runs), problem, truth, attempt,
        )  # fmt: skip

    def _strangers(self) -> list[Placed]:
        """What is placed and not in the catalogue."""
        return [p for p in self.placed if not p.effect.catalogue]

    def _size_beyond(self) -> None:
        """Scale an effect outside the catalogue by what effects of the catalogue leave of it."""
        for stranger in self._strangers():
            for _ in range(ROUNDS_BEYOND):
                left = self._beyond(self._problem()[0], stranger)
                if left > 0.5 * stranger.target:
                    break
                grown = self._grown(
                    stranger, float(np.clip(np.sqrt(stranger.target / max(left, 1e-3)), 1.0, 6.0))
                )
                self.placed = [grown if p is stranger else p for p in self.placed]
                stranger = grown

    def _beyond(self, problem: Problem, stranger: Placed) -> float:
        """Lambda that is left where effects of the catalogue stand for one outside."""
        rest = [p for p in self.placed if p is not stranger and p.target >= VISIBLE]
        at = problem.fit([p.effect for p in rest], self._start(problem, rest))
        return least(problem, [p.effect for p in rest], at, self.kit.declared(self.system), VISIBLE)

    def _choose(self, visible: int | None, outside: bool) -> list[Placed]:
        """Visible effects and distractors, no name twice."""
        rng = self.rng
        if visible is None:
            numbers, shares = zip(*COUNTS, strict=True)
            visible = int(rng.choice(numbers, p=shares))
        hidden = int(rng.integers(0, 3))
        effects, others = self.kit.effects(self.system), self.kit.outside(self.system)
        order = [effects[i] for i in rng.permutation(len(effects))]
        chosen: list[Effect] = [others[rng.integers(len(others))]] if outside else []
        for effect in order:
            fits = not effect.as_it_is or len(chosen) < visible  # nature's sizes make no distractors
            if len(chosen) < visible + hidden and effect.name not in {e.name for e in chosen} and fits:
                chosen.append(effect)
        return [self._place(e, visible=i < visible) for i, e in enumerate(chosen[: visible + hidden])]

    def _place(self, effect: Effect, visible: bool) -> Placed:
        low, high = TARGETS if visible else DISTRACTING
        target = float(np.exp(self.rng.uniform(np.log(low), np.log(high))))
        sign = float(self.rng.choice([-1.0, 1.0])) if effect.either_sign else 1.0
        magnitude = sign * effect.largest * (0.1 if visible else 0.005)
        magnitude = 1.0 if effect.as_it_is else magnitude
        return Placed(effect, magnitude, dict(effect.shape(self.rng)), target)

    def _size(self, rounds: int = 5) -> None:
        """Scale each effect towards its target: lambda grows about with the square of the magnitude."""
        whitenings: list[Whitening] | None = None
        for k in range(rounds if self.placed else 0):
            problem, _ = self._problem(whitenings)
            whitenings = [run.whiten for run in problem.runs]  # good enough while sizes are sought
            ratios = [p.target / max(self._linear(problem, i), 1e-9) for i, p in enumerate(self.placed)]
            steps = np.clip(np.sqrt(ratios), 0.1, 6.0)
            self.placed = [self._grown(p, s) for p, s in zip(self.placed, steps, strict=True)]
            if any(p.parameters(self.scale).get("lag", np.inf) < TOO_SHORT_S for p in self.placed):
                raise _Redraw
            if np.all(np.abs(np.log(ratios)) < 0.5) and k:
                return

    @staticmethod
    def _grown(placed: Placed, factor: float) -> Placed:
        if placed.effect.as_it_is:
            return placed
        size = min(abs(placed.magnitude) * factor, placed.effect.largest)
        return replace(placed, magnitude=float(np.copysign(size, placed.magnitude)))

    def _values(self, placed: Sequence[Placed]) -> Values:
        parts = [p.effect.enter(p.parameters(self.scale), self.scale) for p in placed]
        return self.base | combine(parts, absent())

    def _run(self, number: int) -> tuple[Trace, np.random.Generator]:
        """The run as it happens: disturbed, and noisy where a controller feels it."""
        drive, start = self.drives[number]
        rng = np.random.default_rng(int(self.keys[number]))
        noise, disturbance = self._surprises(len(drive.commands), rng)
        return self.system.simulate(self._values(self.placed), drive, start, disturbance, noise), rng

    def _surprises(self, samples: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Noise of the outputs [samples, outputs] and disturbance of a run."""
        noise = self.surroundings.outputs * rng.standard_normal((samples, len(self.system.outputs)))
        return noise, self.surroundings.disturb(samples, rng, self.system.disturbances)

    def _acted(self, placed: Placed) -> float:
        """Half the squared difference, in deviations of the sensors, that an effect made to the runs.

        Disturbed, a machine may never come to a stop that it would have met.
        """
        without, found = [p for p in self.placed if p is not placed], 0.0
        for number, (drive, start) in enumerate(self.drives):
            replay = Drive(self._run(number)[0].commands, kind=drive.kind)
            pushed = self._surprises(len(drive.commands), np.random.default_rng(int(self.keys[number])))[1]
            made = [
                self.system.simulate(self._values(x), replay, start, pushed) for x in (self.placed, without)
            ]
            moved = (made[0].outputs - made[1].outputs)[BEGINNING:] / self.surroundings.outputs
            found += 0.5 * float(np.sum(moved**2))
        return found

    def _problem(self, known: list[Whitening] | None = None) -> tuple[Problem, list[Recorded]]:
        """Noise-free replays of the applied commands, and the recordings; with `known` whitenings."""
        values, runs, recorded = self._values(self.placed), [], []
        for number, (drive, start) in enumerate(self.drives):
            trace, rng = self._run(number)
            replay = Drive(trace.commands, kind=drive.kind)
            clean = self.system.simulate(values, replay, start).outputs
            whiten = known[number] if known else self._whitening(values, replay, start, clean)
            runs.append(Run(replay, start, clean, whiten, np.full(self.system.starts, 1e-2)))
            noisy = trace.commands + self.surroundings.inputs * rng.standard_normal(trace.commands.shape)
            measured = self.surroundings.measure(trace.outputs, rng)
            recorded.append(Recorded(drive.kind, noisy, measured, trace.commands))
        free = tuple(b.name for b in self.system.base if not b.known)
        return Problem(self.system, self.scale, runs, dict(self.base), free), recorded

    def _whitening(self, values: Values, drive: Drive, start: np.ndarray, clean: np.ndarray) -> Whitening:
        rates = np.sqrt(np.mean(np.gradient(clean, STEP, axis=0) ** 2, axis=0))
        deviation = self.surroundings.output_deviation(rates)
        samples, small = len(clean), 1e-3 * self.scale.force

        def response(shape: np.ndarray, which: int) -> np.ndarray:
            push = np.zeros((samples, self.system.disturbances))
            push[:, which] = small * shape
            push = push[:, 0] if self.system.disturbances == 1 else push
            return (self.system.simulate(values, drive, start, push).outputs - clean) / small

        responses = [partial(response, which=i) for i in range(self.system.disturbances)]
        spectrum = self.surroundings.disturbance_spectrum(samples, LINES)
        return whitening(deviation, responses, spectrum, self._shaken(values, drive, start, clean))

    def _shaken(self, values: Values, drive: Drive, start: np.ndarray, clean: np.ndarray) -> list[np.ndarray]:
        """What the noise on recorded inputs does to a replay: some draws, each a share of the covariance."""
        rng = np.random.default_rng(int(self.keys[0]))
        found = []
        for _ in range(INPUT_DRAWS):
            noise = self.surroundings.inputs * rng.standard_normal(drive.commands.shape)
            shaken = self.system.simulate(values, Drive(drive.commands + noise), start).outputs
            found.append((shaken - clean) / np.sqrt(INPUT_DRAWS))
        return found

    def _start(self, problem: Problem, placed: Sequence[Placed]) -> Fit:
        known = {p.effect.key: p.parameters(self.scale) for p in placed}
        return problem.start([p.effect for p in placed], known)

    def _without(self, i: int) -> list[Placed]:
        return [p for j, p in enumerate(self.placed) if j != i]

    def _lambda(self, problem: Problem, i: int) -> Fit:
        kept = self._without(i)
        return problem.fit([p.effect for p in kept], self._start(problem, kept))

    def _linear(self, problem: Problem, i: int) -> float:
        """lambda(T0 without i) with the fit's step linearised."""
        kept = self._without(i)
        tangent, left = problem.tangent([p.effect for p in kept], self._start(problem, kept))
        rest = left - tangent @ (tangent.T @ left)
        return 0.5 * float(rest @ rest)
