"""The control core and the reference machine in one process, tick by tick, as fast as it goes.

As in a simulated system (and with one cycle of input and output, as on the machine): what the core puts out
at tick k from the sensors of tick k moves the valves from tick k + 1 on.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from deployment.hil.machine import COMMANDS, Machine, within_field
from deployment.hil.panel import ARMING_TICKS, Panel, sensor_names
from deployment.hil.wires import Wires
from records.metrics import Metrics, compute
from records.record import Record
from runtime.control import ControlCore
from runtime.image import INPUT, OUTPUT
from specs import draws
from specs.scenario import TICK_S, Scenario

TARGETS = ("target_x", "target_y", "target_z", "load_told", "pace")
CORE = tuple(s.name for s in OUTPUT.signals if s.name not in COMMANDS)
Change = Callable[[np.ndarray, int], None]  # of the input image of a tick, before the core sees it
Look = Callable[[np.ndarray, np.ndarray, int], None]  # at both images of a tick, after it


def lockstep(
    core: ControlCore,
    scenario: Scenario,
    seed: int = 1,
    ticks: int | None = None,
    *,
    which: str = draws.NOMINAL,
    pace: float = 1.0,
    change: Change | None = None,
    look: Look | None = None,
    panel: Panel | None = None,
    wires: Wires | None = None,
) -> Record:
    """Run `scenario` (or its first `ticks`) with a freshly reset core; the record, one row a tick.

    With `wires` every value goes through its CAN frame, with its quantum and cycle.  `change` may disturb the
    input image of a tick before the core sees it, `look` sees both images after it.
    Columns: time, targets, what the core sends, commands at the valves, the machine's sensors and true
    states.
    """
    panel = panel or Panel(scenario, pace)
    core.reset()
    image, sensors = INPUT.new(), sensor_names()
    rows = []
    commands: dict[str, float] = dict.fromkeys(COMMANDS, 0.0)
    with Machine(scenario, seed, which) as machine:
        for tick in range(-ARMING_TICKS, (scenario.duration_ticks if ticks is None else ticks) + 1):
            truth = machine.outputs()
            panel.write(image, tick, {n: within_field(n, truth[n]) for n in sensors})
            if wires:
                wires.bring(image, tick)
            if change:
                change(image, tick)
            outputs = core.step(image, tick)
            if look:
                look(image, outputs, tick)
            if tick < 0:
                continue
            rows.append(_row(tick, image, outputs, commands, machine.values))
            machine.advance(commands)
            commands = {n: float(outputs["value"][OUTPUT.index[n]]) for n in COMMANDS}
            commands = wires.commands(outputs, tick) if wires else commands
        columns = ["time", *TARGETS, *CORE, *COMMANDS, *machine.names]
    return Record.from_rows(columns, np.array(rows), _meta(core, scenario, seed, which))


def drive(core: ControlCore, scenario: Scenario, seed: int = 1) -> Metrics:
    """The four metrics of a run."""
    return compute(lockstep(core, scenario, seed))


def _row(
    tick: int, image: np.ndarray, outputs: np.ndarray, commands: dict[str, float], truth: np.ndarray
) -> list[float]:
    targets = [float(image["value"][INPUT.index[n]]) for n in TARGETS]
    sent = [float(outputs["value"][OUTPUT.index[n]]) for n in CORE]
    return [tick * TICK_S, *targets, *sent, *commands.values(), *truth.tolist()]


def _meta(core: ControlCore, scenario: Scenario, seed: int, which: str) -> dict[str, Any]:
    return {
        "system": "reference",
        "scenario": scenario.name,
        "controller": core.bundle.controller,
        "bundle": core.bundle.digest,
        "machine": which,
        "seed": seed,
        "step_s": TICK_S,
        "targets": scenario.schedule(),
        "target_interval_s": scenario.interval_s,
        "load_kg": scenario.true_load(seed),
        "load_told_kg": scenario.load.told_kg,
    }
