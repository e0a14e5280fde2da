"""Steps the FMUs of a system: Jacobi or Gauss-Seidel exchange at a fixed step, over flat buffers.

All C calls of a step are bound beforehand; a step is a gather by index and a row of calls without arguments.
This class is all that the rest knows of the stepping: `values`, `initialise`, `step`, and freeing.
"""

import ctypes
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Self

import numpy as np

from orchestrator.fmu import WARNING, Instance, instantiate
from orchestrator.layout import Block, Exchange, Layout
from orchestrator.system import System
from specs.errors import RunError

BoundCall = tuple[Callable[[], int], Block]
Stage = tuple[Callable[[], Any], tuple[BoundCall, ...]]  # gather the inputs, then these calls

FATAL = 4
SHOWN_INPUTS = 12  # in an error message


class Master:
    """The running system; use as a context, which frees the FMUs.

    values  float64 [layout.n_values]: set the system inputs here, read all outputs here
    """

    def __init__(
        self, system: System, layout: Layout, start: Mapping[str, Mapping[str, Any]], algorithm: str
    ) -> None:
        """Instantiate all FMUs and set their `start` values (component -> variable -> value)."""
        self.step_s, self.layout = system.step_s, layout
        self.values = np.zeros(layout.n_values)
        for name, position in layout.system_inputs.items():
            self.values[position] = system.inputs[name].start
        self.inputs = np.zeros(layout.n_inputs)
        self.time = ctypes.c_double(0.0)
        self.instances: list[Instance] = []
        self.fatal = False
        try:
            for component in system.components.values():
                self.instances.append(instantiate(component))
                self.instances[-1].set(**start[component.name])
        except BaseException:
            self.free()
            raise
        self.step: Callable[[int], None] = self._jacobi() if algorithm == "jacobi" else self._gauss_seidel()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.free()

    def free(self) -> None:
        """Free all instances; after a fatal error none of them may be called again, so they are left."""
        while self.instances and not self.fatal:
            self.instances.pop().free()

    def initialise(self) -> None:
        """Bring all FMUs to time 0, outputs propagated through the connections until they stand still."""
        for instance in self.instances:
            instance.enter_initialisation()
        for _ in range(len(self.instances) + 1):
            before = self.values.copy()
            self._propagate()
            if np.array_equal(before, self.values):
                break
        for instance in self.instances:
            instance.exit_initialisation()
        for block, instance in zip(self.layout.blocks, self.instances, strict=True):
            self._check(self._get(block, instance), block, -1)
        self._check_finite(-1)

    def _propagate(self) -> None:
        """Outputs to inputs, once round, in order of dependency."""
        for i in self.layout.order:
            block, instance = self.layout.blocks[i], self.instances[i]
            if block.inputs:
                _gather(self.layout.part(block), self.values, self.inputs[block.input_slice])()
                instance.check(
                    instance.setter(block.inputs, self.inputs[block.input_slice])(), "setting inputs"
                )
            self._check(self._get(block, instance), block, -1)

    def _get(self, block: Block, instance: Instance) -> int:
        return instance.getter(block.outputs, self.values[block.output_slice])() if block.outputs else 0

    # ---- the two algorithms ----

    def _jacobi(self) -> Callable[[int], None]:
        """One stage: all inputs from the last tick, all steps, then all outputs."""
        steps, gets = [], []
        for block, instance in zip(self.layout.blocks, self.instances, strict=True):
            steps += self._step_calls(block, instance)
            gets += self._get_calls(block, instance)
        gather = _gather(self.layout.exchange, self.values, self.inputs)
        return self._advance([(gather, tuple(steps + gets))])

    def _gauss_seidel(self) -> Callable[[int], None]:
        """One stage a component, in order of dependency, each on the newest values."""
        stages = []
        for i in self.layout.order:
            block, instance = self.layout.blocks[i], self.instances[i]
            gather = _gather(self.layout.part(block), self.values, self.inputs[block.input_slice])
            stages.append((gather, (*self._step_calls(block, instance), *self._get_calls(block, instance))))
        return self._advance(stages)

    def _step_calls(self, block: Block, instance: Instance) -> list[BoundCall]:
        calls = [(instance.stepper(self.time, self.step_s), block)]
        if block.inputs:
            calls.insert(0, (instance.setter(block.inputs, self.inputs[block.input_slice]), block))
        return calls

    def _get_calls(self, block: Block, instance: Instance) -> list[BoundCall]:
        if not block.outputs:
            return []
        return [(instance.getter(block.outputs, self.values[block.output_slice]), block)]

    def _advance(self, stages: list[Stage]) -> Callable[[int], None]:
        """The step function, which is the hot path, closed over all that it touches."""
        time, step_s, dot, values = self.time, self.step_s, np.dot, self.values
        zeros, fixed = np.zeros(self.layout.n_values), tuple(stages)

        def advance(tick: int) -> None:
            time.value = tick * step_s
            for gather, calls in fixed:
                gather()
                for call, block in calls:
                    status = call()
                    if status > WARNING:
                        raise self.failure(status, block, tick)
            if dot(values, zeros) != 0.0:  # 0 * inf and 0 * nan are nan, which differs from 0
                self.not_finite(tick)

        return advance

    # ---- failures ----

    def _check(self, status: int, block: Block, tick: int) -> None:
        if status > WARNING:
            raise self.failure(status, block, tick)

    def failure(self, status: int, block: Block, tick: int) -> RunError:
        """What to raise when a call for `block` returned `status` in the step from `tick`."""
        instance = self.instances[[b.component for b in self.layout.blocks].index(block.component)]
        self.fatal = status == FATAL
        return self._error(block, f"the FMU returned {instance.said(status)}", tick)

    def _check_finite(self, tick: int) -> None:
        if not np.isfinite(self.values).all():
            self.not_finite(tick)

    def not_finite(self, tick: int) -> None:
        """Raise RunError for the first component, in order of execution, with an output that is no number."""
        for i in self.layout.order:
            block = self.layout.blocks[i]
            for variable, value in zip(block.outputs, self.values[block.output_slice], strict=True):
                if not np.isfinite(value):
                    raise self._error(block, f"output {variable.name} became {value}", tick)

    def _error(self, block: Block, what: str, tick: int) -> RunError:
        when = "during initialisation" if tick < 0 else f"in the step from t = {tick * self.step_s:.6g} s"
        pairs = zip(block.inputs, self.inputs[block.input_slice], strict=True)
        shown = [f"{v.name} = {value:.6g}" for v, value in pairs][:SHOWN_INPUTS]
        more = "" if len(block.inputs) <= SHOWN_INPUTS else ", …"
        return RunError(
            f"component {block.component} failed {when}: {what}\n"
            f"last inputs: {', '.join(shown) or 'none'}{more}"
        )


def _gather(exchange: Exchange, values: np.ndarray, inputs: np.ndarray) -> Callable[[], Any]:
    """inputs = scale * values[source] + offset, bound to its buffers."""
    # The index is known to be in range; "clip" spares numpy the copy it makes to be able to raise.
    take = partial(values.take, exchange.source, None, inputs, "clip")
    return take if exchange.affine is None else partial(_convert, take, inputs, *exchange.affine)


def _convert(take: Callable[[], Any], inputs: np.ndarray, scale: np.ndarray, offset: np.ndarray) -> None:
    take()
    np.multiply(inputs, scale, out=inputs)
    np.add(inputs, offset, out=inputs)
