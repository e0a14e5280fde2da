"""FMUs that fail while they run: the run ends with an error that names component and time."""

from benchmarks.testpack.case import Case, cases
from benchmarks.testpack.cases.common import whole
from benchmarks.testpack.cases.stepping import loop
from benchmarks.testpack.render import component, gives


def _trouble(name: str) -> str:
    return whole([component("culprit", f"trouble_{name}", gives("y"))], [], {"culprit.y": "Real"})


CULPRIT = ("culprit", "0.4")
CASES: tuple[Case, ...] = (
    *cases("error", "an FMU returns Error", _trouble("fails"), kind="fails", names=CULPRIT),
    *cases("not-a-number", "an output becomes NaN", _trouble("no_number"), kind="fails", names=CULPRIT),
    *cases(
        "crash", "an FMU crashes its process", _trouble("crashes"), kind="fails", names=CULPRIT, isolated=True
    ),
    *cases("hang", "an FMU does not return", _trouble("hangs"), kind="fails", names=CULPRIT, isolated=True),
    *cases(
        "loop-unsolvable",
        "an algebraic loop without a solution",
        loop("gain_plus", "gain", 0.8),
        kind="fails",
        names=("a", "b"),
    ),
)
