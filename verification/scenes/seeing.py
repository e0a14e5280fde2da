"""A policy that sees its way ahead and the distances to things (specs/ahead.py) as a follower of paths.

It runs beside the machine, as followers do, because no signal tells what it sees; its answers are those of
its ONNX file, in single precision at both ends.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from baselines.following.arrival import Arrival, of_path
from baselines.nmpc_path.field import Field
from baselines.planning.path import Path
from baselines.planning.planner import hanging
from learning.policy.export import Policy
from specs import pose
from specs.ahead import JOINTS
from specs.errors import InputError
from specs.policy import ACTIONS, SPACING_S, TICK_S, History
from specs.scene import Scene

PERIOD = round(SPACING_S / TICK_S)  # ticks between answers


class Seeing:
    """Follows paths in a scene by a policy, as `baselines.following.follower.Follower` says."""

    def __init__(self, scene: Scene, policy: Policy) -> None:
        self._policy, self._ahead = policy, policy.contract.ahead
        self._field = Field(scene) if self._ahead.field_m else None
        self._history = History(policy.contract.history)
        self._held: dict[str, float] = dict.fromkeys(ACTIONS, 0.0)
        self._arrival = Arrival()
        self._way = np.empty((0, 3))  # of the grab at each tick, m
        self._now = 0  # ticks since the scene began

    def begin(self, path: Path) -> None:
        """Follow this path from now on; it may be there before the plan."""
        self._way = hanging(path)
        self._arrival.begin(replace(of_path(path), there_s=0.0))

    def step(self, sensors: Mapping[str, float]) -> Mapping[str, float]:
        """Commands after 0.02 s more; new ones every 0.1 s."""
        if not len(self._way):
            raise InputError("a follower needs a path before its first step")
        if self._now % PERIOD == 0:
            self._held = self._answer(sensors)
        self._now += 1
        self._arrival.watch(sensors)
        return self._held

    @property
    def ended(self) -> bool:
        """As `Arrival` has it."""
        return self._arrival.ended

    def observation(self, sensors: Mapping[str, float]) -> list[float]:
        """What it sees now, in the order of its contract's layout."""
        x, y, z = self._place(self._policy.contract.lead_s)
        told = {"target_x": x, "target_y": y, "target_z": z}
        told |= {name: sensors[name] for name in ("load_told", "pace")}
        places = [self._place(seconds) for seconds in self._ahead.waypoints_s]
        entries = self._ahead.entries(sensors["q_slew"], places, *self._near(sensors))
        return [*self._history.observation(told), *entries]

    def _answer(self, sensors: Mapping[str, float]) -> dict[str, float]:
        self._history.push(sensors, self._held)
        seen = np.array(self.observation(sensors), dtype=np.float32).astype(np.float64)
        answer = self._policy(seen).astype(np.float32).tolist()
        return dict(zip(ACTIONS, answer, strict=True))

    def _place(self, seconds: float) -> tuple[float, float, float]:
        """Where the grab is to be on the way after that time, m."""
        tick = self._arrival.tick + round(seconds / TICK_S)
        x, y, z = self._way[min(tick, len(self._way) - 1)].tolist()
        return x, y, z

    def _near(self, sensors: Mapping[str, float]) -> tuple[Sequence[float], Sequence[Sequence[float]]]:
        """Distances by specs.ahead.PARTS and their slopes by JOINTS; none where they are not looked at."""
        if self._field is None:
            return (), ()
        angles = np.array([[sensors[name] for name in pose.ANGLES]])
        distances, slopes = self._field.planes(angles, self._now * TICK_S)
        return distances[0].tolist(), slopes[0, :, : len(JOINTS)].tolist()
