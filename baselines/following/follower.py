"""Followers of timed paths: what they are given, what they answer, and those there are.

`begin` gives a follower a path; `step` is called 50 times a second with the machine's sensors by the names of
specs/signals.toml, and answers with the commands.  A follower sees sensors only.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from baselines.following.arrival import Arrival, of_path
from baselines.following.tracker import TRACKER
from baselines.nmpc_path.follower import Predictive, pace
from baselines.planning.flat import led
from baselines.planning.path import Path
from baselines.planning.planner import Planner
from fmus.toolchain.discrete import DiscreteStepper
from specs.errors import InputError, nearest
from specs.scene import Scene


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
        self._arrival = Arrival()
        self._path: Path | None = None

    def begin(self, path: Path) -> None:
        """Follow this path."""
        if self._leads:
            path = led(path, 1.0 / self._stepper.state("inverse_length"))
        self._path = path
        self._arrival.begin(of_path(path))

    def step(self, sensors: Mapping[str, float]) -> Mapping[str, float]:
        """One step on the path, or standing at its end."""
        path = self._path
        if path is None:
            raise InputError("a follower needs a path before its first step")
        angles, rates, accelerations = path.at(self._arrival.tick)
        slew = (angles[0], rates[0], accelerations[0])
        reference = (*slew, angles[1], rates[1], angles[2], rates[2], path.angles[-1, 0])
        for k, name in enumerate(self._known):
            self._stepper.u[k] = sensors.get(name, 0.0)
        self._stepper.u[-len(reference) :] = reference
        self._stepper.advance()
        self._arrival.watch(sensors)
        return self._stepper.outputs()

    @property
    def ended(self) -> bool:
        """As `Arrival` has it."""
        return self._arrival.ended


@dataclass(frozen=True)
class Kind:
    """A follower as the command line knows it, and its paths.

    `flat`: on them the grab leads, not the arm tip; `pace`: planning parameters that differ from their file.
    """

    name: str
    label: str
    make: Callable[[Scene], Follower]
    flat: bool = False
    pace: Mapping[str, float] = field(default_factory=dict)

    def planner(self, scene: Scene) -> Planner:
        """Who plans its paths."""
        return Planner(scene, self.flat, self.pace)


KINDS = {
    kind.name: kind
    for kind in (
        Kind("floor", "planned path, feed-forward and PI", lambda _: Tracking()),
        Kind(
            "shaped", "planned path of the grab by flatness, feed-forward and PI",
            lambda _: Tracking(leads=True), flat=True,
        ),
        Kind(
            "nmpc", "planned path, model predictive control with the distances to things", Predictive,
            pace=pace(),
        ),
    )
}  # fmt: skip


def find(name: str) -> Kind:
    """The follower of this name; InputError names the valid ones."""
    if name not in KINDS:
        raise InputError(f"no follower '{name}'; {nearest(name, KINDS)}")
    return KINDS[name]
