"""Followers of timed paths: what they are given, what they answer, and those there are.

`begin` gives a follower a path; `step` is called 50 times a second with the machine's sensors by the names of
specs/signals.toml, and answers with the commands.  A follower sees sensors only.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from baselines.following.tracker import TRACKER
from baselines.planning.flat import led
from baselines.planning.path import TICK_S, Path
from fmus.toolchain.discrete import DiscreteStepper
from specs import pose, shapes
from specs.errors import InputError, nearest

STILL_S = 1.0  # that the grab is to be near its target before a path has ended
MOST_EXTRA_S = 12.0  # after the path's time: it is taken as ended even so
SENSED: tuple[str, ...] = ("q_slew", "q_boom", "q_stick", "imu_tool_pitch", "imu_tool_roll")


class Follower(Protocol):
    """What follows paths, one after the other."""

    def begin(self, path: Path) -> None:
        """Follow this path from now on; it starts where the machine is."""
        ...

    def step(self, sensors: Mapping[str, float]) -> Mapping[str, float]:
        """Commands after 0.02 s more: `u_slew`, `qd_boom_ref`, `qd_stick_ref`."""
        ...

    @property
    def ended(self) -> bool:
        """Whether the path's end condition holds."""
        ...


class Tracking:
    """Feed-forward and PI by the equations of `tracker`; `gains` differ from the parameters' files.

    With `leads` the grab is put on the path, for the length of its pendulum that the IMU has shown so far.
    """

    def __init__(self, gains: Mapping[str, float] | None = None, leads: bool = False):
        self._leads = leads
        self._stepper = DiscreteStepper(TRACKER, gains)
        self._known = [v.name for v in TRACKER.inputs]
        self._sizes = shapes.sizes()
        self._path: Path | None = None
        self._tick = 0
        self._near = 0

    def begin(self, path: Path) -> None:
        """Follow this path."""
        if self._leads:
            path = led(path, 1.0 / self._stepper.state("inverse_length"))
        self._path, self._tick, self._near = path, 0, 0

    def step(self, sensors: Mapping[str, float]) -> Mapping[str, float]:
        """One step on the path, or standing at its end."""
        path = self._path
        if path is None:
            raise InputError("a follower needs a path before its first step")
        angles, rates, accelerations = path.at(self._tick)
        self._tick += 1
        slew = (angles[0], rates[0], accelerations[0])
        reference = (*slew, angles[1], rates[1], angles[2], rates[2], path.angles[-1, 0])
        for k, name in enumerate(self._known):
            self._stepper.u[k] = sensors.get(name, 0.0)
        self._stepper.u[-len(reference) :] = reference
        self._stepper.advance()
        self._watch(sensors, path)
        return self._stepper.outputs()

    def _watch(self, sensors: Mapping[str, float], path: Path) -> None:
        """Count how long the grab has been near the target."""
        if self._tick * TICK_S < path.seconds:
            return
        grab = pose.grab(np.array([[sensors[name] for name in SENSED]]), self._sizes)[0]
        near = math.dist(grab, path.target) <= path.tolerance_m
        self._near = self._near + 1 if near else 0

    @property
    def ended(self) -> bool:
        """Near the target long enough, or waited for too long."""
        path = self._path
        if path is None:
            return True
        late = self._tick * TICK_S >= path.seconds + MOST_EXTRA_S
        return late or self._near * TICK_S >= STILL_S


@dataclass(frozen=True)
class Kind:
    """A follower as the command line knows it; `flat`: on its paths the grab leads, not the arm tip."""

    name: str
    label: str
    make: Callable[[], Follower]
    flat: bool = False


KINDS = {
    kind.name: kind
    for kind in (
        Kind("floor", "planned path, feed-forward and PI", Tracking),
        Kind(
            "shaped", "planned path of the grab by flatness, feed-forward and PI",
            lambda: Tracking(leads=True), flat=True,
        ),
    )
}  # fmt: skip


def find(name: str) -> Kind:
    """The follower of this name; InputError names the valid ones."""
    if name not in KINDS:
        raise InputError(f"no follower '{name}'; {nearest(name, KINDS)}")
    return KINDS[name]
