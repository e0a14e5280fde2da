"""Sets with another effect in an effect's place: kin, twins, what an effect becomes in a limit."""

from reconcile.catalogue.kinds import kind
from reconcile.equations.model import Attached
from reconcile.filter.kalman import Values
from reconcile.search.screen import Scored
from reconcile.search.sets import BEHIND, Key, Sets

KIN = 4  # effects of the same kind that take an effect's place


class Swaps:
    """Fits sets with one effect in another one's place, each pair once."""

    def __init__(self, sets: Sets):
        self.sets = sets
        self._tried: set[tuple[Key, Key]] = set()
        self._kin: dict[Key, set[Attached]] = {}  # what took an effect's place beside a set

    def kin(self, key: Key, a: Attached) -> list[Key]:
        """Sets with another effect of the same kind in an effect's place, from the same values.

        A score from the model without either is blind to that where the effect is large.
        """
        less = key - {a}
        if less not in self.sets.points:
            return []
        forms: dict[tuple[str, str], list[Scored]] = {}
        for s in self.alike(less, a):
            forms.setdefault((s.attached.effect.name, s.attached.port), []).append(s)
        # of every effect its best form and its simplest one: a form with more to fit may score more, and fail
        simplest = [min(own, key=lambda s: len(s.attached.effect.parameters)) for own in forms.values()]
        tried = [s for own, plain in zip(forms.values(), simplest, strict=True) for s in (own[0], plain)]
        todo = {s.attached: s for s in tried[: 2 * KIN]}
        # from the values of one of them is enough: the best of a kind may change several times
        done = self._kin.setdefault(less, set())
        for b, scored in todo.items():
            if b not in done:
                self._in_place(key, a, scored)
        done |= {a, *todo}
        return [less | {b} for b in todo]

    def twins(self, key: Key, a: Attached) -> list[Key]:
        """Sets with one of the same units in an effect's place, whatever its score: a kin, or at its port.

        A delay of the only input is one of all outputs, and its own score may see a local optimum.  So may
        that of what has a kink: dry friction of what turns one way only is a load, a dead zone an offset.
        """
        units = [q.unit for q in a.effect.parameters]
        return [
            self._in_place(key, a, _unscored(b))
            for b in self.sets.beside(key)
            if (kind(b.effect.name) == kind(a.effect.name) or (b.port == a.port and _kinked(b)))
            and b.effect.name != a.effect.name
            and [q.unit for q in b.effect.parameters] == units
            and self.sets.core.reach.common(a, b)
        ]

    def alike(self, key: Key, a: Attached) -> list[Scored]:
        """Scores beside a set of effects of an effect's kind that move an output which it moves.

        All of them: one that gained nothing at first may be the right one beside others.
        """
        own, reach = kind(a.effect.name), self.sets.core.reach
        alike = [b for b in self.sets.beside(key) if kind(b.effect.name) == own and reach.common(a, b)]
        return self.sets.scores_of(key, alike)

    def _in_place(self, key: Key, a: Attached, scored: Scored) -> Key:
        """The set with another effect in an effect's place, fitted from its values, once."""
        other, point = scored.attached, self.sets.points[key]
        rest = tuple(x for x in point.present if x != a)
        grown = frozenset({*rest, other})
        if other != a and (key, grown) not in self._tried and not self.sets.spent():
            self._tried.add((key, grown))
            same = self._same(a, other, point.values) or self._by_itself(a, other)
            less = self.sets.points.get(key - {a})
            own = scored.own | same
            start = self.sets.core.values | self.sets.of(key, rest) | own
            if less is not None and not same:  # what the score says holds beside what is left
                start, point = less.values | scored.values, less
            most = self.sets.points[key].total + BEHIND
            self.sets.fit(grown, (*rest, other), [start], fresh=own, near=point, most=most)
        return grown

    def _same(self, a: Attached, other: Attached, values: Values) -> Values:
        """An effect's values as another one's parameters: by name or unit, one amplitude by its size."""
        own, wanted = a.effect.parameters, other.effect.parameters
        units = {p.name: p.unit for p in own}
        if all(units.get(q.name) == q.unit for q in wanted):
            return {other.name(q.name): values[a.name(q.name)] for q in wanted}
        if len(own) == len(wanted) == 1 and own[0].amplitude and wanted[0].amplitude:
            size, wanted_size = (self.sets.core.free_of(b)[0].size for b in (a, other))
            return {other.name(wanted[0].name): values[a.name(own[0].name)] * wanted_size / size}
        left, found = list(own), {}
        for q in wanted:
            twin = next((p for p in left if p.unit == q.unit), None)
            if twin is not None:
                left.remove(twin)
                found[other.name(q.name)] = values[a.name(twin.name)]
        whole = not left or other.effect.name in a.effect.becomes  # a simpler one has fewer
        return found if len(found) == len(wanted) and whole else {}

    def _by_itself(self, a: Attached, other: Attached) -> Values:
        """The values that what an effect becomes in a limit has alone, where that was fitted."""
        alone = self.sets.points.get(frozenset({other}))
        if alone is None or other.effect.name not in a.effect.becomes:
            return {}
        return {n: alone.values[n] for n in (other.name(q.name) for q in other.effect.parameters)}

    def simpler(self, key: Key, a: Attached) -> Key | None:
        """The set with what an effect becomes in a limit in its place."""
        less = key - {a}
        limits = [b for b in self.sets.beside(less) if b.effect.name in a.effect.becomes and b.port == a.port]
        found = self.sets.scores_of(less, limits) if less in self.sets.points else []
        plain = [_unscored(b) for b in sorted(limits, key=lambda b: len(b.effect.parameters))]
        return self._in_place(key, a, [*found, *plain][0]) if limits else None


def _kinked(a: Attached) -> bool:
    return a.effect.dry or a.effect.gated


def _unscored(a: Attached) -> Scored:
    return Scored(a, 0.0, {a.name("gate"): 1.0} if a.effect.gated else {})
