"""What a case of the pack is: a package to import, and what must come of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.testpack import render

SSD = "SystemStructure.ssd"


@dataclass(frozen=True)
class Package:
    """The content of an .ssp: its description, and further files by path.

    A text is taken for the version of SSP; a Package becomes an .ssp inside of it.
    fmus  names of FMUs of the pack that are put into resources/ beside those that the description names
    """

    ssd: str
    files: Mapping[str, "str | bytes | Package"] = field(default_factory=dict)
    fmus: tuple[str, ...] = ()


@dataclass(frozen=True)
class Case:
    """One case, for one FMI version.

    kind       right: it must run and end with the right values; refused: it must be refused before the first
               step; fails: it must be refused before, or end with an error in a step; ends: it ends by itself
    expect     value of a variable ("component.variable", or a system output) at each time t, as a formula
    tolerance  absolute; wide enough for either exchange of values (a step's delay), unless `own`
    names      what a refusal or error must name
    at         text of the line of the description that it must name
    own        it is about what other importers need not do: this project's annotation, optional capabilities
    times      at which `expect` holds; (): always
    damage     what is done to the finished package: see pack.py
    isolated   its FMU takes the process down with it
    """

    name: str
    fmi_version: int
    about: str
    package: Package
    kind: str = "right"
    expect: Mapping[str, str] = field(default_factory=dict)
    tolerance: float = 1e-9
    names: tuple[str, ...] = ()
    at: str = ""
    own: bool = False
    times: tuple[float, ...] = ()
    damage: str = ""
    step_s: float = 0.1
    stop_s: float = 0.8
    isolated: bool = False

    def __str__(self) -> str:
        return self.name

    @property
    def ticks(self) -> int:
        """Steps of the run."""
        return round(self.stop_s / self.step_s)

    @property
    def ssd(self) -> str:
        """The description's text."""
        return render.for_version(self.package.ssd, self.fmi_version)

    @property
    def line(self) -> int:
        """The line of the description that an error must name; 0: none."""
        found = [i for i, text in enumerate(self.ssd.splitlines(), 1) if self.at and self.at in text]
        return found[0] if found else 0

    def values(self, name: str, times: Sequence[float] | np.ndarray) -> np.ndarray:
        """What is expected of `name` at these times."""
        return evaluated(self.expect[name], times)

    @property
    def checked_times(self) -> np.ndarray:
        """The times at which the values are compared."""
        return np.array(self.times) if self.times else np.arange(self.ticks + 1) * self.step_s


def pick(index: np.ndarray, *values: float) -> np.ndarray:
    """The value with that number; the last one beyond."""
    return np.array(values)[np.minimum(index.astype(int), len(values) - 1)]


def whole(x: np.ndarray) -> np.ndarray:
    """Whole part; what is a whole number up to rounding counts as that."""
    return np.floor(x + 1e-9)


FUNCTIONS: Mapping[str, Any] = {
    "pick": pick,
    "whole": whole,
    "cos": np.cos,
    "sin": np.sin,
    "atan": np.arctan,
    "acos": np.arccos,
    "tan": np.tan,
    "exp": np.exp,
    "pi": np.pi,
}


def evaluated(formula: str, times: Sequence[float] | np.ndarray) -> np.ndarray:
    """A formula of the time t (only of this package's own data) at these times."""
    t = np.asarray(times, dtype=float)
    value = eval(formula, {"__builtins__": {}}, {**FUNCTIONS, "t": t})
    return np.broadcast_to(np.asarray(value), t.shape)


def cases(name: str, about: str, ssd: str | Package, fmi: Sequence[int] = (2, 3), **more: Any) -> list[Case]:
    """The case for each FMI version, named after it."""
    package = ssd if isinstance(ssd, Package) else Package(ssd)
    return [Case(f"{name}-fmi{version}", version, about, package, **more) for version in fmi]
