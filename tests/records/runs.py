"""A set of synthetic runs with verdicts, as verification makes them."""

from functools import cache

from records.metrics import Verdict, check_limits
from records.record import Record
from records.report import Context
from records.results import evaluate
from tests.records.synthetic import plausible

LIMITS = {
    "speed": {"min": 9.0, "reason": "slower is no use to an operator"},
    "overshoot": {"max": 12.0, "reason": "room beside a truck"},
    "missed": {"max": 0},
}
CONTEXT = Context(
    controller="pi",
    command="slewright verify",
    seed=1,
    realtime_factor={"nominal": 312.4, "reference": 31.7},
    versions={"slewright": "0.1.0"},
)


@cache
def runs() -> dict[str, dict[str, Record]]:
    """Two scenarios on both systems."""
    return {
        f"four_targets_{name}": {s: plausible(s, load=load) for s in ("nominal", "reference")}
        for name, load in (("empty", 0.0), ("2t", 2000.0))
    }


def verdicts() -> list[Verdict]:
    """The runs held against LIMITS; the reference machine is too slow in both scenarios."""
    return [
        verdict
        for scenario, pair in evaluate(runs()).items()
        for system, metrics in pair.items()
        for verdict in check_limits(metrics, LIMITS, scenario, system)
    ]
