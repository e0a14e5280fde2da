"""The FMI variables of a model: one flat list from which C tables and model descriptions are made."""

import hashlib
from dataclasses import dataclass
from typing import Literal

from fmus.definition import Model, Variable

Group = Literal["STATE", "DERIVATIVE", "INPUT", "OUTPUT", "PARAMETER", "SEED", "TIME"]

# Value references for variables that bring none of their own (specs hold 1–2999).
STATE_VR, DERIVATIVE_VR, SEED_VR, TIME_VR = 50_000, 60_000, 70_000, 70_001
OWN_VR = {"INPUT": 100_000, "OUTPUT": 110_000, "PARAMETER": 120_000}


@dataclass(frozen=True)
class Exposed:
    """A variable as an importer sees it; `index` is its place within its group."""

    variable: Variable
    vr: int
    group: Group
    index: int
    of_state: int | None = None  # derivatives: value reference of the state

    @property
    def name(self) -> str:
        return self.variable.name


def exposed(model: Model) -> list[Exposed]:
    """All variables in the order of the model description: inputs, outputs, parameters, states, rates."""
    found: list[Exposed] = []
    groups: tuple[tuple[Group, tuple[Variable, ...]], ...] = (
        ("INPUT", model.inputs),
        ("OUTPUT", model.outputs),
        ("PARAMETER", model.parameters),
    )
    for group, variables in groups:
        for i, v in enumerate(variables):
            found.append(Exposed(v, OWN_VR[group] + i if v.vr is None else v.vr, group, i))
    for i, v in enumerate(model.states):
        found.append(Exposed(_hidden(v, "state." + v.name), STATE_VR + i, "STATE", i))
    if model.kind == "continuous":
        for i, v in enumerate(model.states):
            rate = Variable(f"der(state.{v.name})", _rate_unit(v.unit), f"Rate of change of {v.name}")
            found.append(Exposed(rate, DERIVATIVE_VR + i, "DERIVATIVE", i, STATE_VR + i))
    if any(s.noise for s in model.sensors.values()):
        seed = Variable("noise_seed", "1", "Seed of the sensor noise; 0 switches the noise off", start=1)
        found.append(Exposed(seed, SEED_VR, "SEED", 0))
    return found


def model_token(text: str) -> str:
    """GUID of FMI 2 and instantiation token of FMI 3: a hash of everything the binary is made of."""
    digest = hashlib.sha256(text.encode()).hexdigest()
    return "{" + "-".join((digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])) + "}"


def _hidden(v: Variable, name: str) -> Variable:
    return Variable(name, v.unit, v.description, v.start, v.min, v.max, v.nominal)


def _rate_unit(unit: str) -> str:
    known = {
        "rad": "rad/s",
        "rad/s": "rad/s2",
        "m": "m/s",
        "m/s": "m/s2",
        "1": "1/s",
        "Pa": "Pa/s",
        "m3": "m3/s",
    }
    return known.get(unit, "")
