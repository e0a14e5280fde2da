"""The slew traces: roll-outs of the networks that were trained on the real machine's recordings, at 10 Hz.

Row k holds the state at time (k+1) 0.1 s after the command u[k] has been applied over the 0.1 s before it.
Source, licence and what is known of them: tests/data/slew_traces/README.md.
"""

import csv
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from specs.errors import InputError

FOLDER = Path(__file__).resolve().parents[3] / "tests" / "data" / "slew_traces"
PERIOD = 0.1  # s
SETTLED = 1.0  # s: before, the networks' zero-filled history dies away; not machine behaviour
FIT_INERTIAS, UNPHYSICAL = (250e3, 550e3), 700e3  # kg m2
MIRROR = "_neg"


@dataclass(frozen=True)
class Trace:
    """One roll-out, from its settled row on in every use; all arrays of n rows, SI units."""

    name: str
    time: np.ndarray
    u_slew: np.ndarray
    inertia: float
    p_a: np.ndarray  # drives positive motion
    p_b: np.ndarray
    qd: np.ndarray
    q: np.ndarray

    @property
    def shape(self) -> str:
        """What was commanded: step, bump, reversal, sine or trapezoid."""
        return self.name.split("_")[0]

    @property
    def first(self) -> int:
        """Row at SETTLED, from which simulations start and errors count."""
        return round(SETTLED / PERIOD) - 1

    @property
    def partner(self) -> str:
        """Name of the trace with the mirrored command."""
        return self.name.removesuffix(MIRROR) if self.name.endswith(MIRROR) else self.name + MIRROR


@cache
def load(folder: Path = FOLDER) -> dict[str, Trace]:
    """All traces by name; raises InputError when there are none or a file is damaged."""
    found = {path.stem: read(path) for path in sorted(folder.glob("*.csv"))}
    if not found:
        raise InputError(f"no slew traces in {folder}")
    return found


def fit_set(traces: dict[str, Trace]) -> list[Trace]:
    """Traces the parameters are fitted on: steps at 250 and 550 t m2, both directions."""
    return [t for t in traces.values() if t.shape == "step" and t.inertia in FIT_INERTIAS]


def held_out(traces: dict[str, Trace]) -> list[Trace]:
    """Traces that score the fit: every other one up to 550 t m2."""
    used = {t.name for t in fit_set(traces)}
    return [t for t in traces.values() if t.name not in used and t.inertia < UNPHYSICAL]


def unphysical(traces: dict[str, Trace]) -> list[Trace]:
    """Traces at 700 t m2, where the networks are not physical: reported, not judged."""
    return [t for t in traces.values() if t.inertia >= UNPHYSICAL]


def read(path: Path) -> Trace:
    """One file of this form; raises InputError when it is damaged."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
        columns = {k: np.array([row[k] for row in rows]) for k in rows[0]}
        return Trace(
            path.stem,
            columns["time"],
            columns["u_slew"],
            float(columns["inertia"][0]),
            columns["p_r"],
            columns["p_l"],
            columns["omega"],
            columns["q"],
        )
    except (OSError, ValueError, TypeError, KeyError, IndexError) as error:
        raise InputError(f"slew trace {path.name} is damaged: {error}") from error
