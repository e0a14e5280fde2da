"""How large and how quick everything is that recordings show: outputs, states, what acts at every port."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from reconcile.catalogue import Scales
from reconcile.equations import motion, sites
from reconcile.equations.model import ALL_OUTPUTS
from reconcile.equations.ports import Axis
from reconcile.filter.kalman import Filtered, Kalman
from reconcile.recordings.data import Run
from reconcile.recordings.noise import high_pass_level, quantum

MIDDLE = (0.02, 0.98)  # quantiles within which accelerations count


@dataclass(frozen=True)
class Floor:
    """Noise level of an output and where it is from."""

    level: float
    source: str


class Sizes:
    """Of a filter's folder and its runs; `period` the shortest of their samples (s)."""

    def __init__(self, kalman: Kalman, runs: Sequence[Run], period: float):
        self.kalman, self.runs, self.period = kalman, runs, period
        self.folder, self.model, self.outputs = kalman.folder, kalman.folder.model, kalman.outputs
        self.duration_s = max(r.end_s - r.start_s for r in runs)
        self.spread = {n: float(np.std(self.values(n))) or 1.0 for n in self.outputs}
        self.step = {n: max(quantum(r.outputs[n].values) for r in runs) for n in self.outputs}
        self.memory_s = min(self._memory_s(n) for n in self.outputs)

    def values(self, output: str) -> np.ndarray:
        """All that the recordings show of an output."""
        return np.concatenate([r.outputs[output].values for r in self.runs])

    def noise(self, output: str) -> float:
        """Of an output, as samples in a row show it."""
        return float(np.sqrt(np.mean([high_pass_level(r.outputs[output].values) ** 2 for r in self.runs])))

    @cached_property
    def floors(self) -> dict[str, Floor]:
        """Noise of every output: the sensor's specification, unless the recording is noisier than that."""
        return {n: self._floor(n) for n in self.outputs}

    def _floor(self, output: str) -> Floor:
        steps = self.step[output] / np.sqrt(12.0)
        seen = max(self.noise(output), steps, 1e-7 * float(np.max(np.abs(self.values(output)))))
        sensor = self.model.sensors.get(output)
        if sensor and sensor.noise:
            start = next(p.start for p in self.model.parameters if p.name == sensor.noise)
            if start > 0 and seen < 1.5 * start:
                return Floor(float(np.hypot(start, steps)), "sensor specification")
        return Floor(seen, "high-pass estimate")

    def _memory_s(self, output: str) -> float:
        """Time (s) over which an output forgets half of where it was."""
        found = []
        for r in self.runs:
            s = r.outputs[output]
            v = s.values - np.mean(s.values)
            if len(v) > 8 and np.any(v):
                f = np.fft.rfft(v, 2 * len(v))
                c = np.fft.irfft(np.abs(f) ** 2)[: len(v)]
                below = np.flatnonzero(c < 0.5 * c[0])
                found.append(float(s.period_s * (below[0] if len(below) else len(v))))
        return float(np.median(found)) if found else 1.0

    def states(self) -> np.ndarray:
        """Sizes of states: of outputs that show them, of their rates by the time in which these forget."""
        model, scale = self.model, np.array([v.nominal or 0.0 for v in self.model.states])
        shown = {i: n for i, n, _ in self.kalman.shown}
        for i, n in shown.items():
            scale[i] = max(self.spread[n], 1e-12)
        for axis in self.folder.ports.axes:
            v = model.index("states", axis.velocity)
            q = model.index("states", axis.position) if axis.position else None
            if v not in shown and q in shown:
                scale[v] = scale[q] / self._memory_s(shown[q])
            elif q is not None and q not in shown and v in shown:
                scale[q] = scale[v] * self._memory_s(shown[v])
        start = np.abs(np.asarray(model.x0(np.array([p.start for p in model.parameters]))).ravel())
        return np.where(scale > 0.0, scale, np.maximum(start, 1.0))

    def scales(self, run: Sequence[Filtered]) -> dict[str, Scales]:
        """At all ports, from the filtered states of the recordings."""
        n = len(self.model.states)
        z = np.vstack([f.z[:, :n] for f in run])
        fast = [
            np.diff(f.z[:, :n], axis=0) / np.diff(r.time)[:, None]
            for f, r in zip(run, self.kalman.records, strict=True)
        ]
        found = self._of_channels()
        at_sites = sites.scales(self.model, self.folder.ports, z, self.runs, self.period)
        found |= {name: replace(x, memory_s=self.memory_s) for name, x in at_sites.items()}
        for axis in self.folder.ports.axes:
            found[axis.name] = self._of_axis(axis, z, np.vstack(fast), found)
        return found

    def _of_channels(self) -> dict[str, Scales]:
        times = Scales(period_s=self.period, memory_s=self.memory_s)
        found = {ALL_OUTPUTS: times}
        for name in [v.name for v in self.model.inputs]:
            values = np.concatenate(
                [r.inputs[name].values for r in self.runs if name in r.inputs] or [np.ones(1)]
            )
            size = float(np.max(np.abs(values))) or 1.0
            found[name] = replace(times, u=size, duration_s=self.duration_s)
        for name in self.outputs:
            size = float(np.max(np.abs(self.values(name)))) or 1.0
            found[name] = replace(times, y=size, step=self.step[name])
        return found

    def _of_axis(self, axis: Axis, z: np.ndarray, fast: np.ndarray, found: Mapping[str, Scales]) -> Scales:
        units = {v.name: v.unit for v in self.model.states}
        i = self.model.index("states", axis.velocity)
        v, a = z[:, i], fast[:, i]
        q = z[:, self.model.index("states", axis.position)] if axis.position else np.array([-1.0, 1.0])
        inertia = self.kalman.whole.inertia(axis)
        size = float(np.sqrt(np.mean(np.clip(a, *np.quantile(a, MIDDLE)) ** 2)))
        return Scales(
            v=float(np.quantile(np.abs(v), 0.98)) or 1.0,
            q=float(np.max(np.abs(q))) or 1.0,
            q_low=float(np.min(q)),
            q_high=float(np.max(q)) if np.ptp(q) > 0 else float(np.min(q)) + 1.0,
            angular=units.get(axis.position or "") == "rad",
            inertia=inertia,
            f=inertia * size or 1.0,
            drive=inertia * self._by_inputs(axis, np.mean(z, axis=0), found),
            period_s=self.period,
            memory_s=self.memory_s,
        )

    def _by_inputs(self, axis: Axis, x: np.ndarray, scales: Mapping[str, Scales]) -> float:
        """Acceleration of an axis by the largest of the inputs, one by one, around a state."""
        p = np.array([v.start for v in self.model.parameters])  # as the inertia is
        found = []
        for k, v in enumerate(self.model.inputs):
            u = scales[v.name].u * np.eye(len(self.model.inputs))[k]
            found.append(abs(motion.by_inputs(self.model, axis, x, u, self.kalman.modes[0][0], p)))
        return max((a for a in found if np.isfinite(a)), default=0.0)
