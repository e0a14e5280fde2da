"""Which parameters delay what: the model's own delays and those of attached effects, summed."""

from functools import cached_property

import numpy as np

from reconcile.catalogue.offset import NAME as OFFSET
from reconcile.equations.extended import Extended
from reconcile.equations.model import Attached

Delay = tuple[float, float]  # s, and what it gains per second of the recording


class Delays:
    """Delays of an extended model's inputs and of `outputs`."""

    def __init__(self, extended: Extended, outputs: list[str]):
        self._extended, self._model, self._outputs = extended, extended.model, outputs

    def of_inputs(self, p: np.ndarray) -> dict[int, float]:
        """Input -> its delay (s) with the parameters p [NP], and by how much all outputs are late."""
        all_outputs = float(sum(p[k] for k in self.offsets))
        late = dict.fromkeys(range(len(self._model.inputs)), all_outputs) if self.offsets else {}
        return late | {i: float(sum(p[k] for k in ks)) + all_outputs for i, ks in self.inputs.items()}

    def of_output(self, name: str, p: np.ndarray) -> Delay:
        """Delay of an output (s), and what it gains per second of the recording."""
        fixed, drift = (sum(p[q] for q in qs) for qs in (self.outputs[name], self.clocks[name]))
        return float(fixed), float(drift)

    @cached_property
    def inputs(self) -> dict[int, list[int]]:
        """Input -> parameters whose sum is its delay."""
        found: dict[int, list[int]] = {}
        for name, parameter in self._model.delays.items():
            found.setdefault(self._model.index("inputs", name), []).append(self._extended.index[parameter])
        for a in self._extended.attached:
            if a.effect.delays and a.effect.place == "input":
                for name in self._extended.folder.ports.members(a.port):
                    late = found.setdefault(self._model.index("inputs", name), [])
                    late.append(self._extended.index[a.name("delay")])
        return found

    @cached_property
    def outputs(self) -> dict[str, list[int]]:
        """Output -> parameters whose sum is its delay."""
        found: dict[str, list[int]] = {n: [] for n in self._outputs}
        for name, sensor in self._model.sensors.items():
            if sensor.delay and name in found:
                found[name].append(self._extended.index[sensor.delay])
        for a in self._extended.attached:
            if a.effect.delays and a.effect.place == "output" and not a.effect.clock and not self._of_all(a):
                for name in set(self._extended.folder.ports.members(a.port)) & set(self._outputs):
                    found[name].append(self._extended.index[a.name("delay")])
        return found

    @cached_property
    def offsets(self) -> list[int]:
        """Parameters whose sum is an offset in time of all outputs: inputs move instead, which is exact."""
        return [self._extended.index[a.name("delay")] for a in self._extended.attached if self._of_all(a)]

    def _of_all(self, a: Attached) -> bool:
        return a.effect.name == OFFSET and self._extended.folder.ports.holds(a.port, self._outputs)

    @cached_property
    def clocks(self) -> dict[str, list[int]]:
        """Output -> parameters whose sum is the delay that it gains per second of a recording."""
        members = self._extended.folder.ports.members
        drifts = [a for a in self._extended.attached if a.effect.clock]
        index = self._extended.index
        return {n: [index[a.name("drift")] for a in drifts if n in members(a.port)] for n in self._outputs}
