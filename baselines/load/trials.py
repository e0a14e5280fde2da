"""Trials: the simulated reference machine driven to several poses, resting, moving its arm and slewing.

One trial is one run with one load: over and over a move of boom and stick to a new pose, a rest, a slew to
either side, a rest.  Poses, speeds and joysticks come from keys, so that trials of different kinds
(calibration, scoring) share none.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import SimpleNamespace

import numpy as np
from scipy.signal import savgol_filter

from baselines.load.balance import figures
from baselines.load.gate import held
from baselines.load.sensors import ANGLES, CABIN, STEP_S, TOOL, pressures, smoothing
from fmus.equations import kinematics
from fmus.models.machine import arm_hydraulics
from orchestrator.run.simulate import simulate
from orchestrator.system.assembly import driven_machine
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from records.measurement import Channel, Measurement
from records.record import Record
from specs import draws, keys

BOOM, STICK = (0.8, 1.4), (-2.1, -0.3)  # rad, pose range
LOWEST = 2.5 + 2.0  # m, of the arm tip: keep-out height, tool and a little
SPEED = (0.05, 0.18)  # rad/s of the arm's moves
JOYSTICK = (0.2, 0.6)
SLOW = 0.005  # rad/s, a joint that is slower stands
REST_S, SLEW_S, COAST_S = 6.0, 4.0, 5.0
SENSED = (*ANGLES, "qd_slew", "qd_boom", "qd_stick", *pressures("boom"), *pressures("stick"), *TOOL, *CABIN)


@dataclass(frozen=True)
class Trial:
    """One run: `kind` and `number` choose what is done, `load_kg` is in the grab."""

    kind: str
    number: int
    load_kg: float
    poses: int = 4
    retained: tuple[float, float] = (0.0, 0.0)  # see `retaining`

    def uniform(self, low: float, high: float, *what: object) -> float:
        """A number of this trial's between `low` and `high`."""
        return low + (high - low) * keys.uniform("load trial", self.kind, self.number, *what)


@cache
def machine() -> System:
    """The reference machine with its arm velocity controller, all sensors that the estimate needs."""
    return driven_machine("load_trial", SENSED)


def run(trial: Trial, which: str = "nominal") -> Measurement:
    """Drive the machine through a trial and return what its sensors recorded."""
    poses = [_pose(trial, i) for i in range(trial.poses + 1)]
    ticks, changes = _script(trial, poses)
    start = {"start_q_boom": poses[0][0], "start_q_stick": poses[0][1], "load_mass": trial.load_kg}
    values = {f"machine.{n}": v for n, v in {**draws.named(which), **start}.items()}
    seed = 1 + int(keys.uniform("load noise", trial.kind, trial.number, which) * 2**30)
    found = measured(simulate(machine(), ticks, Stimuli(changes), values, seed=seed), which)
    return retaining(found, trial, which) if any(trial.retained) else found


def measured(record: Record, source: str) -> Measurement:
    """A record's columns as channels."""
    units = record.units
    channels = {n: Channel(n, units[n], record.time, record.column(n)) for n in record.names if n != "time"}
    return Measurement(channels, None, {"origin": "simulated reference machine"}, source)


def retaining(recording: Measurement, trial: Trial, which: str) -> Measurement:
    """The recording of a machine whose cylinders keep friction at rest, which the simulated one's do not.

    The model's friction is a steep function of speed, so that it fades within tenths of a second once a
    cylinder stands.  Seals keep some of it.  Here each rest keeps its own share, drawn between the two of
    `trial.retained`, of the breakaway friction against the last motion, as pressure on the bore side.
    """
    p = SimpleNamespace(**(vars(figures()) | draws.named(which)))
    channels = dict(recording.channels)
    for joint in ("boom", "stick"):
        c = arm_hydraulics.parameters(p, joint)
        speed = np.asarray(savgol_filter(recording[f"q_{joint}"].values, smoothing(), 2, 1, STEP_S))
        direction, rest = _rests(speed)
        share = np.array(
            [trial.uniform(*trial.retained, "retained", joint, int(r)) for r in range(rest[-1] + 1)]
        )
        kept = share[rest] * direction * (c.coulomb + c.static) * (np.abs(speed) < SLOW)
        bore = recording[pressures(joint)[0]]
        channels[bore.name] = replace(bore, values=bore.values + kept / c.area_bore)
    return replace(recording, channels=channels)


def _rests(speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(direction of the last motion, number of the rest) of each sample of a joint's speed, rad/s."""
    signs = held(np.where(np.abs(speed) > SLOW, np.sign(speed), 0.0))
    standing = np.abs(speed) < SLOW
    return signs, np.cumsum(np.diff(standing.astype(int), prepend=0) == 1)


def _pose(trial: Trial, i: int) -> tuple[float, float]:
    """The first drawn pose whose tool hangs above the keep-out height."""
    g = kinematics.geometry()
    for attempt in range(100):
        boom, stick = trial.uniform(*BOOM, "boom", i, attempt), trial.uniform(*STICK, "stick", i, attempt)
        if _height(boom, stick, g) > LOWEST:
            return boom, stick
    raise AssertionError("the pose range lies below the keep-out height")


def _height(boom: float, stick: float, g: SimpleNamespace) -> float:
    return g.boom_foot_z + g.boom_length * np.sin(boom) + g.stick_length * np.sin(boom + stick)


def _script(trial: Trial, poses: list[tuple[float, float]]) -> tuple[int, dict[int, Mapping[str, float]]]:
    """(ticks, changes of the inputs) of the whole trial."""
    changes: dict[int, Mapping[str, float]] = {}
    now = _ticks(REST_S)
    for i, (pose, last) in enumerate(zip(poses[1:], poses[:-1], strict=True)):
        for joint, target, from_ in zip(("boom", "stick"), pose, last, strict=True):
            speed = trial.uniform(*SPEED, "speed", joint, i) * np.sign(target - from_)
            ends = now + _ticks((target - from_) / speed)
            _set(changes, now, f"qd_{joint}_ref", speed)
            _set(changes, ends, f"qd_{joint}_ref", 0.0)
        now = max(changes) + _ticks(REST_S)
        side = 1.0 if i % 2 else -1.0
        _set(changes, now, "u_slew", side * trial.uniform(*JOYSTICK, "joystick", i))
        _set(changes, now + _ticks(SLEW_S), "u_slew", 0.0)
        now += _ticks(SLEW_S + COAST_S)
    return now + _ticks(REST_S), changes


def _ticks(seconds: float) -> int:
    return max(1, round(seconds / STEP_S))


def _set(changes: dict[int, Mapping[str, float]], tick: int, name: str, value: float) -> None:
    changes[tick] = {**changes.get(tick, {}), name: float(value)}
