"""One more run of a drawn case: the same machine, driven as somebody proposes, with noise of its own."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from blindtest.case import Case, Recorded
from blindtest.effects.effect import combine
from blindtest.systems.axis import absent
from blindtest.systems.system import STEP, Drive
from records.record import Column, RecordWriter
from specs.errors import InputError

TIME = Column("time", "s", "Time since the start of the run")


def extra(
    case: Case, commands: Mapping[str, np.ndarray], start: Mapping[str, float] | None = None, number: int = 0
) -> Recorded:
    """The hidden machine under `commands`, [n] each every STEP, by the plain model's inputs.

    An input that is left out stays where it mostly was in the first run.  `start`: angles, by output, where
    the run starts elsewhere than the first one did.  `number` tells several extra runs apart.
    Raises InputError for a name that the machine has not, RunError where it does not stay finite.
    """
    system = case.system
    applied = _columns(case, commands)
    rng = np.random.default_rng([case.seed, case.redrawn, 2, number])
    begin = _start(case, start or {})
    samples = len(applied)
    noise = case.surroundings.outputs * rng.standard_normal((samples, len(system.outputs)))
    disturbance = case.surroundings.disturb(samples, rng, system.disturbances)
    placed = [p.effect.enter(p.parameters(case.scale), case.scale) for p in case.placed]
    values = {b.name: b.value for b in system.base} | combine(placed, absent())
    trace = system.simulate(values, Drive(applied, kind="extra"), begin, disturbance, noise)
    noisy = trace.commands + case.surroundings.inputs * rng.standard_normal(trace.commands.shape)
    return Recorded("extra", noisy, case.surroundings.measure(trace.outputs, rng), trace.commands)


def write(case: Case, run: Recorded, path: Path) -> None:
    """The run as Parquet, as `folder.write` does those of the case."""
    signals = (*case.system.inputs, *case.system.outputs)
    columns = [TIME, *(Column(s.name, s.unit, "recorded") for s in signals)]
    rows = np.column_stack([np.arange(len(run.outputs)) * STEP, run.commands, run.outputs])
    with RecordWriter(path, columns, {"source": "simulated, hidden effects", "step": STEP}) as writer:
        writer.append(rows)


def _columns(case: Case, commands: Mapping[str, np.ndarray]) -> np.ndarray:
    names = [s.name for s in case.system.inputs]
    _check(set(commands) - set(names), "input", names)
    lengths = {len(u) for u in commands.values()}
    if len(lengths) != 1:
        raise InputError(f"commands must be of one length; they are {sorted(lengths)} samples long")
    usual = np.median(case.runs[0].applied, axis=0)
    usual[[n.endswith("_rate") and n.removesuffix("_rate") in names for n in names]] = 0.0
    columns = [commands.get(n, np.full(lengths.copy().pop(), u)) for n, u in zip(names, usual, strict=True)]
    return np.column_stack(columns)


def _start(case: Case, start: Mapping[str, float]) -> np.ndarray:
    """Initial values: of the first run, changed in the first of the outputs, which are its angles."""
    found = case.problem.runs[0].start.copy()
    names = [s.name for s in case.system.outputs[: len(found)]]
    _check(set(start) - set(names), "start of", names)
    for name, value in start.items():
        found[names.index(name)] = value
    return found


def _check(wrong: set[str], what: str, known: list[str]) -> None:
    if wrong:
        raise InputError(f"the machine has no {what} '{min(wrong)}'; valid: {', '.join(known)}")
