"""Runs the FMUs of a laid-out system on the compiled core: configures it, starts it, reads the outcome."""

import contextlib
import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from orchestrator.core import binding
from orchestrator.core.binding import BlockStatistics, Statistics
from orchestrator.fmi.component import Component, runs_here
from orchestrator.fmi.instance import LIMIT_S, Instance
from orchestrator.fmi.model_description import REALS
from orchestrator.fmi.variable import BLOBS, ERROR, HUNG, Scalar, Value
from orchestrator.run.log_categories import told
from orchestrator.run.plan import Plan, scalars, to_bits
from orchestrator.ssp.description import Settings
from orchestrator.system.layout import Layout, Slot
from orchestrator.system.order import algebraic_loops
from orchestrator.system.system import System
from specs.errors import HungError, RunError
from specs.faults import Fault

SHOWN_INPUTS = 12  # in an error message
SHOWN_TEXT, SHOWN_TEXTS = 1000, 100  # characters of a string, elements of an array of them
HURRY_S = 2.0  # for each FMU's end, when a run has failed or was interrupted


@dataclass(frozen=True)
class Options:
    """How a system is run, beside what its description says.

    settings    algorithm and its numbers
    faults      on connections, outputs and components
    stimuli     tick -> system input -> value, held from then on
    parameters  tick -> component -> tunable parameter -> value
    seed        of the faults' random numbers
    pace        simulated seconds per second; 0: as fast as it goes
    timing      measure the time inside each FMU
    trust       run foreign FMUs in this process
    limit_s     how long one call of an FMU in a process of its own may take
    ring_rows   rows that recording may lag behind
    start_s     time of the first tick; None: that of the description
    told_stop_s, told_tolerance  what FMUs are told of the run's end and of accuracy; None: nothing
    log_categories  what they are told to log
    """

    settings: Settings = field(default_factory=Settings)
    faults: Sequence[Fault] = ()
    stimuli: Mapping[int, Mapping[str, Value]] = field(default_factory=dict)
    parameters: Mapping[int, Mapping[str, Mapping[str, Scalar]]] = field(default_factory=dict)
    seed: int | None = None
    pace: float = 0.0
    timing: bool = False
    trust: bool = False
    limit_s: float = LIMIT_S
    ring_rows: int = 4096
    start_s: float | None = None
    told_stop_s: float | None = None
    told_tolerance: float | None = None
    log_categories: Sequence[str] = ()


class Master:
    """The running system; use as a context, which frees the FMUs."""

    def __init__(
        self,
        system: System,
        layout: Layout,
        start: Mapping[str, Mapping[str, Value]],
        options: Options | None = None,
    ) -> None:
        """Instantiate all FMUs and set their `start` values (component -> variable -> value)."""
        self.system, self.layout, self.options = system, layout, options or Options()
        self.instances: list[Instance] = []
        self.running: list[Instance] = []  # initialised, and not yet terminated
        own = self.options.start_s
        self.start_s = system.start_s if own is None else own
        self.plan = Plan(system, layout, self.start_s)
        self.library, self.core = self.plan.library, self.plan.core
        try:
            self._instantiate(start)
            self._configure()
        except BaseException:
            self.free()
            raise

    def _instantiate(self, start: Mapping[str, Mapping[str, Value]]) -> None:
        ends = [end for link in self.system.clock_links for end in (link.source, link.target)]
        connected = {end.owner for end in ends}  # by clocks: their ticks are passed on at whole steps only
        here: set[str] = set()  # FMUs that allow one instance in this process, and have one
        for component in self.system.components.values():
            isolated = not runs_here(component, self.options.trust) or component.sha256 in here
            if component.model.only_once_per_process and not isolated:
                here.add(component.sha256)
            log = told(component, self.options.log_categories)
            instance = Instance(
                component, isolated, self.options.limit_s, log, component.name not in connected
            )
            self.instances.append(instance)
            instance.set_values(start[component.name])

    def _configure(self) -> None:
        plan, options = self.plan, self.options
        for position, instance in enumerate(self.instances):
            plan.block(position, instance.pointer, instance.event_mode, instance.early_return)
        plan.clocks()
        plan.moves()
        plan.settings(options.settings)
        plan.nominals()
        plan.stimuli(options.stimuli)
        plan.parameters(options.parameters)
        plan.faults(options.faults, options.seed)
        plan.call("pace", options.pace)
        plan.call("timing", options.timing)
        for name, given in self.system.inputs.items():
            self.set_input(name, given.start)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.free()

    def free(self) -> None:
        """Free core and instances."""
        self.plan.free()
        while self.instances:
            self.instances.pop().free()

    # ---- values ----

    def set_input(self, name: str, value: Value) -> None:
        """Set a system input; it holds until a stimulus changes it."""
        slot = self.layout.system_inputs[name]
        for cell, scalar in zip(slot.cells, scalars(value, slot), strict=True):
            if isinstance(scalar, str | bytes):
                data = scalar.encode() if isinstance(scalar, str) else scalar
                self.library.slw_core_write_blob(self.core, cell, data, len(data))
            else:
                self.plan.integers[cell] = to_bits(scalar, slot.type)

    # ---- running ----

    def initialise(self) -> None:
        """Bring all FMUs to time 0, outputs propagated and loops solved; RunError naming what failed."""
        said = self.options
        for instance in self.instances:
            instance.enter_initialisation(said.told_stop_s, said.told_tolerance or 0.0, self.start_s)
        self.running = list(self.instances)
        self._check(self.library.slw_core_initialise(self.core))

    def terminate(self) -> None:
        """Tell all FMUs that the run is over: they write then what they keep.

        Every one is told; after that RunError names the first that refuses.
        """
        first: RunError | None = None
        while self.running:
            try:
                self.running.pop(0).terminate()
            except RunError as error:
                first = first or error
        if first is not None:
            raise first

    def abandon(self) -> None:
        """The same after a failure or an interruption: in a hurry, and what is refused does not matter."""
        for instance in self.instances:
            instance.hurry(HURRY_S)
        while self.running:
            with contextlib.suppress(RunError):
                self.running.pop(0).terminate()

    def run(self, until: int) -> bool:
        """Step up to tick `until`; False when an FMU asked to end the simulation before.

        Raises RunError naming the component, the time and its last inputs.
        """
        return self._check(self.library.slw_core_run(self.core, until))

    def ended_by(self) -> str:
        """The component that asked to end the simulation."""
        return self.instances[self.library.slw_core_failure(self.core).contents.block].name

    def log_last(self) -> None:
        """Log the row of the present tick, the last one."""
        if not self.library.slw_core_log_last(self.core):
            raise self._failure()

    def log_finish(self) -> None:
        """No row follows."""
        self.library.slw_core_log_finish(self.core)

    @property
    def tick(self) -> int:
        """The tick the system has reached."""
        return self.library.slw_core_tick(self.core)

    def take(self, at_least: int, most: int, wait_ms: int) -> np.ndarray:
        """Rows out of the ring, cells as float64 [n, 1 + columns], the first one the tick (an int64)."""
        rows = np.empty((most, 1 + len(self.layout.logged)))
        taken = self.library.slw_core_take(self.core, rows.ctypes.data, at_least, most, wait_ms)
        return rows[:taken]

    # ---- state ----

    def snapshot(self) -> bytes:
        """The whole system's state at the present tick; RunError when an FMU cannot serialise its own."""
        size = self.library.slw_core_snapshot_size(self.core)
        data = ctypes.create_string_buffer(max(size, 1))
        if size == 0 or not self.library.slw_core_snapshot(self.core, data, size):
            raise RunError(f"system {self.system.name}: {self._state_error()}")
        return data.raw[:size]

    def restore(self, data: bytes) -> None:
        """Go to the state of a snapshot of the same system; RunError when the bytes are not of one."""
        if not self.library.slw_core_restore(self.core, data, len(data)):
            raise RunError(f"system {self.system.name}: {self._state_error()}")

    def _state_error(self) -> str:
        text = self.library.slw_core_error(self.core).decode()
        number = text.partition("block ")[2].partition(" ")[0]
        return f"component {self.instances[int(number)].name} cannot give its state" if number else text

    # ---- what came of it ----

    def messages(self) -> dict[str, list[str]]:
        """What FMUs logged, by component, as far as it is kept, and which of their clocks were never told."""
        found = {
            instance.name: [*instance.log(), *self._untold(number)]
            for number, instance in enumerate(self.instances)
        }
        return {name: lines for name, lines in found.items() if lines}

    def _untold(self, number: int) -> list[str]:
        """Countdown clocks of a component that wait for ever."""
        component = self.system.components[self.layout.blocks[number].component]
        return [
            f"countdown clock {name} never ticked: the FMU did not tell an interval"
            for name, clock in component.timed.items()
            if clock.kind == "countdown"
            and not self.library.slw_core_clock_told(self.core, number, component.model.variables[name].vr)
        ]

    def texts(self, names: Sequence[str]) -> dict[str, Value]:
        """Present values of strings and binaries (hexadecimal) by component.variable."""
        instances = {instance.name: instance for instance in self.instances}
        found: dict[str, Value] = {}
        for name in names:
            component, variable = self.system.split(name)
            found[name] = _shown(instances[component.name].values([variable])[variable])
        return found

    def statistics(self) -> dict[str, Any]:
        """Counts and times: of the system, and under "components" of each component."""
        whole, part = Statistics(), BlockStatistics()
        self.library.slw_core_statistics(self.core, ctypes.byref(whole))
        components = {}
        for number, instance in enumerate(self.instances):
            self.library.slw_core_block_statistics(self.core, number, ctypes.byref(part))
            components[instance.name] = _as_dict(part)
        return {**_as_dict(whole), "components": components}

    def _check(self, outcome: int) -> bool:
        if outcome == binding.FAILED:
            raise self._failure()
        return outcome == binding.DONE

    def _failure(self) -> RunError:
        failure = self.library.slw_core_failure(self.core).contents
        when = "during initialisation" if failure.tick < 0 else f"in the step from t = {failure.time:.6g} s"
        if failure.block == binding.SINK:
            return RunError(f"system {self.system.name} failed {when}: {self._why(failure, None)}")
        instance = self.instances[failure.block]
        if failure.status >= ERROR and instance in self.running:
            self.running.remove(instance)  # it may only be freed
        why = self._why(failure, instance)
        kind = HungError if failure.status == HUNG else RunError
        return kind(
            f"component {instance.name} failed {when}: {why}\nlast inputs: {self._inputs(failure.block)}"
        )

    def _why(self, failure: Any, instance: Instance | None) -> str:
        tolerance, halvings = self.options.settings.tolerance, self.options.settings.max_halvings
        least_s = self.system.step_s / 2 ** self.system.halvings(halvings)
        words = {
            binding.NOT_FINITE: f"output {self._cell(failure.cell)} became {self.plan.reals[failure.cell]}",
            binding.NOT_IN_TABLE: f"{self._cell(failure.cell)} = {self.plan.integers[failure.cell]} "
            "is in no entry of its mapping",
            binding.STEP_TOO_SMALL: f"{self._cell(failure.cell)} misses the tolerance {tolerance:g} with the "
            f"smallest step, {least_s:g} s{self._loops()}",
            binding.RETURNED_EARLY: "it returned early, unasked",
            binding.NO_PROGRESS: "the FMU does not advance: it returns early or iterates events without end",
            binding.INJECTED: "a fault of the scenario made it fail",
            binding.BAD_TIME: f"it says that it reached t = {failure.told:.12g} s in a step from "
            f"{failure.from_s:.12g} s to {failure.to_s:.12g} s",
        }
        named = failure.what == binding.NO_PROGRESS and failure.clock != binding.NO_CLOCK
        if named or failure.what in (binding.BAD_INTERVAL, binding.CLOCK_INSIDE):
            return self._clock(failure)
        if failure.what == binding.NO_CONVERGENCE:
            return self._not_converged(failure)
        if failure.what in words:
            return words[failure.what]
        if instance is None:
            return "no memory"
        asked = {binding.DOING_SET: "set an input", binding.DOING_GET: "get an output"}.get(failure.what)
        said = instance.status_text(failure.status)  # with what the FMU logged; without it the call helps
        doing = f", asked to {asked}," if asked and ("(" not in said or said.startswith("discard")) else ""
        return f"the FMU{doing} returned {said}"

    def _clock(self, failure: Any) -> str:
        """What is wrong with the times of a clock."""
        component = self.system.components[self.layout.blocks[failure.block].component]
        name = next((v.name for v in component.model.variables.values() if v.vr == failure.clock), None)
        if failure.what == binding.CLOCK_INSIDE:
            return _inside(component, name, failure.from_s)
        if failure.what == binding.NO_PROGRESS:
            return f"at t = {failure.from_s:.9g} s clock {name} ticks without end"
        told = failure.told
        what = {0: "that its interval is not yet known", -1: f"a shift of {told:g} s"}.get(
            failure.qualifier, f"an interval of {told:g} s"
        )
        if failure.qualifier not in (-1, 0, 1, 2):
            what = f"its interval with the unknown qualifier {failure.qualifier}"
        kind = component.timed[name].kind if name and name in component.timed else "periodic"
        valid = VALID_TIMES[kind]
        return f"at t = {failure.from_s:.9g} s the FMU tells of {kind} clock {name} {what}; valid: {valid}"

    def _not_converged(self, failure: Any) -> str:
        settings = self.options.settings
        if failure.tick >= 0:
            return (
                f"{self._cell(failure.cell)} still changes after {settings.max_iterations} iterations "
                f"(tolerance {settings.tolerance:g}){self._loops()}"
            )
        order = self.layout.order
        members = [
            self.layout.blocks[p].component
            for p, loop in zip(order.positions, order.loop, strict=True)
            if loop == failure.loop
        ]
        return (
            f"the algebraic loop of {', '.join(members)} has no solution that iteration or Newton's method "
            f"finds (tolerance {settings.tolerance:g})"
        )

    def _loops(self) -> str:
        """The algebraic loops of the system, if it has any: they are what seldom converges."""
        found = algebraic_loops(self.system)
        return "".join(f"; algebraic loop of {', '.join(members)}" for members in found)

    def _cell(self, cell: int) -> str:
        """The name of what stands in a cell."""
        for block in self.layout.blocks:
            for name, slot in {**block.inputs, **block.outputs}.items():
                if cell in slot.cells:
                    index = f"[{cell - slot.first + 1}]" if slot.size > 1 else ""
                    return (
                        f"{name}{index}"
                        if len(self.layout.blocks) == 1
                        else f"{block.component}.{name}{index}"
                    )
        return next((n for n, s in self.layout.system_inputs.items() if cell in s.cells), f"value {cell}")

    def _inputs(self, block: int) -> str:
        slots = self.layout.blocks[block].inputs
        shown = [f"{name} = {self._number(slot)}" for name, slot in slots.items()]
        more = ", …" if len(shown) > SHOWN_INPUTS else ""
        return (", ".join(shown[:SHOWN_INPUTS]) or "none") + more

    def _number(self, slot: Slot) -> str:
        if slot.type in BLOBS:
            return "…"  # the cell holds the number of the text only
        if slot.type in REALS:
            values = [f"{x:.6g}" for x in self.plan.reals[slot.first : slot.first + slot.size]]
        else:
            values = [str(x) for x in self.plan.integers[slot.first : slot.first + slot.size]]
        return values[0] if slot.size == 1 else f"({', '.join(values)})"


VALID_TIMES = {
    **dict.fromkeys(("periodic", "fixed", "tunable"), "positive intervals, shifts of 0 or more"),
    "changing": "intervals of 0 or more",
    "countdown": "intervals of 0 or more, or not yet known",
}


def _inside(component: Component, name: str | None, time: float) -> str:
    internal = component.model.fixed_internal_step_s if component.model.variable_step else None
    parts = (
        f"only in steps of {internal:g} s (fixedInternalStepSize)"
        if internal
        else ("not (canHandleVariableCommunicationStepSize); a shorter step of the system may meet it")
    )
    clock = f"clock {name}" if name else "a clock of another component that it is connected with"
    return f"{clock} ticks at t = {time:.9g} s, inside a step, which its FMU can divide {parts}"


def _shown(value: Value) -> Value:
    """Strings, and binaries in hexadecimal digits, cut to what a record's metadata should hold."""
    if isinstance(value, tuple):
        return tuple(str(_shown(v)) for v in value[:SHOWN_TEXTS])
    text = value.hex() if isinstance(value, bytes) else str(value)
    return text if len(text) <= SHOWN_TEXT else f"{text[:SHOWN_TEXT]}… ({len(text)} characters)"


def _as_dict(structure: ctypes.Structure) -> dict[str, Any]:
    return {name: getattr(structure, name) for name, _ in structure._fields_}  # type: ignore[misc]
