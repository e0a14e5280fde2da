"""Effects of a closed FMU, one after another: ranked by one linearisation, fitted, accepted by the rules."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from reconcile.closed import evidence
from reconcile.closed.candidates import candidates
from reconcile.closed.evidence import Sample
from reconcile.closed.fitted import ClosedFit, confirmed, from_nothing, names, sample
from reconcile.closed.problem import ClosedProblem
from reconcile.equations.model import Attached
from reconcile.judging.refused import Refused, refused

CLOSE = 2.0 * float(np.log(5.0))  # of twice the log-likelihood: odds of less than five do not tell apart
MOST_RIVALS = 4

LARGEST = 3  # effects in a set
REFITS = 6  # fitted of each ranking
MOST_RESTARTS, SETTLED = 8, 0.02  # of initial states; share of the cost that another would save
SMALL = 1e-2  # of an amplitude's size, for its linear gain

Key = frozenset
Report = Callable[..., None]


@dataclass
class ClosedAnswer:
    """The accepted fit, the base fit, what cannot be told from the answer, and what was turned down."""

    fitted: ClosedFit
    base: ClosedFit
    alternatives: list[ClosedFit] = field(default_factory=list)
    gains: dict[str, tuple[float, float]] = field(default_factory=dict)
    refused: list[Refused] = field(default_factory=list)
    tried: dict[Key, ClosedFit] = field(default_factory=dict)


class ClosedSearch:
    """One search; `report` is told what it does."""

    def __init__(self, problem: ClosedProblem, report: Report | None = None):
        self.problem, self.said = problem, report or (lambda *_: None)
        self.candidates = candidates(problem.box, problem.recorded, problem.free)
        self.tried: dict[Key, ClosedFit] = {}

    def run(self) -> ClosedAnswer:
        """Grow while an effect earns its place, exchange each once, and list what cannot be told from it."""
        base = self._base()
        self.tried[Key()] = base
        answer = ClosedAnswer(base, base, tried=self.tried)
        while len(answer.fitted.effects) < LARGEST and self._grow(answer):
            pass
        if answer.fitted.effects:
            self._exchange(answer)
            answer.alternatives = self._near(answer.fitted)
            for a in answer.fitted.effects:
                answer.gains[a.key] = self._worth(answer.fitted, a)
        return answer

    def _base(self) -> ClosedFit:
        """The FMU with its parameters fitted; by turns what initial states do with these is reckoned anew."""
        base = self._without({})
        for _ in range(MOST_RESTARTS if base.free else 0):
            before = base.cost
            self.problem.restart(base.values)
            base = self._without(base.values)
            if before - base.cost < SETTLED * base.cost:
                break
        return base

    def _without(self, start: Mapping[str, float]) -> ClosedFit:
        fitted = self.problem.fit((), start)
        if fitted is None:
            raise ArithmeticError("the base model cannot be fitted")
        return fitted

    # ---------------------------------------------------------------- growing

    def _grow(self, answer: ClosedAnswer) -> bool:
        """Fit the best ranked effects beside the present ones; take the best if it is accepted."""
        found = self._beside(answer.fitted)
        if not found:
            return False
        s = sample(min(found, key=lambda f: f.cost))
        best = min(found, key=lambda f: evidence.bic(f, s))
        best = self._simpler(best, found, s)
        new = next(a for a in best.effects if a not in answer.fitted.effects)
        why = self._why_not(best, answer.fitted, new)
        if why:
            answer.refused.append(refused(new, why))
            return False
        answer.fitted = best
        return True

    def _beside(self, fitted: ClosedFit) -> list[ClosedFit]:
        ranked = self._ranked(fitted)
        found = []
        for at, (a, start) in enumerate(ranked[:REFITS]):
            self.said(f"effect {len(fitted.effects) + 1}: {a.effect.name}", at, min(REFITS, len(ranked)))
            fit = self._try((*fitted.effects, a), {**fitted.values, **start})
            if fit is not None:
                found.append(fit)
        return found

    def _try(self, effects: Sequence[Attached], start: dict[str, float]) -> ClosedFit | None:
        key = Key(effects)
        fit = self.problem.fit(effects, start)
        if fit is not None and (key not in self.tried or fit.cost < self.tried[key].cost):
            self.tried[key] = fit
        return self.tried.get(key)

    def _ranked(self, fitted: ClosedFit) -> list[tuple[Attached, dict[str, float]]]:
        """Candidates by the gain of their best start, with that start."""
        found = self.problem.slopes(fitted.effects, fitted.values, fitted.free)
        if found is None:
            return []
        e, base = found
        q = np.linalg.qr(base)[0] if base.shape[1] else np.zeros((len(e), 0))
        taken = {(a.effect.name, a.port) for a in fitted.effects}
        rows = []
        for a in (a for a in self.candidates if (a.effect.name, a.port) not in taken):
            tries = [self._gain(fitted, a, k, e, q) for k in range(a.effect.grid(self._scales(a)))]
            gain, start = max(tries, key=lambda t: t[0])
            if gain > 0.5 * evidence.BIC_GAIN:
                rows.append((gain, a, start))
        rows.sort(key=lambda r: -r[0])
        return [(a, start) for _, a, start in rows]

    def _scales(self, a: Attached):
        return self.problem.sizes.scales[a.port]

    def _gain(self, fitted: ClosedFit, a: Attached, k: int, e: np.ndarray, q: np.ndarray):
        """What a start of a candidate would save of the squared errors, and the values to start from."""
        start = {a.name(n): v for n, v in a.effect.start(self._scales(a), k).items()}
        start |= self.problem.sizes.width(a)
        effects = (*fitted.effects, a)
        amplitudes = [] if a.effect.gated else [q_ for q_ in a.effect.parameters if q_.amplitude]
        sizes = {f.name: f.size for f in self.problem.sizes.free(a)}
        free = e - q @ (q.T @ e)
        reckoned = (a,) if a.effect.place == "force" else ()
        columns = []
        for p in amplitudes or [None]:
            step = SMALL * sizes[a.name(p.name)] if p else 1.0
            moved = self.problem.residual(
                effects, {**fitted.values, **start, **({a.name(p.name): step} if p else {})}, reckoned
            )
            if moved is None:
                return 0.0, start
            column = (moved - e) / step
            columns.append(column - q @ (q.T @ column))
        by = np.column_stack(columns)
        if not amplitudes:
            size = max(float(by[:, 0] @ by[:, 0]), 1e-300)
            best = -float(by[:, 0] @ free) / size
            share = float(np.clip(best, 0.0, 1.0))  # no more than wholly in
            return (2.0 * best - share) * share * size, start
        values = np.linalg.lstsq(by, -free, rcond=1e-9)[0]
        low = np.array([p.low for p in amplitudes])
        high = np.array([p.high for p in amplitudes])
        values = np.clip(values, low, high)
        left = free + by @ values
        start |= {a.name(p.name): float(v) for p, v in zip(amplitudes, values, strict=True)}
        return float(free @ free - left @ left), start

    # ---------------------------------------------------------------- rules

    def _why_not(self, fitted: ClosedFit, without: ClosedFit, a: Attached) -> str:
        """Why an effect is not accepted; "" if it is."""
        s = sample(fitted)
        gained = evidence.bic(without, s) - evidence.bic(fitted, s)
        if gained <= evidence.BIC_GAIN:
            return f"BIC gains {gained:.1f}, not more than {evidence.BIC_GAIN:g}"
        distance = from_nothing(fitted, a)
        if distance <= evidence.ERRORS:
            return f"{distance:.1f} standard errors from nothing"
        outside = confirmed(without, fitted)
        if not outside.accepted:
            return f"closes {100 * outside.closed:.0f} % of the gap on confirm"
        return ""

    def _simpler(self, best: ClosedFit, found: Sequence[ClosedFit], s: Sample) -> ClosedFit:
        """One with fewer parameters that is hardly worse."""
        limit = evidence.bic(best, s) + evidence.BIC_GAIN
        fitting = [f for f in found if len(f.free) < len(best.free) and evidence.bic(f, s) < limit]
        return min(fitting, key=lambda f: (len(f.free), f.cost), default=best)

    def _exchange(self, answer: ClosedAnswer) -> None:
        """Another effect in the place of each, where the set has several; the best set is the answer."""
        if len(answer.fitted.effects) > 1:
            for a in answer.fitted.effects:
                rest = tuple(x for x in answer.fitted.effects if x != a)
                without = self._try(rest, dict(answer.fitted.values))
                if without is not None:
                    self._beside(without)
        alike = [f for k, f in self.tried.items() if len(k) == len(answer.fitted.effects)]
        s = sample(min(alike, key=lambda f: f.cost))
        best = min(alike, key=lambda f: evidence.bic(f, s))
        if evidence.bic(best, s) < evidence.bic(answer.fitted, s) - 1.0:
            answer.fitted = self._simpler(best, alike, s)

    def _near(self, best: ClosedFit) -> list[ClosedFit]:
        """Sets of no more parameters that the recordings cannot tell from the answer."""
        s = sample(best)
        near = [
            f
            for f in self.tried.values()
            if 0 < len(f.effects) <= len(best.effects)
            and len(f.free) <= len(best.free)
            and evidence.likelihood_gain(f.cost, best.cost, s) < CLOSE
        ]
        found, named = [], {names(best)}
        for f in sorted(near, key=lambda f: f.cost):
            if names(f) not in named and len(found) < MOST_RIVALS - 1:
                named.add(names(f))
                found.append(f)
        return found

    def _worth(self, fitted: ClosedFit, a: Attached) -> tuple[float, float]:
        rest = tuple(x for x in fitted.effects if x != a)
        without = self.tried.get(Key(rest)) or self._try(rest, dict(fitted.values))
        if without is None:
            return float("inf"), 1.0
        gain = evidence.likelihood_gain(without.cost, fitted.cost, sample(fitted))
        return gain, confirmed(without, fitted).closed
