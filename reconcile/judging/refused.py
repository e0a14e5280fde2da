"""Effects that are likely and are not named all the same, each with its reason."""

from collections.abc import Iterable
from dataclasses import dataclass

from reconcile.equations.model import Attached

HARDLY = 5e-3  # of the error ahead: what changes it by less does not show there
MANY = 10.0  # times, beyond which no figure tells more


@dataclass(frozen=True)
class Refused:
    """An effect with its reason; `denied`: nor can another effect of its kind be meant."""

    effect: str
    port: str
    because: str
    denied: bool = False


def refused(a: Attached, because: str, denied: bool = False) -> Refused:
    """An effect that is turned down."""
    return Refused(a.effect.name, a.port, because, denied)


def all_of(effects: Iterable[Attached], because: str) -> list[Refused]:
    """Effects of a set that is turned down as a whole."""
    return [refused(a, because) for a in effects]


def no_shaft(a: Attached) -> Refused:
    """A shaft that is none."""
    return refused(a, "one of its ends has hardly any inertia", denied=True)


def hardly_ahead(a: Attached, share: float) -> Refused:
    """An effect that takes too small a `share` of the error ahead away."""
    if abs(share) < HARDLY:
        return refused(a, "it hardly shows in data that it was not fitted to")
    if share < 0.0:
        larger = f"{100 * -share:.1f} % larger" if share > -MANY else "many times as large"
        return refused(a, f"it makes the error ahead {larger}, on data it was not fitted to", denied=True)
    return refused(a, f"takes {100 * share:.1f} % of the error ahead away, on data it was not fitted to")
