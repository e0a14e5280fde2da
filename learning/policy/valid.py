"""What the fields of a recipe may be: kind and range by name, so that a wrong word ends before a training.

The bounds that are not plain sense are those of the simulation: it keeps ten speeds and eight commands.
"""

import math
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, is_dataclass
from typing import Any

from learning.policy.simulation.rewards import TERMS
from specs.ahead import MOST_FIELD_M, MOST_WAYPOINT_S, MOST_WAYPOINTS, Ahead
from specs.errors import InputError
from specs.policy import MOST_CHANGE, MOST_HISTORY, MOST_LEAD_S, PRIORS, SPACING_S

ABSENT = (-1.0, -1.0)  # a range that leaves the nominal value
MOST_AHEAD_S = 0.9  # of the ten speeds that the slew networks see one must be there
LARGEST, MOST = 1e30, 1e9  # what single precision holds with room for products; what can be counted
MOST_SLEW_DELAY_S = 0.5  # with the latency: six periods
MOST_DELAY_S, MOST_LATENCY = 0.6, 5.0  # together seven periods: the eight commands that are kept


@dataclass(frozen=True)
class Rule:
    """Whether a value is one, and what is valid in words."""

    holds: Callable[[Any], bool]
    says: str


def check(values: Mapping[str, Any], rules: Mapping[str, Rule], group: str = "") -> None:
    """InputError names the first field that is not as its rule says, and what is valid."""
    for name, rule in rules.items():
        if not rule.holds(values[name]):
            raise InputError(f"{group}{name} = {_shown(values[name])}: valid is {rule.says}")


def _shown(value: Any) -> str:
    return f"'{value}'" if isinstance(value, str) else f"{value}"


def _is_number(value: Any) -> bool:
    real = isinstance(value, int | float) and not isinstance(value, bool)
    return real and abs(value) <= sys.float_info.max  # neither NaN nor infinite


def _within(value: Any, low: float, high: float, above: bool) -> bool:
    return _is_number(value) and low <= value <= high and not (above and value == low)


def _bounds(low: float, high: float, above: bool) -> str:
    if math.isinf(low):
        return ""
    return f" above {low:g}, up to {high:g}" if above else f" from {low:g} to {high:g}"


def number(low: float, high: float = LARGEST, above: bool = False) -> Rule:
    """A finite number; `above`: more than `low`."""
    return Rule(lambda v: _within(v, low, high, above), f"a number{_bounds(low, high, above)}")


def whole(low: int, high: float = MOST) -> Rule:
    """A whole number."""
    says = f"a whole number{_bounds(low, high, above=False)}"
    return Rule(lambda v: isinstance(v, int) and _within(v, low, high, above=False), says)


def span(low: float, high: float = LARGEST, above: bool = False, absent: bool = False) -> Rule:
    """Two numbers, the smaller first; `absent`: or ABSENT."""

    def holds(value: Any) -> bool:
        if not isinstance(value, tuple) or len(value) != 2:
            return False
        return (absent and value == ABSENT) or (
            all(_within(v, low, high, above) for v in value) and value[0] <= value[1]
        )

    return Rule(holds, f"[LOW,HIGH] of numbers{_bounds(low, high, above)}{' or [-1,-1]' * absent}")


def choice(able: Iterable[str]) -> Rule:
    """One of these words."""
    words = tuple(able)
    shown = ", ".join(word for word in words if word) + (", or none" if "" in words else "")
    return Rule(lambda v: isinstance(v, str) and v in words, shown)


FINITE = number(-math.inf, math.inf)
TRUTH = Rule(lambda v: isinstance(v, bool), "true or false")
TEXT = Rule(lambda v: isinstance(v, str), "a word")
SIZES = Rule(
    lambda v: isinstance(v, tuple) and bool(v) and all(whole(1).holds(n) for n in v),
    "[N,…] of whole numbers from 1",
)
TIMES = Rule(
    lambda v: isinstance(v, tuple) and all(_is_number(t) for t in v) and not Ahead(v).faults(),
    f"[SECONDS,…] from 0 to {MOST_WAYPOINT_S:g}, each later than the one before, up to {MOST_WAYPOINTS}",
)
SOME_TERMS = Rule(
    lambda v: isinstance(v, tuple) and all(isinstance(n, str) and n in TERMS for n in v),
    'a list ["TERM",…] of ' + ", ".join(TERMS),
)
SHARE, POSITIVE, NO_LESS = number(0, 1), number(0, above=True), number(0)

RECIPE: Mapping[str, Rule] = {
    "method": choice(("ppo", "gradient")), "history": whole(1, MOST_HISTORY), "prior": choice(PRIORS),
    "layers": SIZES, "weights": Rule(lambda v: isinstance(v, Mapping), "weights.TERM=NUMBER"),
    "quiet": SOME_TERMS, "gentle": FINITE, "first": Rule(is_dataclass, "first.WIDTH=NUMBER"),
    "last": Rule(is_dataclass, "last.WIDTH=NUMBER"), "curriculum": NO_LESS, "late_terms": SOME_TERMS,
    "change": number(0, MOST_CHANGE), "start": TEXT, "family": TRUTH,
    "random": Rule(is_dataclass, "random.NAME=[LOW,HIGH]"), "episode_s": number(SPACING_S), "ending": FINITE,
    "lead_s": number(0, MOST_LEAD_S), "waypoints_s": TIMES, "field_m": number(0, MOST_FIELD_M),
    "consecutive": SHARE, "swinging": SHARE,
    "ahead_s": number(0, MOST_AHEAD_S), "spatial": TRUTH,
    "envs": whole(1), "iterations": whole(1), "rate": POSITIVE,
    "steps": whole(1), "epochs": whole(1), "batches": whole(1), "deviation": POSITIVE,
    "deviation_least": POSITIVE, "discount": SHARE, "trace": SHARE,
    "entropy": NO_LESS, "clip": POSITIVE, "schedule": choice(("adaptive", "fixed")),
    "mixed": TRUTH, "critic_first": SHARE, "mirrored": TRUTH, "asymmetric": TRUTH,
    "norm": POSITIVE, "fade": SHARE, "level": NO_LESS, "privileged": TRUTH, "teacher": TEXT,
    "imitation": NO_LESS,
}  # fmt: skip
WIDTHS: Mapping[str, Rule] = dict.fromkeys(("balance_m", "target_m", "overshoot_rad", "settle_rad"), POSITIVE)
RANDOM: Mapping[str, Rule] = {
    "load": span(0), "load_told": SHARE, "response": span(0, above=True, absent=True),
    "arm_delay": span(0, MOST_DELAY_S, absent=True), "oil_hz": span(0), "oil_damping": span(0),
    "dead_rate": span(0), "arm_gain": span(0), "tool_length": span(0, above=True), "tool_damping": span(0),
    "dead_band": span(0, 1, absent=True), "inertia_scale": span(0, above=True), "gain": span(0, above=True),
    "latency": span(0, MOST_LATENCY), "slew_delay": span(0, MOST_SLEW_DELAY_S), "edge": span(-1, 1),
    "rate_filter": span(0, 0.9), "slew_error": span(0, math.pi), "small_moves": SHARE,
    "pace": span(0, above=True),
    **dict.fromkeys(("angle_noise", "rate_noise", "imu_angle_noise", "imu_rate_noise"), NO_LESS),
    **dict.fromkeys(("imu_angle_bias", "imu_rate_bias", "angle_bias"), NO_LESS),
}  # fmt: skip
