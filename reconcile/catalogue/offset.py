"""An offset in time of outputs: no effect of the machine, so that it is in no list of effects."""

from reconcile.catalogue.effect import Effect, Parameter, none

NAME = "time_offset"
EARLIEST = 1.6  # samples, a little above 1.5


def effect(period_s: float) -> Effect:
    """Outputs early, by so many samples of a period at most: those that are late have a delay."""
    delay = Parameter("delay", "s", none, amplitude=True, low=-EARLIEST * period_s, high=0.0)
    return Effect(NAME, "output", "y'(t) = y(t − delay)", (delay,), None, "", delays=True)
