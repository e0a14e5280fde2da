"""What the scan works with: a control core that computes, and ports that bring values in and out."""

from typing import Protocol

import numpy as np


class Core(Protocol):
    """The control core: no clock, no I/O; the same inputs and state give the same bytes."""

    def step(self, inputs: np.ndarray, tick: int) -> np.ndarray:
        """Outputs (structured, without dimensions) from inputs; the array may be the core's own."""
        ...

    def snapshot(self) -> bytes:
        """All of its state."""
        ...

    def restore(self, snapshot: bytes, /) -> None:
        """Continue from a snapshot."""
        ...


class Port(Protocol):
    """A way in and out of the process image, with a bounded amount of work in each cycle."""

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """Put what has come into the image, and the ages of what has not."""
        ...

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """Send what is due; never waits."""
        ...

    def flags(self) -> int:
        """`Flag` bits of what is wrong with it now."""
        ...

    def received_ns(self) -> int:
        """CLOCK_MONOTONIC when the sensor message came that this cycle's commands rest on; 0: none."""
        ...
