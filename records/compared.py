"""Two controllers on the same runs, in one sentence: which is better, and by how much."""

from collections.abc import Iterable
from dataclasses import dataclass
from statistics import fmean

from records.metrics import Metrics
from records.results import Results

# Field of Totals, what it is called, unit, format, whether more is better.
SHOWN = (
    ("speed", "speed", "°/s", ".1f", True),
    ("overshoot", "overshoot", "°", ".2f", False),
    ("error", "error", "m", ".2f", False),
    ("tool", "tool rate", "°/s", ".1f", False),
)


@dataclass(frozen=True)
class Totals:
    """Metrics over all runs: means by run, and counts of targets."""

    speed: float  # °/s
    overshoot: float  # °
    error: float  # m
    tool: float  # °/s
    missed: int
    targets: int


def totals(results: Results) -> Totals:
    """The metrics of all scenarios and systems together."""
    runs = [metrics for pair in results.values() for metrics in pair.values()]
    means = {name: fmean(_values(runs, name)) for name, *_ in SHOWN}
    return Totals(**means, missed=sum(r.missed for r in runs), targets=sum(r.targets for r in runs))


def _values(runs: Iterable[Metrics], name: str) -> list[float]:
    return [getattr(run, name) for run in runs]


def sentence(name: str, mine: Totals, other: str, theirs: Totals) -> str:
    """'policy misses 0 of 54 targets, pi 44; speed 11.8 against 6.6 °/s, …: policy is better in all.'"""
    said, better = [], [mine.missed < theirs.missed]
    for key, called, unit, form, more in SHOWN:
        a, b = getattr(mine, key), getattr(theirs, key)
        better.append(a > b if more else a < b)
        said.append(f"{called} {a:{form}} against {b:{form}} {unit}")
    ahead = sum(better)
    verdict = "all" if ahead == len(better) else f"{ahead} of {len(better)}"
    return (
        f"{name} misses {mine.missed} of {mine.targets} targets, {other} {theirs.missed}; "
        f"{', '.join(said)}: {name} is better in {verdict}."
    )
