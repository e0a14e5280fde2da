"""The generator's parameters in the names that a report uses: one table, by effect."""

from collections.abc import Mapping
from typing import Any


def expected(
    placed: Mapping[str, Any], effect: Mapping[str, Any], truth: Mapping[str, Any]
) -> dict[str, float]:
    """True values of the parameters of a reported effect, under the report's names."""
    known = placed["parameters"]
    return {name: known[name] for name in effect["parameters"] if name in known}
