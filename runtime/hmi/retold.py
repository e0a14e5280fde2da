"""The ladder of a recording: the core that ran is run again, and asked what a live page shows.

A recording holds images and, at the start of each segment, the core's state, but not which of its conditions
held.  Where the bundle that ran is there, repeating a segment (a replay) tells it.
"""

import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from runtime import bundle as bundles
from runtime.control import ControlCore
from runtime.hmi.around import of_bundle
from runtime.hmi.cells import LADDER
from runtime.image import INPUT
from runtime.policy import open_core
from runtime.recorder.feed import TIMING
from runtime.recorder.reader import Recording, Snapshot
from runtime.recorder.replay import Repetition, bundle_of, check_identity, identity
from specs.errors import InputError
from specs.version import VERSION

SIMULATED = "the record of a simulation holds no state of the controller"


class Retold:
    """Asks a core about segments; for several threads."""

    def __init__(self, core: ControlCore) -> None:
        """`core`: that of the bundle that ran, for this alone."""
        self.around = of_bundle(bundles.scene_of(core.bundle.folder))
        self._core, self._lock = core, threading.Lock()

    def of(self, path: Path, every: int) -> np.ndarray:
        """What `slr_ladder` told after every `every`-th tick of a segment; zeros where that is not known."""
        with self._lock:
            return np.concatenate([np.zeros(0, LADDER), *self._told(path, every)])

    def _told(self, path: Path, every: int) -> list[np.ndarray]:
        run, found, number = Repetition(self._core), [], 0
        for item in Recording(path).items():
            if isinstance(item, Snapshot):
                run.pending = item
                continue
            repeated = run.tick(item.entry)
            if number % every == 0:
                told = np.zeros(1, LADDER)
                if repeated:
                    inputs = np.frombuffer(item.entry, INPUT.dtype, 1, TIMING.size).reshape(())
                    self._core.ladder(inputs.copy(), told)
                found.append(told)
            number += 1
        return found


def retold(path: Path, folder: Path | None) -> tuple[Retold | None, str]:
    """For the recording at `path`, with the bundle in `folder` (None: where it was); or why there is none.

    Raises InputError for a bundle in `folder` that is another one than ran.
    """
    if path.suffix == ".parquet":
        if folder:
            raise InputError(f"--bundle is for recordings of the runtime; {SIMULATED}")
        return None, SIMULATED
    metadata = Recording(path).metadata()
    if folder:
        return Retold(_core(metadata, bundles.load(folder))), ""
    try:
        return Retold(_core(metadata, bundle_of(metadata))), ""
    except InputError as error:
        return None, str(error)


def _core(metadata: Mapping[str, Any], bundle: bundles.Bundle) -> ControlCore:
    check_identity(metadata, identity(bundle.identity, VERSION))
    return open_core(bundle)
