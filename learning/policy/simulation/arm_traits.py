"""How a machine's arm answers its references: what it loses of small ones, its gain, its ringing on the oil.

    slewright collect arm_steps --machine tuning:0          # and others
    python -m learning.policy.simulation.arm_traits [COLLECTION...]    # out/collect/arm_steps-*

From steps of the references and the encoders' angles alone: what a recipe's `dead_rate`, `arm_gain`, `oil_hz`
and `oil_damping` stand for.  A damping at the end of what is tried: it does not ring, and its Hz say nothing.
"""

import sys
from collections.abc import Iterator, Sequence
from itertools import pairwise, product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from learning.collection import manifest
from records.formats import read_measurement
from records.measurement import Measurement

JOINTS = ("boom", "stick")
SETTLED_S, RUNG_S = 1.0, 0.3  # after a step: until the rate is even; until the arm rings freely
WHOLE_S = 1.5  # what is shorter is no step of the plan
STRONG = 0.04  # rad/s: stops from such references ring above the encoder's noise
HZ, DAMPING = np.linspace(0.8, 4.0, 65), np.linspace(0.02, 0.4, 20)  # tried
DECAY_S = (0.1, 0.2, 0.4, 0.8)  # of what does not ring
Array = NDArray[np.float64]
Step = tuple[float, float, Array, Array]  # reference before it and during it [rad/s], time [s], angle [rad]


def steps(one: Measurement, joint: str) -> Iterator[Step]:
    """What a joint does while its reference stays the same; time from the beginning of it."""
    told, angle = one[f"qd_{joint}_ref"], one[f"q_{joint}"]
    reference = told.values[np.searchsorted(told.time, angle.time + 1e-6, side="right") - 1]
    cuts = np.flatnonzero(np.diff(reference)) + 1
    for a, b in pairwise([*cuts, len(reference)]):
        if angle.time[b - 1] - angle.time[a] > WHOLE_S:
            yield reference[a - 1], reference[a], angle.time[a:b] - angle.time[a], angle.values[a:b]


def lost_and_gain(found: Sequence[Step]) -> tuple[float, float]:
    """(rad/s of a reference that do not arrive, gain of the rest) of steps away from rest."""
    pairs = [
        (abs(to), abs(np.polyfit(t[t > SETTLED_S], q[t > SETTLED_S], 1)[0])) for _, to, t, q in found if to
    ]
    asked, got = np.array(pairs).T
    tried = np.linspace(0.0, asked.max() / 2, 201)
    moved = np.maximum(asked - tried[:, None], 0.0)
    gain = (moved @ got) / (moved**2).sum(axis=1)
    best = np.argmin(((gain[:, None] * moved - got) ** 2).sum(axis=1))
    return float(tried[best]), float(gain[best])


def ringing(found: Sequence[Step]) -> tuple[float, float]:
    """(Hz, damping) after stops: one decaying wave beside one plain decay, least squares over all of them."""
    stops = [(t[t > RUNG_S], q[t > RUNG_S]) for was, to, t, q in found if to == 0 and abs(was) >= STRONG]
    left = {
        (f, d): sum(min(_left(t, q, f, d, s) for s in DECAY_S) for t, q in stops)
        for f, d in product(HZ, DAMPING)
    }
    return min(left, key=lambda pair: left[pair])


def _left(t: Array, q: Array, hz: float, damping: float, decay: float) -> float:
    """Squared residual of angles: constant, wave, decay."""
    w = 2 * np.pi * hz
    wave = np.exp(-damping * w * t)
    basis = np.stack(
        [np.ones_like(t), wave * np.sin(w * t), wave * np.cos(w * t), np.exp(-t / decay)], axis=1
    )
    return float(np.square(q - basis @ np.linalg.lstsq(basis, q, rcond=None)[0]).sum())


def traits(folder: Path) -> Iterator[tuple[str, float, float, float, float]]:
    """(joint, rad/s lost, gain, Hz, damping) of the joints that a collection's recordings step."""
    for one in (read_measurement(file) for file, _ in manifest.read(folder)[1]):
        for joint in JOINTS:
            if found := list(steps(one, joint)):
                yield (joint, *lost_and_gain(found), *ringing(found))


if __name__ == "__main__":
    folders = [Path(word) for word in sys.argv[1:]] or sorted(Path("out/collect").glob("arm_steps-*"))
    print("machine                      joint   lost rad/s  gain   Hz    damping")
    for folder in folders:
        for joint, lost, gain, hz, damping in traits(folder):
            print(f"{folder.name:28s} {joint:7s} {lost:10.4f} {gain:5.2f} {hz:5.2f} {damping:8.2f}")
