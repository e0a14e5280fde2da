"""A run whose inputs are set from Python between two ticks, for what sees the sensors of each tick."""

from collections.abc import Callable, Collection, Mapping

import numpy as np

from orchestrator.fmi.variable import Value
from orchestrator.run.master import Master, Options
from orchestrator.system.layout import lay_out
from orchestrator.system.system import System
from records.record import Column

Answer = Callable[[int, Mapping[str, float]], Mapping[str, float] | None]


def stepped(
    system: System,
    start: Mapping[str, Mapping[str, Value]],
    options: Options,
    ticks: int,
    sensed: Collection[str],
    answer: Answer,
    fresh: Collection[str] = (),
) -> tuple[tuple[Column, ...], np.ndarray]:
    """(columns, a row a tick with the time first) of at most `ticks` steps.

    `answer` is called after every tick with the values of the `sensed` columns and returns system inputs,
    which are in effect from the next tick on; None ends the run.  Outputs that are `fresh` it gets as they
    are at the next tick: what controllers have made of the sensors of this one.
    """
    layout, rows = lay_out(system), []
    cells = {
        name: block.outputs[name].first for block in layout.blocks for name in fresh if name in block.outputs
    }
    places = [(k, column.name) for k, column in enumerate(layout.columns) if column.name in sensed]
    with Master(system, layout, start, options) as master:
        master.plan.log(64)
        master.initialise()
        for tick in range(ticks + 1):
            if tick < ticks:
                master.run(tick + 1)
            else:
                master.log_last()
            row = master.take(1, 1, 0)[0, 1:]
            rows.append([tick * system.step_s, *row])
            seen = {name: float(row[k]) for k, name in places}
            seen |= {name: float(master.plan.reals[cell]) for name, cell in cells.items()}
            inputs = answer(tick, seen)
            if inputs is None:
                break
            for name, value in inputs.items():
                master.set_input(name, value)
        master.log_finish()
    return tuple(layout.columns), np.array(rows)
