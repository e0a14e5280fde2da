"""A training from iteration to iteration: going on, what is kept of it, how long it took."""

import math
import time
from pathlib import Path
from typing import Any

from learning.policy import checkpoint
from learning.policy.curve import Log
from learning.policy.recipe import Recipe
from learning.policy.simulation import finite
from specs.errors import InputError, RunError
from specs.progress import Report

KEPT_EVERY_S = 60.0  # between checkpoints


class Training:
    """A trainer and its checkpoint, which holds finite numbers only."""

    def __init__(self, trainer: Any, seed: int, kept: Path, data: str) -> None:
        self.trainer, self.seed, self.kept, self.data = trainer, seed, kept, data
        self.chosen: Recipe = trainer.recipe
        self._spent: float | None = 0.0  # processor seconds of earlier calls; None: they did not tell
        self._began = time.process_time()

    @property
    def processor_s(self) -> float | None:
        """Processor seconds from the first iteration on, over all calls; None if one did not tell."""
        return None if self._spent is None else self._spent + time.process_time() - self._began

    @property
    def last_good(self) -> str:
        """Where to go on from."""
        return (
            f"the last good checkpoint is {self.kept}"
            if self.kept.is_file()
            else "there is no good checkpoint yet"
        )

    def resume(self) -> None:
        """Go on from the checkpoint, if there is one; InputError if its numbers are none."""
        if self.kept.is_dir():
            raise InputError(f"{self.kept} is a folder; name another --out, or remove it")
        if not self.kept.is_file():
            return
        state = checkpoint.load(self.kept, self.chosen, self.seed, self.data)
        if wrong := finite.infinite(state):
            raise InputError(
                f"{self.kept}: {finite.shown(wrong)} is not a finite number; name another --out, or remove it"
            )
        self.trainer.load(state)
        self._spent = state.get("processor_s")

    def keep(self) -> None:
        """Replace the checkpoint; RunError if there is a number in it that is none."""
        state = self.trainer.state()
        if wrong := finite.infinite(state):
            raise RunError(f"iteration {self.trainer.done}: {finite.shown(wrong)} is not a number any more")
        state["processor_s"] = self.processor_s
        checkpoint.save(self.kept, self.chosen, self.seed, self.data, state)

    def iterate(self, log: Log, report: Report, stop_after: int | None = None) -> None:
        """To the end of the recipe, or of `stop_after`."""
        trainer, last = self.trainer, self.chosen.iterations
        start, began, kept = time.monotonic(), trainer.done, time.monotonic()
        if stop_after is not None:
            last = min(last, trainer.done + stop_after)
        while trainer.done < last:
            figures = trainer.iterate()
            if wrong := [name for name, value in figures.items() if not math.isfinite(value)]:
                raise RunError(f"iteration {trainer.done}: {finite.shown(wrong)} is not a number any more")
            log.add(trainer.done, figures)
            each = (time.monotonic() - start) / (trainer.done - began)
            self._tell(report, figures["reward"], each)
            if time.monotonic() - kept > KEPT_EVERY_S or trainer.done == last:
                self.keep()
                kept = time.monotonic()

    def _tell(self, report: Report, reward: float, each: float) -> None:
        done, of = self.trainer.done, self.chosen.iterations
        left = each * (of - done) / 60.0
        name = f"{self.chosen.name}, seed {self.seed}"
        report(f"{name}: reward {reward:.3f}/s, {left:.0f} min left", done, of)
