"""The slew drive of a plant as commissioning measures that of a machine: dead band, gain and delay.

By the angle that controllers see, arm at rest, empty grab; the joystick as in `baselines.margins.experiment`.
"""

from collections.abc import Sequence

from baselines.margins.drive import Drive, Swing, drive
from baselines.margins.experiment import FREQUENCIES_HZ, experiment
from orchestrator.run.simulate import simulate
from orchestrator.system.assembly import assemble
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from records.record import Record
from specs import systems
from specs.progress import Report
from specs.scenario import TICK_S
from verification.plants.character import still
from verification.plants.plant import Plant
from verification.runs import SLOT, plant_parameters

START_S = 2.0  # at rest, in which networks settle
ANGLE = "q_slew"


def drives(on: Sequence[Plant], report: Report) -> dict[str, Drive]:
    """plant -> its drive."""
    found = {}
    for number, plant in enumerate(on):
        report(f"drive of {plant.name}", number, len(on))
        found[plant.name] = measure(plant)
    return found


def measure(plant: Plant) -> Drive:
    """The drive of one plant; its dead bands are infinite where it never turns."""
    spec = systems.load(plant.system)
    system = assemble(spec.without(SLOT), plant.models)
    seen = next(
        k.source.name
        for k in (*spec.connections, *spec.offered)
        if k.target.component == SLOT and k.target.name == ANGLE
    )
    asked = experiment()
    bands = {sign: _dead_band(system, plant, sign) for sign in (1.0, -1.0)}
    swings = []
    for number, hz in enumerate(FREQUENCIES_HZ):
        amplitude = asked.amplitude(max(bands.values()))
        sine = [asked.sine(number, k, amplitude) for k in range(asked.sine_ticks)]
        record = _driven(system, plant, sine)
        rows = slice(round(START_S / TICK_S), None)
        swings.append(Swing(hz, record.column("u_slew")[rows], record.column(seen)[rows]))
    return drive(swings, bands, asked.settle_s)


def _dead_band(system: System, plant: Plant, sign: float) -> float:
    asked = experiment()
    ticks = round(asked.hold_s / TICK_S)
    u = [sign * level for level in asked.levels for _ in range(ticks)]
    rate = _driven(system, plant, u).column("true_qd_slew")[round(START_S / TICK_S) :]
    for number in range(len(asked.levels)):
        if asked.turns(rate[number * ticks : (number + 1) * ticks], sign):
            return asked.dead_band(number)
    return float("inf")


def _driven(system: System, plant: Plant, joystick: Sequence[float]) -> Record:
    start, values = round(START_S / TICK_S), still(START_S).parameters(1)
    stimuli = {0: {"u_slew": 0.0}} | {start + k: {"u_slew": float(u)} for k, u in enumerate(joystick)}
    known = plant_parameters(system, plant.system, values)
    return simulate(system, start + len(joystick), Stimuli(stimuli), known, seed=1)
