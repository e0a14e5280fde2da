"""Loop gains: how strongly and how late a controller answers what its own joystick does to a plant.

The loop is cut at the slew joystick.  A sine on the joystick drives the plant, arm at rest; the controller
gets the sensors of that run, with its target where the slew swings about.  The share of the sine in its
answer, over the joystick's, is the loop's gain and phase at that frequency, for that amplitude (a
describing function: dead bands and limits are in it).  Where the answer is in phase with the joystick, the
loop swings by itself if the answer is larger.  A drive with k times the gain has k times the loop's gain, and
one that is t later 360 f t degrees less phase, so that margins of gain and delay are in the same figures.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

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

FREQUENCIES_HZ = tuple(round(float(f), 3) for f in np.geomspace(0.3, 3.0, 25))
RUN_S, SETTLE_S = 24.0, 6.0  # of a run, and what of it is left out
SHOWN_HZ = (0.3, 0.5, 1.0, 2.0, 3.0)  # columns of the table
SEEN = 0.005  # gains from which a phase is shown
FAST_HZ = 1.0  # no motion that is wanted is faster
COLUMNS = (
    *(f"{f:g} Hz" for f in SHOWN_HZ),
    "largest from 1 Hz",
    "at Hz",
    "gain margin",
    "at Hz",
    "delay margin s",
)


@dataclass(frozen=True)
class Loop:
    """Answer over joystick, complex, at FREQUENCIES_HZ; where it is real and above 1 the loop swings."""

    answers: np.ndarray

    @cached_property
    def in_phase(self) -> tuple[float, float] | None:
        """(frequency [Hz], gain) where the answer is in phase with the joystick: the largest, if any."""
        found = []
        for k, (size, phase, turned) in enumerate(self._steps):
            if phase * (phase + turned) <= 0.0 and turned:
                way = -phase / turned
                found.append((math.exp(size[0] + way * (size[1] - size[0])), _between(k, way)))
        return max(found)[::-1] if found else None

    @property
    def _steps(self) -> Iterator[tuple[tuple[float, float], float, float]]:
        """From each frequency to the next: both logs of the gain, the phase [rad] and by what it turns."""
        size, phase = np.log(np.abs(self.answers) + 1e-12), np.angle(self.answers)
        for k in range(len(size) - 1):
            turned = (phase[k + 1] - phase[k] + np.pi) % (2 * np.pi) - np.pi
            yield (float(size[k]), float(size[k + 1])), float(phase[k]), float(turned)

    @property
    def fastest(self) -> tuple[float, float]:
        """(frequency [Hz], gain) of the largest answer from FAST_HZ on."""
        return max(
            ((f, float(abs(a))) for f, a in zip(FREQUENCIES_HZ, self.answers, strict=True) if f >= FAST_HZ),
            key=lambda row: row[1],
        )

    @property
    def swings(self) -> bool:
        """Whether it swings by itself at this amplitude, and so grows from it."""
        return self.in_phase is not None and self.in_phase[1] > 1.0

    @property
    def gain_margin(self) -> float:
        """By how much more gain the loop swings by itself; infinite where it is never in phase."""
        return 1.0 / self.in_phase[1] if self.in_phase else math.inf

    @cached_property
    def delay_margin_s(self) -> float:
        """By how much more delay it swings by itself; infinite where no answer is so large."""
        if self.swings:
            return 0.0
        found = [math.inf]
        for k, (size, phase, turned) in enumerate(self._steps):
            ways = [0.0] * (size[0] >= 0.0)
            if size[0] * size[1] < 0.0:
                ways.append(size[0] / (size[0] - size[1]))
            found += [(phase + w * turned) % (2 * math.pi) / (2 * math.pi * _between(k, w)) for w in ways]
        return min(found)

    def as_dict(self) -> dict[str, Any]:
        """For JSON: gain and phase [deg] of the loop as negative feedback, margins."""
        phase = np.degrees(np.unwrap(np.angle(-self.answers)))
        return {
            "frequency_hz": list(FREQUENCIES_HZ),
            "gain": np.abs(self.answers).tolist(),
            "phase_deg": phase.tolist(),
            "in_phase": dict(zip(("frequency_hz", "gain"), self.in_phase, strict=True))
            if self.in_phase
            else None,
            "fastest": dict(zip(("frequency_hz", "gain"), self.fastest, strict=True)),
            "gain_margin": self.gain_margin,
            "delay_margin_s": self.delay_margin_s,
            "swings": self.swings,
        }


def _between(k: int, way: float) -> float:
    """The frequency part of the way from number k to the next."""
    return FREQUENCIES_HZ[k] * (FREQUENCIES_HZ[k + 1] / FREQUENCIES_HZ[k]) ** way


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


def share(u: np.ndarray, frequency_hz: float) -> complex:
    """The complex share of a sine in a signal [n], beside its mean and drift."""
    time = np.arange(len(u)) * TICK_S
    kept = time >= SETTLE_S
    t, window = time[kept], np.sqrt(np.hanning(int(kept.sum())))
    turn = 2 * np.pi * frequency_hz * t
    basis = np.column_stack([np.cos(turn), np.sin(turn), np.ones_like(t), t - t.mean()]) * window[:, None]
    a, b, *_ = np.linalg.lstsq(basis, u[kept] * window, rcond=None)[0]
    return complex(a, -b)


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
