"""What a collection visited, against what a slew model is used on.

Every 0.1 s of a recording falls into a cell of joystick u, slew speed omega, drive pressure p (side a less
side b) and slew inertia I; the signs of u, omega and p tell directions and driving from braking apart.  Use
is what operator and slew controller do: the validation recordings of driving and closed loop.  A cell counts
as visited with LEAST samples or more of training data.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from fmus.models.slew_nn.network import PERIOD_S
from learning.slew.trajectory import Trajectory, of_measurement
from records.formats import read_measurement

LEAST = 5  # samples: half a second
USE_KINDS = ("driving", "closed_loop")
USE_SPLIT = "validation"
WORST = 8  # unvisited cells that are named


def _both(*edges: float) -> tuple[float, ...]:
    """Edges on both sides of a cell about 0, which is rest, neutral or balance."""
    return (*(-e for e in reversed(edges)), *edges)


@dataclass(frozen=True)
class Axis:
    """A quantity of the map: cells between edges; beyond the last edge counts to the last cell."""

    name: str
    label: str
    unit: str
    edges: tuple[float, ...]

    def cell(self, values: np.ndarray) -> np.ndarray:
        """Index of the cell of each value."""
        return np.clip(np.searchsorted(self.edges, values, side="right") - 1, 0, len(self.edges) - 2)

    def span(self, index: int) -> str:
        """The cell in words: "u 0.15 to 0.3"."""
        low, high = list(pairwise(self.edges))[index]
        text = f"{self.label} {low:g} to {high:g}{f' {self.unit}' if self.unit != '1' else ''}"
        return text.replace("-", "−")


AXES = (
    Axis("u", "u", "1", _both(0.02, 0.15, 0.3, 0.5, 0.75, 1.0)),
    Axis("omega", "ω", "°/s", _both(1.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0)),
    Axis("p", "p_a − p_b", "bar", _both(25.0, 100.0, 200.0, 300.0, 400.0)),
    Axis("inertia", "I", "t m²", (200.0, 400.0, 600.0, 800.0, 1000.0, 1200.0, 1400.0)),
)


@dataclass(frozen=True)
class Samples:
    """Of some recordings: values [n, 4] in the axes' units, and the part each is from."""

    values: np.ndarray
    owner: np.ndarray

    @property
    def cells(self) -> np.ndarray:
        """Cell number of each sample [n]."""
        shape = [len(a.edges) - 1 for a in AXES]
        return np.ravel_multi_index(tuple(a.cell(self.values[:, i]) for i, a in enumerate(AXES)), shape)

    def of(self, parts: Sequence[str]) -> "Samples":
        """Those of some parts."""
        chosen = np.isin(self.owner, list(parts))
        return Samples(self.values[chosen], self.owner[chosen])

    def mirrored(self) -> "Samples":
        """The same motions the other way round."""
        return Samples(self.values * np.array([-1.0, -1.0, -1.0, 1.0]), self.owner)

    def __add__(self, other: "Samples") -> "Samples":
        return Samples(np.concatenate([self.values, other.values]), np.concatenate([self.owner, other.owner]))


@dataclass(frozen=True)
class Coverage:
    """Samples of each split, kinds of the parts, and the figures of the page."""

    splits: Mapping[str, Samples]
    kinds: Mapping[str, str]
    use: Samples
    figures: dict[str, Any]


def measure(out: Path, entries: Sequence[Mapping[str, Any]]) -> Coverage:
    """Read the recordings of a manifest's `entries` in the folder `out` and compare training with use."""
    kinds = {e["part"]: e["kind"] for e in entries}
    splits = {s: _samples(out, [e for e in entries if e["split"] == s]) for s in _splits(entries)}
    use_parts = [part for part, kind in kinds.items() if kind in USE_KINDS]
    use = splits.get(USE_SPLIT, _empty()).of(use_parts)
    train = splits.get("train", _empty())
    return Coverage(splits, kinds, use, _figures(train, use, kinds))


def _splits(entries: Sequence[Mapping[str, Any]]) -> list[str]:
    return list(dict.fromkeys(e["split"] for e in entries))


def _samples(out: Path, entries: Sequence[Mapping[str, Any]]) -> Samples:
    found = [_empty()]
    for e in entries:
        for t in of_measurement(read_measurement(out / e["file"]), e["file"]):
            found.append(_of(t, e["part"]))
    return Samples(np.concatenate([f.values for f in found]), np.concatenate([f.owner for f in found]))


def _of(t: Trajectory, part: str) -> Samples:
    values = [t.u, np.degrees(t.omega), (t.p_r - t.p_l) * 1e-5, t.inertia * 1e-3]
    return Samples(np.stack(values, axis=1), np.full(len(t), part, dtype=object))


def _empty() -> Samples:
    return Samples(np.empty((0, len(AXES))), np.empty(0, dtype=object))


def _figures(train: Samples, use: Samples, kinds: Mapping[str, str]) -> dict[str, Any]:
    """Shares of use that training data visits: all of it, mirrored too, by part, and without use's kinds."""
    found: dict[str, Any] = {
        "use_minutes": round(len(use.values) * PERIOD_S / 60.0, 3),
        "use_cells": len(np.unique(use.cells)),
        "train_cells": len(np.unique(train.cells)),
        "least_samples": LEAST,
    }
    if not len(use.values):
        return found
    excitation = [part for part, kind in kinds.items() if kind not in USE_KINDS]
    chosen = {
        "all": train,
        "all_and_mirrored": train + train.mirrored(),
        "excitation": train.of(excitation),
        **{part: mine for part in kinds if len((mine := train.of([part])).values)},
    }
    found["covered"] = {name: shares(mine, use) for name, mine in chosen.items()}
    found["unvisited"] = unvisited(train + train.mirrored(), use)
    return found


def shares(train: Samples, use: Samples) -> dict[str, float]:
    """Shares of use's time and of use's cells that `train` visits."""
    visited = _visited(train)
    cells = np.unique(use.cells)
    return {
        "time": round(float(np.isin(use.cells, visited).mean()), 4),
        "cells": round(float(np.isin(cells, visited).mean()), 4),
        "minutes": round(len(train.values) * PERIOD_S / 60.0, 3),
    }


def unvisited(train: Samples, use: Samples) -> list[dict[str, Any]]:
    """The WORST cells of use, by time, that `train` does not visit: in words, with the time in s."""
    cells, counts = np.unique(use.cells, return_counts=True)
    away = ~np.isin(cells, _visited(train))
    order = np.argsort(-counts[away], kind="stable")[:WORST]
    shape = [len(a.edges) - 1 for a in AXES]
    return [
        {"where": ", ".join(a.span(i) for a, i in zip(AXES, _place(cell, shape), strict=True)), "use_s": time}
        for cell, time in zip(
            cells[away][order], (counts[away][order] * PERIOD_S).round(1).tolist(), strict=True
        )
    ]


def _place(cell: int, shape: list[int]) -> list[int]:
    return [int(i) for i in np.unravel_index(cell, shape)]


def _visited(train: Samples) -> np.ndarray:
    cells, counts = np.unique(train.cells, return_counts=True)
    return cells[counts >= LEAST]
