"""`slewright bench guard`: search, stopping, speed and cycle in one run, and which limits they miss."""

import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from deployment.guard import cycle, search, speed, stopping
from deployment.guard.search import Episode, Judge
from deployment.guard.stand import Stand, bundle
from specs.progress import Report
from specs.version import VERSION

RINGS_M = (2.0, 4.0, 6.0, 8.0, 10.0)  # of walls, beyond the farthest target
NEAR_M = 10.0  # from there on nothing is near
LEAST_SPEED, MOST_US = 0.98, 50.0


def run(
    episodes: int, first: int, stops: int, rounds: int, seed: int, moving: bool, judge: Judge, report: Report
) -> dict[str, Any]:
    """All figures, and `failures`: sentences about the limits that are missed.

    `moving`: in the search's yards things also move.

    The search may be interrupted: the figures are then of the episodes that there were.
    """
    with TemporaryDirectory(prefix="slewright-guard-") as made:
        folder = Path(made)
        figures: dict[str, Any] = {"slewright": VERSION, "seed": seed, "first": first, "moving": moving}
        figures["cycle"] = cycle.cost(folder, seed, rounds)
        figures["speed"] = speed.loss(folder, RINGS_M, seed, report)
        if stops:
            figures["stopping"] = stopping.study(Stand(bundle(None, folder / "free")), stops, seed, report)
        begin = time.perf_counter()
        found = _searched(search.episodes(episodes, seed, first, folder, judge, moving), episodes, report)
        figures["search"] = search.summary(found)
        figures["search"]["seconds_an_episode"] = (time.perf_counter() - begin) / len(found)
        figures["search"]["asked_for"] = episodes
    return {**figures, "failures": failures(figures)}


def _searched(episodes: Iterator[Episode], count: int, report: Report) -> list[Episode]:
    found: list[Episode] = []
    try:
        for episode in episodes:
            found.append(episode)
            if len(found) % 10 == 0:
                report("adversarial episodes", len(found), count)
    except KeyboardInterrupt:
        if not found:
            raise
    return found


def failures(figures: dict[str, Any]) -> list[str]:
    """What is missed."""
    missed = []
    count = figures["search"]["violations"]
    if count:
        missed.append(
            f"the guard's promise was broken in {count} of {figures['search']['episodes']} episodes"
        )
    for name, share in figures.get("stopping", {}).get("largest_share", {}).items():
        if share > 1.0:
            missed.append(f"stopping: {name} used {share:.2f} of its bound")
    ratio = figures["speed"]["by_distance_m"][f"{NEAR_M:g}"]["ratio"]
    if ratio < LEAST_SPEED:
        missed.append(
            f"speed where nothing is near: {ratio:.3f} of that without the guard, limit {LEAST_SPEED}"
        )
    if figures["cycle"]["p99_us"] > MOST_US:
        missed.append(f"time of a cycle: {figures['cycle']['p99_us']:.0f} µs more, limit {MOST_US:.0f}")
    return missed
