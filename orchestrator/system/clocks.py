"""Steps of components as multiples of the system's, and the clocks of FMI 3 that tick on them.

Periodic input clocks whose interval and shift are whole multiples of the component's step tick with the grid;
the others divide steps, of FMUs that allow it.  Connections between clocks are those of `clock_links.py`.
Source: FMI 3.0.2, 2.2.8, 2.4.4 and 4.2.2.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from orchestrator.fmi.component import Component, TimedClock
from orchestrator.fmi.variable import ClockInfo
from orchestrator.ssp.description import Simulation
from orchestrator.system.clock_links import ClockLink, targets
from orchestrator.system.graph import Graph
from specs.errors import InputError, nearest

SLACK = 1e-9  # relative: 0.1 / 0.02 is not quite 5
MAX_MULTIPLE = 2**31
DEFAULT_STEP_S = 0.02  # of a system that states none
MAX_DENOMINATOR = 10**9  # of a step as a fraction: 1 ns


def with_steps_and_clocks(
    graph: Graph,
    components: Mapping[str, Component],
    simulation: Simulation,
    step_s: float,
    links: Sequence[ClockLink] = (),
) -> dict[str, Component]:
    """The components with their `multiple`, `clocks` and `timed`; InputError names what is no whole multiple.

    `links`: the clocks that are connected.
    """
    for name, (_, place) in simulation.steps.items():
        if name not in components:
            raise InputError(f"{place}: no component '{name}'; {nearest(name, components)}")
    found = {}
    for component in components.values():
        multiple = _multiple(component, simulation, step_s)
        ticked = targets(links, component.name)
        found[component.name] = with_clocks(component, multiple, step_s, graph.warnings, ticked)
    return found


def check_step(step_s: float | None, shown: str) -> None:
    """InputError for a step that is no time."""
    if step_s is not None and not (step_s > 0.0 and math.isfinite(step_s)):
        raise InputError(f"{shown}: a step must be a positive time in s, not {step_s}")


def default_step(fixed: Iterable[float | None]) -> float:
    """DEFAULT_STEP_S, or the multiple nearest to it of all `fixed` internal steps that are stated."""
    internal = [Fraction(s).limit_denominator(MAX_DENOMINATOR) for s in fixed if s is not None]
    if all(whole_steps(DEFAULT_STEP_S, float(s)) for s in internal if s):
        return DEFAULT_STEP_S
    common = Fraction(1)
    for number, step in enumerate(s for s in internal if s):
        common = step if number == 0 else _common_multiple(common, step)
    return float(common) * max(1, round(DEFAULT_STEP_S / float(common)))


def _common_multiple(a: Fraction, b: Fraction) -> Fraction:
    return Fraction(math.lcm(a.numerator, b.numerator), math.gcd(a.denominator, b.denominator))


def whole_steps(time_s: float | Fraction, step_s: float) -> int | None:
    """How many steps a time is; None if that is no whole number."""
    ratio = float(time_s) / step_s
    count = round(ratio) if ratio < MAX_MULTIPLE else 0
    return count if abs(ratio - count) <= SLACK * max(1.0, ratio) else None


def _multiple(component: Component, simulation: Simulation, step_s: float) -> int:
    own, place = simulation.steps.get(component.name, (step_s, None))
    multiple = whole_steps(own, step_s)
    if not multiple:
        raise InputError(
            f"{place}: stepSize {own:g} of component '{component.name}' is not a whole multiple of the "
            f"system's, {step_s:g} s"
        )
    internal = component.model.fixed_internal_step_s
    if internal is not None and not whole_steps(own, internal):
        raise InputError(
            f"{component} steps {own:g} s, which is not a whole multiple of its fixedInternalStepSize, "
            f"{internal:g} s"
        )
    return multiple


def with_clocks(
    component: Component, multiple: int, step_s: float, warnings: list[str], connected: Sequence[str] = ()
) -> Component:
    """The component with its multiple and the input clocks that tick: those of the grid, and the others.

    `multiple`: the component steps once in so many ticks of `step_s`; `connected`: clocks that others tick.
    Raises InputError for a clock that the FMU cannot tick at its times; `warnings` get one that nobody ticks.
    """
    grid: dict[str, tuple[int, int]] = {}
    timed: dict[str, TimedClock] = {}
    for variable in component.model.variables.values():
        clock = variable.clock
        if clock is None or variable.causality != "input" or variable.name in connected:
            continue
        if not clock.time_based:
            warnings.append(f"{component}: triggered clock {variable.name} is not connected and never ticks")
            continue
        if not component.model.has_event_mode:
            raise InputError(f"{component}: its FMU has clock {variable.name}, but no event mode")
        counts = _ticks(clock, multiple, step_s)
        if counts is None:
            timed[variable.name] = _timed(component, variable.name, clock, multiple * step_s)
        else:
            grid[variable.name] = counts
    return replace(component, multiple=multiple, clocks=grid, timed=timed)


def _ticks(clock: ClockInfo, multiple: int, step_s: float) -> tuple[int, int] | None:
    """Shift and interval in ticks of the system; None where they are not stated, or no whole steps."""
    if clock.interval_s is None:
        return None
    shift, interval = (whole_steps(t, multiple * step_s) for t in (clock.shift_s, clock.interval_s))
    return None if shift is None or not interval else (shift * multiple, interval * multiple)


def _timed(component: Component, name: str, clock: ClockInfo, step_s: float) -> TimedClock:
    if clock.interval_s is None:
        return TimedClock(clock.interval_variability, clock.supports_fraction)
    if not component.model.variable_step:
        raise InputError(
            f"{component}: clock {name} ticks every {float(clock.interval_s):g} s from "
            f"{float(clock.shift_s):g} s on: no whole multiples of its step, {step_s:g} s, and its FMU "
            "allows no other steps (canHandleVariableCommunicationStepSize)"
        )
    return TimedClock("periodic", shift_s=float(clock.shift_s), interval_s=float(clock.interval_s))
