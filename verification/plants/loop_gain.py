"""Loop gains: how strongly and how late a controller answers what its own joystick does to a plant.

The loop is cut at the slew joystick.  A sine on the joystick drives the plant, arm at rest; the controller
gets the sensors of that run, with its target where the slew swings about.  What the answer says is in
`baselines.margins.loop`.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from baselines.margins.loop import FREQUENCIES_HZ, SETTLE_S, Loop, share
from baselines.registry import Controller
from fmus.toolchain.build import build_fmu
from orchestrator.run.simulate import simulate
from orchestrator.system.assembly import assemble
from orchestrator.system.check import load_system
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from records.record import Record
from records.targets import XYZ
from specs import systems
from specs.progress import Report
from specs.scenario import TICK_S
from verification.plants.character import still
from verification.plants.plant import Plant
from verification.runs import SLOT, plant_parameters

RUN_S = 24.0  # of a run
SHOWN_HZ = (0.3, 0.5, 1.0, 2.0, 3.0)  # columns of the table
SEEN = 0.005  # gains from which a phase is shown
COLUMNS = (
    *(f"{f:g} Hz" for f in SHOWN_HZ),
    "largest from 1 Hz",
    "at Hz",
    "gain margin",
    "at Hz",
    "delay margin s",
)


def measure(
    controllers: Sequence[Controller], on: Sequence[Plant], amplitude: float, report: Report
) -> dict[str, dict[str, Loop]]:
    """controller -> plant -> its loop, at a joystick of ± `amplitude`."""
    fmus = {c.name: load_system(build_fmu(c.path, 2), TICK_S) for c in controllers}
    found: dict[str, dict[str, Loop]] = {c.name: {} for c in controllers}
    for number, plant in enumerate(on):
        report(f"loops on {plant.name}", number, len(on))
        system = assemble(systems.load(plant.system).without(SLOT), plant.models)
        driven = [swung(system, plant, f, amplitude) for f in FREQUENCIES_HZ]
        for c in controllers:
            answers = [
                share(answer(fmus[c.name], c, plant, record, there(record)), f)
                / share(record.column("u_slew"), f)
                for f, record in zip(FREQUENCIES_HZ, driven, strict=True)
            ]
            found[c.name][plant.name] = Loop(np.array(answers))
    return found


def swung(system: System, plant: Plant, frequency_hz: float, amplitude: float) -> Record:
    """A plant without its controller, its joystick a sine."""
    scenario, ticks = still(RUN_S), round(RUN_S / TICK_S)
    turn = 2 * math.pi * frequency_hz * TICK_S
    stimuli = {k: {"u_slew": amplitude * math.sin(turn * k)} for k in range(ticks)}
    values = plant_parameters(system, plant.system, scenario.parameters(1))
    return simulate(system, ticks, Stimuli(stimuli), values, seed=1)


def there(record: Record) -> dict[str, float]:
    """Target, load and pace: the target is where the slew swings about."""
    scenario = still(RUN_S)
    mean = math.degrees(float(np.mean(record.column("true_q_slew")[record.time >= SETTLE_S])))
    place = replace(scenario.targets[0], slew_deg=mean).xyz
    return scenario.stimuli()[0] | dict(zip(XYZ, place, strict=True))


def answer(one: System, c: Controller, plant: Plant, record: Record, told: Mapping[str, float]) -> np.ndarray:
    """The slew joystick [n] of a controller, a system of its own, that sees what a run's sensors showed."""
    spec = systems.load(plant.system)
    seen = {
        k.target.name: record.column(k.source.name)
        for k in (*spec.connections, *spec.offered)
        if k.target.component == SLOT and k.source.component and k.target.name in one.inputs
    }
    stimuli = {k: {n: float(v[k]) for n, v in seen.items()} for k in range(len(record.time))}
    stimuli[0] |= {n: v for n, v in told.items() if n in one.inputs}
    (component,) = one.components
    settings = {f"{component}.{n}": v for n, v in c.settings.items()}
    return simulate(one, len(record.time) - 1, Stimuli(stimuli), settings).column("u_slew")


def rows(found: Mapping[str, Mapping[str, Loop]]) -> Iterator[list[str]]:
    """(controller, plant, COLUMNS): gain and phase as negative feedback, then the margins."""
    for controller, by_plant in found.items():
        for plant, loop in by_plant.items():
            phase = np.degrees(np.unwrap(np.angle(-loop.answers)))
            at = [int(np.argmin(np.abs(np.array(FREQUENCIES_HZ) - f))) for f in SHOWN_HZ]
            cells = [_cell(abs(loop.answers[k]), phase[k]) for k in at]
            f, gain = loop.fastest
            cells += [f"{gain:.2f}", f"{f:.1f}", f"{loop.gain_margin:.1f}"]
            cells += [f"{loop.in_phase[0]:.1f}" if loop.in_phase else "–", f"{loop.delay_margin_s:.2f}"]
            yield [controller, plant, *("–" if c in ("nan", "inf") else c for c in cells)]


def _cell(gain: float, phase_deg: float) -> str:
    """Gain and phase; the phase of what is next to nothing says nothing."""
    return f"{gain:.2f} {phase_deg:.0f}°" if gain >= SEEN else f"{gain:.2f}"
