"""What runs ask of a policy beyond its training: machine, load, pace and task against its trained ranges.

Every trained quantity and what it is of a run, as the training draws it (learning/policy: `Randomisation`,
`session.ranges`):

    pace             as it is told
    load_mass        the true load, told or not
    slew_dead_band   the machine's
    pendulum_length  of the empty grab, com + gyration^2 / com
    inertia          about the slew axis with the load, in the poses of the task: of the machine's own masses,
                     and by what else turns there more or less than on the nominal drive
    target_radius, target_z, slew_error, q_boom, q_stick      of the task: its targets and their poses

A machine is drawn for the reference system alone: of the nominal one pace, load and task count.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from fmus.equations import kinematics
from learning.policy.controller import FILE
from learning.policy.export import read
from specs import draws, parameters, policy as contract, scenario as scenarios
from specs.scenario import Load, Scenario
from specs.signals import signal

OF_MACHINE = ("load_mass", "slew_dead_band", "pendulum_length", "inertia")
Ranges = Mapping[str, tuple[float, float]]
Spec = Mapping[str, Any]  # of a run of verification.comparison.plan
Pose = tuple[float, float]  # q_boom, q_stick [rad]


def warnings(path: Path, specs: Iterable[Spec], but: Sequence[str] = ()) -> Iterator[str]:
    """What of these runs lies outside a policy's trained ranges, a line a quantity, `but` for some.

    Of sealed machines no value is told, nor which they are.  A folder that is no policy has no ranges.
    """
    ranges = {name: ends for name, ends in _ranges(path).items() if name not in but}
    found, sealed = outside(ranges, specs)
    for name, values in found.items():
        low, high = ranges[name]
        told = ", ".join(_told(value, where) for where, value in values.items())
        yield f"{path}: {name} is outside the trained {low:g} … {high:g}: {told}"
    for name in sealed:
        yield f"{path}: {name} is outside the trained range on sealed machines"


def at_start(path: Path) -> Iterator[str]:
    """The same of a policy in the machine controller: of what comes, the pace at the start alone is known."""
    told = read(path).contract
    for text in contract.outside(told.ranges, {"pace": float(signal("pace").start or 0.0)}):
        yield f"{path}: {text}; it holds until a planner tells another"
    if lead := told.lead_s:
        yield f"{path}: trained to be led: whoever commands it moves its target along a way, {lead:g} s ahead"


def on_plants(path: Path, pace: float, load: Load) -> list[str]:
    """The same of a trial on plants: pace, and the lightest and heaviest load."""
    told = ({"pace": pace, "load_mass": kg} for kg in (load.low_kg, load.high_kg))
    return [
        f"{path}: {t}" for t in dict.fromkeys(t for one in told for t in contract.outside(_ranges(path), one))
    ]


def outside(ranges: Ranges, specs: Iterable[Spec]) -> tuple[dict[str, dict[str, float]], list[str]]:
    """({quantity: {where: its value farthest outside}}, quantities that are outside on sealed machines)."""
    found: dict[str, dict[str, float]] = {}
    sealed: dict[str, None] = {}
    for spec in specs if ranges else ():
        for name, value in _farthest(ranges, spec).items():
            if name in OF_MACHINE and spec["draw"].rpartition("-")[0] == draws.SEALED:
                sealed[name] = None
                continue
            values, where = found.setdefault(name, {}), _where(name, spec)
            values[where] = _far((value, values.get(where, value)), ranges[name])
    return found, list(sealed)


def _farthest(ranges: Ranges, spec: Spec) -> dict[str, float]:
    """Of each quantity that is outside in a run, the value that is farthest so."""
    found = {n: _far(values, ranges[n]) for n, values in quantities(spec).items() if n in ranges}
    return {name: value for name, value in found.items() if contract.outside(ranges, {name: value})}


def _far(values: Sequence[float], ends: tuple[float, float]) -> float:
    return max(values, key=lambda v: max(ends[0] - v, v - ends[1]))


def _where(name: str, spec: Spec) -> str:
    """What a value is of; a pace is itself."""
    if name == "pace":
        return f"{spec['pace']:g}"
    place = spec["draw"] if name in OF_MACHINE else f"task {spec['task']}"
    return f"{place}, {spec['load']}" if name == "load_mass" else place


def _told(value: float, where: str) -> str:
    return f"{value:g}" if where == f"{value:g}" else f"{value:g} ({where})"


def quantities(spec: Spec) -> dict[str, Sequence[float]]:
    """Values (SI) of a run by the names of the trained quantities."""
    task = _scenario(spec["source"], spec["scenario"])
    machine = {**_nominal(), **task.parameters(spec["seed"]), **spec["machine"]}  # as campaign.worker does
    found = {"pace": [spec["pace"]], "load_mass": [machine["load_mass"]], **_of_task(task)}
    return found | (_of_machine(machine, _poses(task)) if spec["system"] == "reference" else {})


def _of_machine(machine: Mapping[str, float], poses: Sequence[Pose]) -> dict[str, Sequence[float]]:
    of, com = SimpleNamespace(**machine), machine["grab_com"]
    more = machine["slew_inertia_extra"] - _nominal()["slew_inertia_extra"]
    return {
        "slew_dead_band": [machine["slew_dead_band"]],
        "pendulum_length": [com + machine["grab_gyration"] ** 2 / com],
        "inertia": [float(kinematics.inertia_z(*pose, machine["load_mass"], of)) + more for pose in poses],
    }


def _of_task(task: Scenario) -> dict[str, Sequence[float]]:
    angles = [math.radians(place.slew_deg) for place in (task.start, *task.targets)]
    boom, stick = zip(*_poses(task), strict=True)
    return {
        "target_radius": [target.radius_m for target in task.targets],
        "target_z": [target.height_m for target in task.targets],
        "slew_error": [contract.slew_error(a, math.cos(b), math.sin(b)) for a, b in pairwise(angles)],
        "q_boom": boom,
        "q_stick": stick,
    }


def _poses(task: Scenario) -> list[Pose]:
    """Of the start, and with the grab hanging on each target."""
    there = [kinematics.inverse(*target.xyz, kinematics.geometry())[1:] for target in task.targets]
    return [(task.start.q_boom, task.start.q_stick), *((float(boom), float(stick)) for boom, stick in there)]


@cache
def _nominal() -> dict[str, float]:
    return {name: p.value for name, p in parameters.load(*draws.FILES).items()}


@cache
def _scenario(source: str, name: str) -> Scenario:
    return next(s for s in scenarios.find(source) if s.name == name)


def _ranges(path: Path) -> Ranges:
    file = path if path.suffix == ".onnx" else path / FILE
    return read(file).contract.ranges if file.is_file() else {}
