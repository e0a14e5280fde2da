"""An offset in time of outputs: no effect of the machine, so that it is in no list of effects."""

from reconcile.catalogue.effect import Effect, Parameter, none

NAME = "time_offset"
EARLIEST, LATEST = 1.6, 0.6  # samples, a little above 1.5 and 0.5: what is later is a delay


def effect(period_s: float) -> Effect:
    """Outputs early or late, by so many samples of a period at most."""
    low, high = -EARLIEST * period_s, LATEST * period_s
    delay = Parameter("delay", "s", none, amplitude=True, low=low, high=high)
    return Effect(NAME, "output", "y'(t) = y(t − delay)", (delay,), None, "", delays=True)
