"""Trains the variants of the slew model on several seeds and compares them on recordings they never saw.

Intervals are 95 % bootstrap intervals over recordings and seeds; ratios to `proposed` are paired: both are
taken on the same resampled recordings.
"""

import os
import pickle
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from fmus.models.slew_nn.network import HISTORY, SlewNetwork
from learning.slew import first_order, grey_box
from learning.slew.data import Data
from learning.slew.disagreement import ensemble
from learning.slew.recipe import ENSEMBLE, MEMBERS, PROPOSED, Recipe, exportable, recipe
from learning.slew.region import with_region
from learning.slew.score import HORIZON, STRIDE, Predictor, Score, predictor, score
from learning.slew.trajectory import Windows, windows

REFERENCES = ("first_order", "grey_box")  # fitted, without seeds
RESAMPLES = 1000
NOISE_DEVIATIONS = 3.0  # over seeds, by which a figure may differ when it is made again
LEAST_NOISE = 0.1  # and at least this share of it
SPLITS = ("validation", "test")
BEFORE = 2 * HISTORY  # rows of history before each window: the grey box settles in them


@dataclass(frozen=True)
class Outcome:
    """One trained or fitted model: its scores by split, and its weights if it has the paper's interface."""

    variant: str
    seed: int
    scores: Mapping[str, Score]
    network: SlewNetwork | None = None
    notes: Mapping[str, Any] | None = None


def held_out(data: Data, split: str) -> Windows:
    """The windows of a split that every variant is judged on."""
    return windows(getattr(data, split), BEFORE, HORIZON, STRIDE)


def run(
    data: Data, variants: Sequence[str], seeds: Sequence[int], jobs: int, kept: Path, tiny: bool = False
) -> Iterator[Outcome]:
    """Outcomes of all variants on all seeds as they are ready, from `jobs` processes with one thread each.

    Each is kept in the folder `kept`, where a run that was interrupted finds it again.  An ensemble comes
    last: it is made of the networks of all seeds.
    """
    kept.mkdir(parents=True, exist_ok=True)
    tasks = [(v, s) for v in trained(variants) for s in ((seeds[0],) if v in REFERENCES else seeds)]
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    with ProcessPoolExecutor(jobs, get_context("spawn"), initializer=_start, initargs=(data,)) as pool:
        members: list[Outcome] = []
        left = {pool.submit(_one, variant, seed, tiny, kept) for variant, seed in tasks}
        try:
            while left:
                done, left = wait(left, return_when=FIRST_COMPLETED)
                for future in sorted(done, key=lambda f: f.exception() is not None):  # what is made first
                    members += [future.result()] if future.result().variant == MEMBERS else []
                    yield future.result()
        finally:
            pool.shutdown(cancel_futures=True)
    if ENSEMBLE in variants:
        yield _ensemble(data, sorted(members, key=lambda o: o.seed))


def trained(variants: Sequence[str]) -> list[str]:
    """What has to be trained or fitted for these variants."""
    return list(dict.fromkeys(MEMBERS if v == ENSEMBLE else v for v in variants))


def _ensemble(data: Data, members: Sequence[Outcome]) -> Outcome:
    network = ensemble([o.network for o in members if o.network is not None])
    scores = {split: score(predictor(network), held_out(data, split)) for split in SPLITS}
    return Outcome(ENSEMBLE, members[0].seed, scores, network)


_shared: dict[str, Data] = {}  # of a worker process


def _start(data: Data) -> None:
    import torch

    torch.set_num_threads(1)
    _shared["data"] = data


def _one(variant: str, seed: int, tiny: bool, kept: Path) -> Outcome:
    path = kept / f"{variant}-{seed}.pickle"
    try:
        return pickle.loads(path.read_bytes())
    except (OSError, EOFError, pickle.UnpicklingError):
        made = fit(_shared["data"], variant, seed, tiny)
    part = path.with_suffix(".part")
    part.write_bytes(pickle.dumps(made))
    part.replace(path)
    return made


def fit(data: Data, variant: str, seed: int, tiny: bool = False) -> Outcome:
    """Train or fit one variant on one seed and score it."""
    network, notes = None, None
    if variant in REFERENCES:
        predict, notes = _reference(variant, data, tiny)
    else:
        predict, network = _trained(recipe(variant, tiny), data, seed)
    scores = {split: score(predict, held_out(data, split)) for split in SPLITS}
    return Outcome(variant, seed, scores, network, notes)


def _trained(chosen: Recipe, data: Data, seed: int) -> tuple[Predictor, SlewNetwork | None]:
    from learning.slew.training import train

    trajectories = data.training(chosen.closed_loop)
    trained = train(trajectories, chosen, seed)
    if not exportable(chosen):
        return trained.predictor(), None
    network = with_region(trained.network(), trajectories, chosen.mirror or chosen.symmetric)
    return predictor(network), network


def _reference(variant: str, data: Data, tiny: bool) -> tuple[Predictor, Mapping[str, Any]]:
    fitted = first_order.fit(data.train) if variant == "first_order" else grey_box.fit(data.train, tiny=tiny)
    return fitted.predictor(), fitted.figures()


def table(outcomes: Sequence[Outcome], data: Data, split: str = "test", seed: int = 0) -> dict[str, Any]:
    """Variant -> means over seeds and windows, 95 % intervals, ratios to `proposed`, validation figures."""
    names = list(dict.fromkeys(o.variant for o in outcomes))
    recordings = held_out(data, split).names  # those that are long enough
    found: dict[str, Any] = {}
    errors = {
        n: _by_recording([o for o in outcomes if o.variant == n], split, len(recordings)) for n in names
    }
    base = errors.get(PROPOSED.name)
    for name in names:
        own = [o for o in outcomes if o.variant == name]
        entry: dict[str, Any] = _figures(errors[name], seed)
        entry["seeds"] = len(own)
        entry["validation"] = {
            f"{k}_mae": float(np.mean([getattr(o.scores["validation"], f"{k}_mae") for o in own]))
            for k in ("velocity", "position")
        }
        entry["noise"] = _noise(own, split)
        if base is not None and name != PROPOSED.name:
            entry["ratio_to_proposed"] = _ratios(errors[name], base, seed)
        if own[0].notes:
            entry["parameters"] = dict(own[0].notes)
        found[name] = entry
    return found


def _noise(own: Sequence[Outcome], split: str) -> dict[str, float]:
    """By how much a figure may differ when the same training is done again, on another processor."""
    found = {}
    for key in ("velocity_mae", "position_mae"):
        values = np.array([getattr(o.scores[split], key) for o in own])
        deviation = float(values.std(ddof=1)) if len(values) > 1 else 0.0
        found[key] = max(NOISE_DEVIATIONS * deviation, LEAST_NOISE * float(values.mean()))
    return found


def _by_recording(outcomes: Sequence[Outcome], split: str, count: int) -> np.ndarray:
    """Sums and numbers [seeds, recordings, 3]: velocity errors, position errors, windows."""
    sums = np.zeros((len(outcomes), count, 3))
    for row, outcome in zip(sums, outcomes, strict=True):
        scores = outcome.scores[split]
        for i, values in enumerate((scores.velocity, scores.position, np.ones(len(scores.velocity)))):
            np.add.at(row[:, i], scores.owner, values)
    return sums


def _figures(sums: np.ndarray, seed: int) -> dict[str, Any]:
    means = _mean(sums)
    spread = np.array([_mean(sums[np.ix_(s, r)]) for s, r in _resamples(sums, seed)])
    low, high = np.quantile(spread, [0.025, 0.975], axis=0)
    keys = ("velocity_mae", "position_mae")
    intervals = {k: [float(low[i]), float(high[i])] for i, k in enumerate(keys)}
    return {**{k: float(means[i]) for i, k in enumerate(keys)}, "ci95": intervals}


def _ratios(sums: np.ndarray, base: np.ndarray, seed: int) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    found = []
    for s, r in _resamples(sums, seed):
        b = rng.integers(len(base), size=len(base))
        found.append(_mean(sums[np.ix_(s, r)]) / _mean(base[np.ix_(b, r)]))
    low, high = np.quantile(np.array(found), [0.025, 0.975], axis=0)
    whole = _mean(sums) / _mean(base)
    return {
        k: {"ratio": float(whole[i]), "ci95": [float(low[i]), float(high[i])]}
        for i, k in enumerate(("velocity_mae", "position_mae"))
    }


def _mean(sums: np.ndarray) -> np.ndarray:
    total = sums.sum(axis=(0, 1))
    return total[:2] / total[2]


def _resamples(sums: np.ndarray, seed: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Indices of seeds and recordings, drawn with replacement; the recordings the same for every variant."""
    rng, own = np.random.default_rng(seed), np.random.default_rng(seed + 1)
    for _ in range(RESAMPLES):
        recordings = rng.integers(sums.shape[1], size=sums.shape[1])
        yield own.integers(sums.shape[0], size=sums.shape[0]), recordings


def winner(found: Mapping[str, Any], among: Sequence[str]) -> str:
    """The variant that is best on validation: the smaller geometric mean of both errors."""

    def cost(name: str) -> float:
        v = found[name]["validation"]
        return v["velocity_mae"] * v["position_mae"]

    return min((n for n in among if n in found), key=cost)
