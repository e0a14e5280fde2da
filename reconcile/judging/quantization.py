"""Quantization of a sensor: are recorded values steps coarser than it is specified for, or than its noise?

Steps hardly move a simulation error (their mean square is step²/12 whatever the model does), so no fit finds
them.  They show in the values themselves, which lie on a lattice; that is tested, one output at a time:

    y' = step round(y / step)

`named`: the steps are coarser than specified, or, where no steps are specified, than all other noise.
`specified`: no coarser than the sensor may have.  `below_noise`: there, but finer than the other noise.
`fine`: coarser than the noise, but a recording of that many digits serves any purpose.

`added` puts what is named among the effects of a report, whose other effects a fit has found.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np

from fmus.definition import Model
from reconcile.filter.point import Z95
from reconcile.recordings.data import Run
from reconcile.recordings.noise import ORDER

LEAST_LEVELS = 6  # different values: a switch or a staircase of few is no lattice
OFF = 0.1  # of a step, by which a value may lie off the lattice
MOST_STEPS = 1000  # between neighbouring values, for them to tell the step
COARSER = 1.5  # times the specified step
FINE = 1e-4  # of what the output moves by: finer than a converter of 13 bits has it
NAME = "sensor_quantization"
EQUATION = "y' = step round(y / step)"
SOURCE = "Widrow and Kollár, Quantization Noise, Cambridge 2008, ch. 4"


@dataclass(frozen=True)
class Quantization:
    """Steps found in an output: `step` and its standard `error`, what is `specified` (None: nothing), and
    `noise`, the standard deviation of what else is on the output; all in the output's `unit`."""

    output: str
    unit: str
    step: float
    error: float
    specified: float | None
    noise: float
    verdict: str  # named, specified, below_noise, fine

    @property
    def sentence(self) -> str:
        """The finding in words."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        found = f"{self.output} is recorded in steps of {self.step:.4g}{unit}"
        if self.verdict == "specified":
            return f"{found}, which its sensor is specified for ({self.specified:.4g}{unit})"
        if self.verdict == "below_noise":
            return f"{found}, below its other noise ({self.noise:.3g}{unit})"
        if self.verdict == "fine":
            return f"{found}, a small part of what it moves by"
        if self.specified:
            return f"{found}; its sensor is specified for {self.specified:.4g}{unit}"
        return f"{found}, coarser than its other noise ({self.noise:.3g}{unit})"

    def figures(self) -> dict[str, Any]:
        """The finding as the report lists it."""
        known = ("output", "unit", "step", "specified", "noise", "verdict", "sentence")
        return {name: getattr(self, name) for name in known}

    def effect(self, subsystem: str) -> dict[str, Any]:
        """The finding as an entry of the report's effects (nothing is fitted: both gains are null)."""
        interval = [self.step - Z95 * self.error, self.step + Z95 * self.error]
        return {
            "name": NAME,
            "place": "output",
            "subsystem": subsystem,
            "port": self.output,
            "verdict": "named",
            "equation": EQUATION,
            "parameters": {"step": {"value": self.step, "unit": self.unit, "ci95": interval}},
            "gain_fit": None,
            "gain_confirm": None,
            "sentence": self.sentence,
            "source": SOURCE,
        }


def examine(model: Model | Any, runs: Sequence[Run]) -> list[Quantization]:
    """What is found in each output of the model that is recorded in steps."""
    found = []
    for variable in model.outputs:
        values = [r.outputs[variable.name].values for r in runs if variable.name in r.outputs]
        lattice = _lattice(values) if values else None
        if lattice is not None:
            specified = _specified(model, variable.name)
            noise = _noise(values, lattice[0])
            verdict = _verdict(lattice[0], specified, noise, max(float(np.ptp(v)) for v in values))
            found.append(Quantization(variable.name, variable.unit, *lattice, specified, noise, verdict))
    return found


UNTOLD = ("insufficient_excitation", "unexplained")  # verdicts beside which steps are no answer


def named(found: Iterable[Quantization]) -> list[Quantization]:
    """Those that are an effect."""
    return [q for q in found if q.verdict == "named"]


def added(figures: Mapping[str, Any], found: Sequence[Quantization], subsystem: str) -> dict[str, Any]:
    """What changes in a report's figures by the steps that were found.

    They are certain whatever else explains the motion: every declared set has them, and they are named where
    nothing else is.  Where the recordings hardly move, or nothing explains what they show, an answer about
    the sensor is none about the model: the steps are listed only.
    """
    listed = {"quantization": [q.figures() for q in found]} if found else {}
    steps = named(found)
    if not steps or figures["verdict"] in UNTOLD:
        return listed
    sets = figures["alternatives"] or [[]]
    verdict = "ambiguous" if figures["verdict"] == "ambiguous" else "named"
    return listed | {
        "verdict": verdict,
        "sentence": _sentence(figures, steps),
        "effects": [*figures["effects"], *(q.effect(subsystem) for q in steps)],
        "alternatives": [_with(names, steps) for names in sets],
        "told_apart": [a | {"effects": _with(a["effects"], steps)} for a in figures.get("told_apart", ())],
    }


def _with(names: Sequence[str], steps: Sequence[Quantization]) -> list[str]:
    return sorted([*names, *[NAME] * len(steps)])


def steps(figures: Mapping[str, Any]) -> dict[str, float]:
    """Step of each output whose steps a report names."""
    own = [e for e in figures["effects"] if e["name"] == NAME]
    return {e["port"]: float(e["parameters"]["step"]["value"]) for e in own}


def _sentence(figures: Mapping[str, Any], steps: Sequence[Quantization]) -> str:
    """The report's sentence with what is named; where nothing else is, the steps come first."""
    before, shown = figures["sentence"], "; ".join(q.sentence for q in steps)
    if figures["effects"]:
        return f"{before} The sensors' steps show ({NAME}): {shown}."
    return f"The model lacks {NAME}. {shown}. Apart from the steps: {before}"


def _verdict(step: float, specified: float | None, noise: float, moved: float) -> str:
    if specified:
        return "named" if step > COARSER * specified else "specified"
    if step / np.sqrt(12.0) <= noise:
        return "below_noise"
    return "named" if step > FINE * moved else "fine"


def _specified(model: Model | Any, name: str) -> float | None:
    """Step that the sensor of an output is specified for; None where nothing is said or it is 0."""
    sensor = getattr(model, "sensors", {}).get(name)  # a closed FMU specifies none
    if sensor is None or not sensor.quantum:
        return None
    return next(p.start for p in model.parameters if p.name == sensor.quantum) or None


def _lattice(values: Sequence[np.ndarray]) -> tuple[float, float] | None:
    """Step of the lattice that all values lie on and its standard error; None if they lie on none."""
    levels = np.unique(np.concatenate(values))
    gaps = np.diff(levels)
    fine = 1e-9 * max(float(np.max(np.abs(levels))), 1e-300)
    gaps = gaps[gaps > fine]  # the same value, written twice with other last digits
    if len(gaps) < LEAST_LEVELS - 1:
        return None
    step = float(np.min(gaps))
    for _ in range(3):  # the least gap carries the rounding of two values; all gaps together do not
        steps = np.round(gaps / step)
        telling = steps <= MOST_STEPS
        step = float(np.sum(gaps[telling]) / np.sum(steps[telling]))
    off = gaps / step - np.round(gaps / step)
    near = np.round(gaps / step) <= MOST_STEPS
    if np.sum(near) < LEAST_LEVELS - 1 or np.max(np.abs(off[near])) > OFF:
        return None
    return step, float(np.std(off[near]) * step / np.sqrt(np.sum(near)))


def _noise(values: Sequence[np.ndarray], step: float) -> float:
    """Standard deviation of what is on the signal besides the steps, from its fourth differences.

    Their mean square, no quantile of them: between steps, quantiles are steps themselves.
    """
    differences = np.concatenate([np.diff(v, ORDER) for v in values if len(v) > ORDER])
    seen = float(np.mean(differences**2)) / comb(2 * ORDER, ORDER)
    return float(np.sqrt(max(seen - step**2 / 12.0, 0.0)))
