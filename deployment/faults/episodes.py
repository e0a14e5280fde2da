"""Episodes in real time: one fault injected once; an episode in which the rig itself was late is repeated.

The rig stands in for hardware, an operator and clients (deployment/hil/punctual.py).  An episode in which one
of them was late counts neither as caught nor as missed.  One that stays late is void, which is no pass.
"""

from collections.abc import Callable

from deployment.faults.plant import Plant
from deployment.faults.table import Outcome
from specs.errors import RunError
from specs.progress import Report

REPEATS = 3  # of an episode
TOLD_TICKS = 50  # a sender that was late says so when it sends again
Result = tuple[float | None, str]  # time of the reaction in ms (None: it did not come), what else was wrong


def episodes(
    plant: Plant, outcome: Outcome, count: int, report: Report, inject: Callable[[], Result]
) -> None:
    """Inject `count` times; a RunError of `inject` is its result where the rig was late."""
    for number in range(count):
        report(outcome.fault.name, number, count)
        for left in reversed(range(1 + REPEATS)):
            result = _once(plant, outcome, inject)
            if result:
                outcome.add(plant.tick, *result)
                break
            outcome.add_late(repeated=left > 0)


def _once(plant: Plant, outcome: Outcome, inject: Callable[[], Result]) -> Result | None:
    """One episode; None if the rig was late in it."""
    plant.late()  # what was before is over
    try:
        ms, why = inject()
    except RunError:
        if plant.late():
            return None
        raise
    if not outcome.good(ms, why):
        plant.drive(TOLD_TICKS, lambda: False)
    return None if plant.late() else (ms, why)
