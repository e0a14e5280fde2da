"""Re-draws of the reference machine (`specs/draws.toml`): parameter values that differ from the nominal ones.

Three disjoint sets: tuning, validation and test.  The test set is sealed: it is opened once for each released
controller or policy, for the final tables, and every opening is logged in `specs/test_openings.log`.
"""

import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import NormalDist
from typing import Any, ClassVar, Literal

from specs import keys, parameters
from specs.errors import InputError, nearest
from specs.parameters import Parameter
from specs.schema import ROOT, STRICT, read_toml, shown_path, validate
from specs.version import VERSION

PATH = ROOT / "draws.toml"
LOG = ROOT / "test_openings.log"
FILES = ("geometry", "slew", "machine")  # whose parameters may be drawn
SEALED = "test"
NOMINAL = "nominal"
CUT = 3.0  # standard deviations at which a normal distribution is cut off


@dataclass(frozen=True, kw_only=True)
class Spread:
    """How the named parameters spread, in SI and relative to their nominal values as `relation` says."""

    __pydantic_config__: ClassVar[Any] = STRICT

    parameters: tuple[str, ...]
    reason: str
    status: Literal["sourced", "assumed"]
    relation: Literal["absolute", "factor", "offset"] = "absolute"
    low: float | None = None
    high: float | None = None
    sd: float | None = None
    group: str = ""

    def __post_init__(self) -> None:
        if not self.reason.strip():
            raise InputError("empty reason")
        uniform = self.low is not None and self.high is not None and self.sd is None
        normal = self.low is None and self.high is None and self.sd is not None
        if not uniform and not normal:
            raise InputError("needs low and high, or sd")
        low, high = self.range
        if not low < high:
            raise InputError(f"empty range {low:g} … {high:g}")
        if normal and self.relation == "factor":
            raise InputError("sd goes with relation absolute or offset, not factor")

    @property
    def range(self) -> tuple[float, float]:
        """Smallest and largest number drawn, before it is related to the nominal value."""
        spread = CUT * (self.sd or 0.0)
        return -spread if self.low is None else self.low, spread if self.high is None else self.high

    def quantile(self, share: float) -> float:
        """The drawn number below which a share (0 … 1) of the distribution lies."""
        low, high = self.range
        if self.sd is None:
            return low + share * (high - low)
        normal = NormalDist(0.0, self.sd)
        bottom, top = normal.cdf(low), normal.cdf(high)
        return min(max(normal.inv_cdf(bottom + share * (top - bottom)), low), high)

    def related(self, number: float, nominal: float) -> float:
        """The parameter's value, to twelve digits (so that it does not depend on the platform)."""
        value = {"absolute": number, "factor": number * nominal, "offset": number + nominal}[self.relation]
        return float(f"{value:.12g}")

    def limits(self, nominal: float) -> tuple[float, float]:
        """Smallest and largest value of a parameter with this nominal value."""
        low, high = sorted(self.related(number, nominal) for number in self.range)
        return low, high


@dataclass(frozen=True)
class Opened:
    """Leave to draw from the sealed test set; only `open_test_set` gives it out."""

    purpose: str


def sets() -> dict[str, int]:
    """Number of draws in each set."""
    return dict(_load(PATH)[0])


def spreads() -> dict[str, Spread]:
    """The spread of each drawn parameter."""
    return dict(_load(PATH)[1])


def check_set(name: str, count: int) -> None:
    """Raise InputError for a set that is not there, or has not so many machines."""
    sizes = sets()
    if name not in sizes:
        raise InputError(f"unknown set of draws '{name}'; {nearest(name, sizes)}")
    if count > sizes[name]:
        raise InputError(f"{count} machines of set {name}: valid are 0 to {sizes[name]}")


def draw(name: str, index: int, opened: Opened | None = None) -> dict[str, float]:
    """Parameter values (SI) of machine `index` (from 0) of a set; the rest of the machine stays nominal.

    Raises InputError for an unknown set or index, and for the test set without `open_test_set`'s leave.
    """
    check_set(name, 0)
    if not 0 <= index < sets()[name]:
        raise InputError(f"draw {index} of set {name}: valid are 0 to {sets()[name] - 1}")
    if name == SEALED and opened is None:
        raise InputError(
            "the test set is sealed: open it with open_test_set (purpose, logged), for final tables only"
        )
    nominal = _known()
    return {p: _value(spread, name, index, nominal[p]) for p, spread in spreads().items()}


def named(which: str) -> dict[str, float]:
    """Parameter values of a machine by name: "nominal" (none: as its files say), "tuning:K", "validation:K".

    Raises InputError for another name; the sealed test set has none.
    """
    if which == NOMINAL:
        return {}
    name, _, index = which.partition(":")
    choices = [n for n in sets() if n != SEALED]
    if name not in choices or not index.isdigit():
        valid = ", ".join([NOMINAL, *(f"{n}:0 … {n}:{sets()[n] - 1}" for n in choices)])
        sealed = f" (set {name} is sealed)" if name == SEALED else ""
        raise InputError(f"unknown machine '{which}'{sealed}; valid: {valid}")
    return draw(name, int(index))


def asked(text: str, option: str) -> str:
    """The machine that `machine[:DRAW]` of a command line names; InputError for another text."""
    what, _, draw = text.partition(":")
    if what != "machine":
        raise InputError(f"{option} {text}: valid: machine, machine:tuning:K, machine:validation:K")
    return draw or NOMINAL


def open_test_set(purpose: str, log: Path = LOG) -> Opened:
    """Log purpose, version and state of the sources, and give leave to draw from the test set."""
    if not purpose.strip() or "\n" in purpose or "\t" in purpose:
        raise InputError(
            "opening the test set needs a purpose: one line without tabs, such as a controller's name"
        )
    with log.open("a", encoding="utf-8") as file:
        file.write(f"{purpose.strip()}\t{VERSION}\t{_source_state()}\n")
    return Opened(purpose.strip())


def check() -> None:
    """Raise InputError where a spread names an unknown parameter, or leaves the parameter's own bounds."""
    known = _known()
    for name, spread in spreads().items():
        where = f"{shown_path(PATH)}: {name}"
        if name not in known:
            raise InputError(f"{where}: no such parameter; {nearest(name, known)}")
        for value in spread.limits(known[name].value):
            try:
                known[name].check(value)
            except InputError as error:
                raise InputError(f"{where}: {error}") from error


def _value(spread: Spread, name: str, index: int, parameter: Parameter) -> float:
    key = f"group {spread.group}" if spread.group else parameter.name
    number = spread.quantile(keys.uniform("draw", name, index, key))
    return spread.related(number, parameter.value)


def _known() -> dict[str, Parameter]:
    return parameters.load(*FILES)


@cache
def _load(path: Path) -> tuple[dict[str, int], dict[str, Spread]]:
    data, found = read_toml(path), {}
    for number, entry in enumerate(data.get("spread", []), 1):
        names = entry.get("parameters", [])
        where = f"{shown_path(path)}: spread {number} ({', '.join(map(str, names))})"
        spread = validate(Spread, entry, where)
        for name in spread.parameters:
            if name in found:
                raise InputError(f"{where}: {name} has a spread already")
            found[name] = spread
    return validate(dict[str, int], data.get("sets", {}), f"{shown_path(path)}: sets"), found


def _source_state() -> str:
    """What git calls the state of the sources; "unknown" outside a repository."""
    command = ["git", "describe", "--always", "--dirty"]
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=10)
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return done.stdout.strip() or "unknown"
