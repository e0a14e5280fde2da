"""Which effects of a set earn their place: on the data they were fitted to, and on what was held back."""

from typing import TYPE_CHECKING

from reconcile import evidence
from reconcile.fit.solve import Fitted
from reconcile.model import Attached
from reconcile.rivals import Key

if TYPE_CHECKING:
    from reconcile.search import Search

Present = tuple[Attached, ...]


class Acceptance:
    """The acceptance of a search's sets; what is turned down goes into the search's list."""

    def __init__(self, search: "Search"):
        self.search, self.study = search, search.study
        self.known: dict[str, tuple[float, float]] = {}  # gains by key of an effect

    def confirmed(self, present: Present) -> Present:
        """Take out effects one by one that do not earn their place, on confirm too."""
        return self._earned(present, again=False)

    def earning(self, present: Present) -> Present:
        """The same once confirm is fitted to as well, of rivals too."""
        return self._earned(present, again=True)

    def _earned(self, present: Present, again: bool) -> Present:
        """Less the effects that do not earn their place, the least first."""
        while present:
            if not again:
                self.search.report(f"confirming {len(present)}")
            judged = [(a, *self._judge(present, a, again)) for a in present]
            failing = [(a, margin, why) for a, margin, why in judged if why]
            if not failing:
                break
            a, _, why = min(failing, key=lambda j: j[1])
            present = self._less(present, a, why)
        return present

    def gains(self, present: Present, a: Attached) -> tuple[float, float]:
        """Of an effect: gained in twice the log-likelihood, and the share of the gap closed on confirm."""
        if a.key not in self.known:
            fitted, without = self._fit(present), self._without(present, a)
            self.known[a.key] = _gains(fitted, without, self._on_confirm(without, fitted))
        return self.known[a.key]

    def _judge(self, present: Present, a: Attached, again: bool) -> tuple[float, str]:
        """How far an effect pays in the set, and why not if it does not.

        `again`: confirm is fitted to as well, and asked only where so much is left that gains are no proof.
        """
        fitted, without = self._fit(present), self._without(present, a)
        gained = self._pays(present, without)
        if gained <= evidence.BIC_GAIN:
            return gained, f"BIC gains {gained:.1f}, not more than {evidence.BIC_GAIN:g}"
        sure = gained > evidence.OVERWHELMING
        distance = evidence.from_nothing(self.study, fitted, a)
        # of two parameters that make up for each other either may be uncertain: then the likelihood counts
        if distance <= evidence.ERRORS and not (sure and (again or len(a.free) > 1)):
            return gained, f"{distance:.1f} standard errors from nothing"
        if again and not evidence.lost(fitted):
            return gained, ""
        self.known.pop(a.key, None)
        outside = self._on_confirm(without, fitted)
        if outside is None or not self._borne_out(fitted, outside, sure):
            share = 0.0 if outside is None else outside.closed
            return gained, f"closes {100 * share:.0f} % of the gap on confirm"
        self.known[a.key] = _gains(fitted, without, outside)
        return gained, ""

    def _borne_out(self, fitted: Fitted, outside: evidence.Confirmed, sure: bool) -> bool:
        """Whether confirm bears an effect out, or shows too little to judge and all else speaks for it.

        Where far more is left than noise, what a set gains is no proof: something else is at work.
        """
        if evidence.lost(fitted):
            return outside.closes
        return outside.accepted or (sure and outside.silent)

    def _fit(self, present: Present) -> Fitted:
        return self.search.tried.fits[Key(present)]

    def _pays(self, present: Present, without: Fitted) -> float:
        """What the set gains, of BIC, over one with an effect less."""
        fitted = self._fit(present)
        s = evidence.sample(fitted)
        return evidence.bic(without, s) - evidence.bic(fitted, s)

    def _without(self, present: Present, a: Attached) -> Fitted:
        """The best fit of the set less one effect: as known, or from where the set's own fit ended."""
        fitted, rest = self._fit(present), tuple(x for x in present if x != a)
        known = self.search.tried.fits.get(Key(rest))
        if known is None:
            return self.search.sharp(rest, fitted)
        again = self.study.fit_set(fitted.point, rest, {}, near=True)
        if again is not None and again.cost < known.cost:
            self.search.tried.fits[Key(rest)] = known = again
        return known

    def _less(self, present: Present, a: Attached, why: str) -> Present:
        """The set less an effect, which is turned down."""
        refused = {"effect": a.effect.name, "port": a.port, "because": why}
        self.search.tried.refused.append(refused)
        return tuple(x for x in present if x != a)

    def _on_confirm(self, without: Fitted, with_it: Fitted) -> evidence.Confirmed | None:
        before, after = (self.study.elsewhere(f, "confirm") for f in (without, with_it))
        if after is None:
            return None
        if before is None:
            return evidence.Confirmed(1.0, float("inf"))
        return evidence.confirm(before, after, evidence.count_of(after))


def _gains(fitted: Fitted, without: Fitted, outside: evidence.Confirmed | None) -> tuple[float, float]:
    gained = evidence.likelihood_gain(without.cost, fitted.cost, evidence.sample(fitted))
    return gained, 0.0 if outside is None else outside.closed
