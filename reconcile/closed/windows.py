"""Stretches of recordings in which the errors of a closed FMU are looked at."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from reconcile.recordings.data import Block, Run

STEP_S = (0.002, 0.01)  # least and largest step of a simulation
MARGIN_S = 0.3  # before the samples, for sensor delays
PREFIX = 0.4  # of a held-out block, from which its initial state is estimated
WINDOW_S, MOST = 2.0, 60  # of a stretch; of long recordings so many, evenly chosen


@dataclass(frozen=True)
class Window:
    """A stretch of a run from `start_s`; the times [n] of each output's samples in it."""

    run: Run
    start_s: float
    times: Mapping[str, np.ndarray]


def cut(blocks: Sequence[Block]) -> list[Window]:
    """Stretches that each cover a block, or a part of it, a margin after its begin; evenly chosen of many."""
    windows = []
    for block in blocks:
        length = block.end_s - block.start_s
        margin = min(MARGIN_S, 0.25 * length)
        count = max(1, round((length - margin) / WINDOW_S))
        for a, b in pairwise(np.linspace(block.start_s + margin, block.end_s, count + 1)):
            inside = {
                n: s.time[(s.time >= a - 1e-9) & (s.time < b - 1e-9)] for n, s in block.run.outputs.items()
            }
            windows.append(Window(block.run, float(a - margin), inside))
    chosen = np.unique(np.linspace(0, len(windows) - 1, min(len(windows), MOST)).round().astype(int))
    return [windows[i] for i in chosen]
