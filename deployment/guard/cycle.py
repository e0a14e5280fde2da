"""What the guard costs a cycle: the same ticks through a core with it and one without, in turns."""

import time
from pathlib import Path
from typing import Any

import numpy as np

from deployment.bundling.blocks import External
from deployment.bundling.build import assemble
from deployment.bundling.content import Content
from deployment.guard import draw
from deployment.guard.stand import AXES, NAME, Stand, bundle

TICKS, YARDS = 400, 3
Tick = tuple[int, np.ndarray, np.ndarray]  # number, input image, commands wanted


def cost(folder: Path, seed: int, rounds: int) -> dict[str, Any]:
    """Medians over `rounds` of each tick's time without the guard, and what it adds, passing or stepping in.

    Times in µs; a ratio is of the sums over the same ticks.  Commands of an adversary, in yards full of
    things.
    """
    plain = Stand(assemble(Content(NAME, External([], outputs=AXES, period=1)), folder / "cost-plain"))
    without, guarded, stepped_in = list[np.ndarray](), list[np.ndarray](), list[np.ndarray]()
    for yard in range(YARDS):
        stand = Stand(bundle(draw.yard(yard, seed), folder / f"cost-{yard}"))
        ticks, parts = _recorded(stand, np.random.default_rng([seed, yard]))
        times = np.array([[_timed(s, ticks) for s in (plain, stand)] for _ in range(rounds)])
        a, b = np.median(times, axis=0)
        without.append(a)
        guarded.append(b)
        stepped_in.append(parts)
    base, full, acts = (np.concatenate(v) for v in (without, guarded, stepped_in))
    more = full - base
    return {
        "core_us": float(np.median(base)),
        "passes_us": float(np.median(more[~acts])),
        "steps_in_us": float(np.median(more[acts])) if acts.any() else 0.0,
        "p99_us": float(np.quantile(more, 0.99)),
        "most_us": float(more.max()),
        "ratio": float(full.sum() / base.sum()),
        "ratio_most": float(np.quantile(full / base, 0.999)),
        "ticks": len(base),
        "stepped_in": float(acts.mean()),
        "rounds": rounds,
    }


def _recorded(stand: Stand, random: np.random.Generator) -> tuple[list[Tick], np.ndarray]:
    """An episode's ticks, and in which of them the guard stepped in."""
    ticks: list[Tick] = []
    driver = draw.bang(random, TICKS)
    start = draw.start(random)
    driven = stand.drive(start, driver, TICKS, look=lambda t, i, w: ticks.append((t, i.copy(), w.copy())))
    return ticks, np.concatenate([np.zeros(len(ticks) - TICKS, bool), driven.part > 0])


def _timed(stand: Stand, ticks: list[Tick]) -> list[float]:
    """Time of each tick, µs."""
    stand.core.reset()
    found = []
    for number, image, wanted in ticks:
        begin = time.perf_counter_ns()
        stand.step(image, wanted, number)
        found.append((time.perf_counter_ns() - begin) / 1e3)
    return found
