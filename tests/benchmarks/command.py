"""`python -m benchmarks` inside the test's process."""

from benchmarks.__main__ import app
from slewright.__main__ import run


def benchmarks(*arguments: object) -> int:
    """Run the command and return its exit code."""
    return run([*map(str, arguments)], app, "python -m benchmarks")
