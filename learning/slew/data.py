"""The recordings a slew model is made from: a collection's folder or any recordings, split by recording."""

import hashlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fmus.models.slew import traces
from fmus.models.slew_nn.network import HISTORY, PERIOD_S
from learning.collection import manifest
from learning.slew import checks
from learning.slew.score import HORIZON
from learning.slew.trajectory import GROUPS, NEEDED, Trajectory, of_measurement, of_trace
from records.formats import read_measurement
from specs.errors import InputError

SPLITS = ("train", "validation", "test")
SHARES = (0.7, 0.15)  # of the recordings without a manifest: train, validation; the rest is held out
LEAST_S = (2 * HISTORY + HORIZON) * PERIOD_S  # of a recording to be judged on (ablation.BEFORE)
CLOSED_LOOP = "closed_loop"


@dataclass(frozen=True)
class Data:
    """Trajectories by split; `kinds` tells each recording's kind, `sha256` what all of it was."""

    train: tuple[Trajectory, ...]
    validation: tuple[Trajectory, ...]
    test: tuple[Trajectory, ...]
    kinds: Mapping[str, str]
    sha256: str
    source: str
    lacking: tuple[str, ...] = ()  # of trajectory.GROUPS, what the recordings do not have

    def training(self, closed_loop: bool = True) -> list[Trajectory]:
        """What to train on, with or without the recordings of closed-loop control."""
        return [t for t in self.train if closed_loop or self.kinds.get(t.name) != CLOSED_LOOP]

    def minutes(self, split: str) -> float:
        """Length of a split in minutes."""
        return sum(len(t) for t in getattr(self, split)) / 600.0


def load(paths: Sequence[Path], without: Collection[str] = ()) -> Data:
    """A collection's folder, or three or more recordings, in the order given: the last ones are held out.

    Of the groups of channels in `without`, channels may be missing.  Raises InputError naming file and
    channel for recordings that cannot be learned from.
    """
    if len(paths) == 1 and paths[0].is_dir():
        return _of_folder(paths[0], without)
    for path in paths:
        if not path.exists():
            raise InputError(f"no recording at {path}")
    if len(paths) < 3:
        raise InputError("three or more recordings are needed: to train on, to validate and to hold out")
    bounds = [max(1, round(share * len(paths))) for share in SHARES]
    bounds[0] = min(bounds[0], len(paths) - 2)
    split = [SPLITS[0]] * bounds[0] + [SPLITS[1]] * min(bounds[1], len(paths) - bounds[0] - 1)
    split += [SPLITS[2]] * (len(paths) - len(split))
    entries = [(path, {"split": s, "kind": ""}) for path, s in zip(paths, split, strict=True)]
    return _gathered(entries, ", ".join(map(str, paths)), without)


def of_traces() -> Data:
    """The slew traces: steps to train on (a tenth of them to validate), every other shape held out."""
    found = traces.load()
    steps = [of_trace(t) for t in found.values() if t.shape == "step"]
    rest = [of_trace(t) for t in found.values() if t.shape != "step"]
    digest = hashlib.sha256(b"".join(t.u.tobytes() + t.omega.tobytes() for t in [*steps, *rest])).hexdigest()
    kinds = {t.name: t.name.split("_")[0] for t in [*steps, *rest]}
    return Data(tuple(steps), tuple(steps[::10]), tuple(rest), kinds, digest, "slew traces")


def _of_folder(folder: Path, without: Collection[str]) -> Data:
    content, entries = manifest.read(folder)
    return _gathered(
        entries, f"{content['collection']}, {content['origin']}, machine {content['machine']}", without
    )


def _gathered(
    entries: Iterable[tuple[Path, Mapping[str, Any]]], source: str, without: Collection[str]
) -> Data:
    found: dict[str, list[Trajectory]] = {split: [] for split in SPLITS}
    kinds, digest, missing = {}, hashlib.sha256(), set()
    for path, entry in entries:
        measurement = read_measurement(path)
        pieces = of_measurement(measurement, path.stem, without=without)
        missing |= set(measurement.missing(NEEDED))
        for piece in pieces:
            digest.update(np.stack([piece.u, piece.p_l, piece.p_r, piece.omega, piece.inertia]).tobytes())
        kinds[path.stem] = str(entry["kind"])
        found[str(entry["split"])] += pieces
    for split in SPLITS:
        longest = max((len(t) for t in found[split]), default=0) * PERIOD_S
        if longest < LEAST_S:
            raise InputError(
                f"no recording of split {split} has {LEAST_S:g} s without a gap, the longest {longest:g} s: "
                f"{source}"
            )
    checks.check(found["train"])
    train, validation, test = (tuple(found[split]) for split in SPLITS)
    lacking = tuple(group for group, channels in GROUPS.items() if missing & set(channels))
    return Data(train, validation, test, kinds, digest.hexdigest(), source, lacking)
