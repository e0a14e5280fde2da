"""`python -m benchmarks nmpc`: how long a solve of the predictive controller takes."""

from benchmarks.nmpc import SEED, SHARE, measure
from records.figures_file import write
from slewright.figures import JsonOption, exit_if_missed
from slewright.progress import progress
from slewright.tables import show


def nmpc(json: JsonOption = None) -> None:
    """How long a solve of the model predictive controller takes; 99 % must stay within 50 ms on one core."""
    with progress("bench nmpc") as report:
        figures = measure(report)
    columns = ("time [ms]", "p50", "p99", "p99.9", "max")
    rows = [
        (label, *figures[key].values())
        for label, key in (("process", "process_ms"), ("elapsed", "elapsed_ms"))
    ]
    show(f"{figures['solves']} solves, {figures['fallbacks']} fallbacks", columns, rows)
    write(json, figures, SEED)
    if figures["within_limit"] < SHARE:
        exit_if_missed([f"{SHARE:.0%} of the solves within {figures['limit_ms']:g} ms"])
