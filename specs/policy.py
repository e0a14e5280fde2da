"""The policy's contract: what a network that drives the machine is given, what it answers, how often.

An ONNX policy has one input `observation` float32 [1, N] and one output `action` float32 [1, 3], both in
SI.  The history is inside the observation; scaling, slew inertia and clipping are inside the network's
graph, so that whoever fills the observation needs no kinematics.  So is a limit on the joystick's change a
period, where a policy has one (`change`): it starts from the newest u_slew of the observation.

    channel by channel, H values each, oldest first, SPACING_S apart; the newest is now
        u_slew, qd_boom_ref, qd_stick_ref      the commands that were held up to that instant
        slew_error                             q_slew - angle of the present target (below)
        q_boom, q_stick, imu_tool_roll, imu_tool_pitch,
        imu_cabin_rate_z, qd_boom, qd_stick, imu_tool_rate_x, imu_tool_rate_y       sensors at that instant
    then, once
        target_radius, target_z                the target in the x-z plane: hypot(target_x, target_y), height
        load_told, pace                        as the signals of these names
    then what a policy that is led sees of its way and of things (specs/ahead.py); most see nothing of them

The target is told in the plane through the slew axis, and its direction as an error: with the newest angle
q and the target's angle a = atan2(target_y, target_x), the newest slew_error is q - a wrapped to -pi .. pi,
an older one that plus the difference of the angles.  The whole history is always relative to the present
target.  Before the first instant the history holds the first sensors and commands of 0.

I_z, the slew inertia of the newest pose with the told load, is computed inside the graph
(fmus/equations/kinematics.py).  `History` below is this page as code, without any package.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from typing import Any, Literal

from specs.ahead import NOTHING, Ahead
from specs.errors import InputError, nearest
from specs.signals import signal
from specs.version import VERSION

FORMAT = 1  # of this contract; raised when a name, an order or a meaning changes
INPUT, OUTPUT = "observation", "action"  # of the ONNX graph
RATE_HZ = 10.0  # paper: control at 10 Hz, held for five ticks of 50 Hz
SPACING_S = 0.1  # between values of the history: one period of control
TICK_S = 0.02
HISTORY = 5  # values, now included: the paper's five-element history (0.5 s)
MOST_HISTORY = 20  # 2 s
ARM_LIMIT = 0.2  # rad/s, paper: arm references are clipped to the range of the loops' tables (arm_rate_limit)
TASKS = ("slew", "full")
Task = Literal["slew", "full"]

ACTIONS = ("u_slew", "qd_boom_ref", "qd_stick_ref")
SLEW_ERROR = "slew_error"
SENSORS = (
    "q_slew", "q_boom", "q_stick", "imu_tool_roll", "imu_tool_pitch",
    "imu_cabin_rate_z", "qd_boom", "qd_stick", "imu_tool_rate_x", "imu_tool_rate_y",
)  # fmt: skip
CHANNELS = (*ACTIONS, *(SLEW_ERROR if name == "q_slew" else name for name in SENSORS))
ONCE = ("target_radius", "target_z", "load_told", "pace")
TARGETS = ("target_x", "target_y", "target_z", "load_told", "pace")  # signals that ONCE comes from
LIMITS: Mapping[str, tuple[float, float]] = {
    "u_slew": (-1.0, 1.0),
    "qd_boom_ref": (-ARM_LIMIT, ARM_LIMIT),
    "qd_stick_ref": (-ARM_LIMIT, ARM_LIMIT),
}
MOST_LEAD_S = 5.0
MOST_CHANGE = 2.0  # of the joystick in a period: from one end to the other
PRIORS = ("", "pd", "parabola", "gentle")
JOINED = ("", "transformer")  # layers one after the other with tanh between them, or a transformer's
META = "slewright.policy"  # key of the ONNX metadata that holds `Contract.as_json`


def layout(history: int = HISTORY, ahead: Ahead = NOTHING) -> tuple[str, ...]:
    """Name of each of the N entries of an observation: "q_boom[-4]" … "q_boom[0]" (now), …, "pace", …"""
    if not 1 <= history <= MOST_HISTORY:
        raise InputError(f"a history of {history} values: valid are 1 to {MOST_HISTORY}")
    rows = [f"{name}[{i - history + 1}]" for name in CHANNELS for i in range(history)]
    return (*rows, *ONCE, *ahead.names)


def size(history: int = HISTORY, ahead: Ahead = NOTHING) -> int:
    """Number of entries of an observation."""
    return len(CHANNELS) * history + len(ONCE) + len(ahead.names)


@dataclass(frozen=True, kw_only=True)
class Contract:
    """What an ONNX policy says of itself; `ranges` are the trained ranges of quantities by name, in SI."""

    task: str
    history: int
    layout: tuple[str, ...]
    actions: tuple[str, ...] = ACTIONS
    limits: Mapping[str, tuple[float, float]]
    rate_hz: float = RATE_HZ
    spacing_s: float = SPACING_S
    format: int = FORMAT
    specs_version: str = VERSION
    change: float = 0.0  # limit inside the graph: u_slew's change a period stays below it; 0: without limit
    lead_s: float = 0.0  # its target moves along a way and is told this much ahead; 0: it stands
    waypoints_s: tuple[float, ...] = ()  # beside that, places of the way ahead that it sees (specs/ahead.py)
    field_m: float = 0.0  # and the distance up to which it sees things; 0: none
    prior: str = ""  # a law inside the graph that the network's answer is added to (PRIORS)
    network: str = ""  # how its layers are joined (JOINED)
    data_sha256: str = ""  # of the slew networks it was trained with
    ranges: Mapping[str, tuple[float, float]]
    made: Mapping[str, Any]  # command, seed, commit, figures

    def as_json(self) -> str:
        """As it stands in the ONNX metadata; what few policies have is left out of the others' files."""
        told = {k: v for k, v in self.__dict__.items() if v or k not in Ahead.__dataclass_fields__}
        return json.dumps(told, sort_keys=True, allow_nan=False)

    @property
    def ahead(self) -> Ahead:
        """What it sees of its way and of things."""
        return Ahead(self.waypoints_s, self.field_m)

    def differences(self) -> list[str]:
        """How it differs from the contract on this page; empty if it does not."""
        seen = {"waypoints_s": self.waypoints_s, "field_m": self.field_m}
        wanted = contract(self.task if self.task in TASKS else TASKS[-1], self.history, **seen)
        found = [f"task {self.task!r} (valid: {', '.join(TASKS)})"] if self.task not in TASKS else []
        found += [f"prior {self.prior!r} (valid: {', '.join(PRIORS)})"] if self.prior not in PRIORS else []
        if self.network not in JOINED:
            found.append(f"network {self.network!r} (valid: {', '.join(JOINED)})")
        if not 0.0 <= self.change <= MOST_CHANGE:
            found.append(f"change {self.change!r} (valid: 0 to {MOST_CHANGE:g})")
        if not 0.0 <= self.lead_s <= MOST_LEAD_S:
            found.append(f"lead_s {self.lead_s!r} (valid: 0 to {MOST_LEAD_S:g})")
        found += self.ahead.faults()
        if self.ahead and not (self.lead_s and self.task == "full"):
            found.append("waypoints_s or field_m (valid: for task full with a lead_s alone)")
        for name in ("format", "rate_hz", "spacing_s"):
            if getattr(self, name) != getattr(wanted, name):
                found.append(f"{name} {getattr(self, name)!r}, specs say {getattr(wanted, name)!r}")
        for name in ("actions", "layout"):
            found += _first_difference(name, getattr(self, name), getattr(wanted, name))
        for name, limits in wanted.limits.items():
            if tuple(self.limits.get(name, ())) != limits:
                found.append(f"limits of {name} {self.limits.get(name)}, specs say {limits}")
        return found


def contract(task: str, history: int = HISTORY, **about: Any) -> Contract:
    """The contract of a policy of this task and history; `about` fills the rest."""
    if task not in TASKS:
        raise InputError(f"no task '{task}'; valid: {', '.join(TASKS)}")
    filled = {"ranges": {}, "made": {}, **about}
    seen = Ahead(**{name: filled[name] for name in Ahead.__dataclass_fields__ if name in filled})
    return Contract(task=task, history=history, layout=layout(history, seen), limits=LIMITS, **filled)


def read_contract(metadata: Mapping[str, str], source: str) -> Contract:
    """The contract in an ONNX file's metadata; InputError names the first difference to this page."""
    if META not in metadata:
        raise InputError(f"{source} is no policy of this project: it has no metadata '{META}'")
    try:
        told = json.loads(metadata[META])
        if (made := told.get("format", FORMAT)) != FORMAT:  # before its keys: another format has others
            raise InputError(
                f"{source}: another contract than specs/policy.py: format {made!r}, specs say {FORMAT}"
            )
        _check_keys(told, source)
        found = Contract(
            **{
                **told,
                "layout": tuple(told["layout"]),
                "actions": tuple(told["actions"]),
                "waypoints_s": tuple(float(v) for v in told.get("waypoints_s", ())),
                "limits": {k: (float(v[0]), float(v[1])) for k, v in told["limits"].items()},
                "ranges": {k: (float(v[0]), float(v[1])) for k, v in told["ranges"].items()},
            }
        )
        wrong = found.differences()
    except (ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        raise InputError(
            f"{source}: the policy's contract cannot be read ({type(error).__name__}: {error})"
        ) from None
    if wrong:
        more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
        raise InputError(f"{source}: another contract than specs/policy.py: {wrong[0]}{more}")
    return found


def _check_keys(told: Mapping[str, Any], source: str) -> None:
    """InputError names a key that the contract does not have, or one that is not there."""
    known = {f.name: f.default is MISSING for f in fields(Contract)}
    for name in told:
        if name not in known:
            raise InputError(f"{source}: the policy's contract has no key '{name}'; {nearest(name, known)}")
    for name, needed in known.items():
        if needed and name not in told:
            raise InputError(f"{source}: the policy's contract lacks its key '{name}'")


def check_shapes(inputs: Mapping[str, Sequence[Any]], outputs: Mapping[str, Sequence[Any]], found: Contract,
                 source: str) -> None:  # fmt: skip
    """InputError unless the graph's inputs and outputs (name -> shape) are those of the contract."""
    wanted = ({INPUT: [1, len(found.layout)]}, {OUTPUT: [1, len(ACTIONS)]})
    for what, have, want in zip(("input", "output"), (inputs, outputs), wanted, strict=True):
        if {name: list(shape) for name, shape in have.items()} != want:
            raise InputError(f"{source}: {what} {_shapes(have)}; specs/policy.py says {_shapes(want)}")


def check_signals(found: Contract, source: str) -> None:
    """InputError for a policy that sees more than signals tell: a way ahead, distances to things."""
    if found.ahead:
        raise InputError(
            f"{source}: it sees its way ahead or the distances to things, which no signal tells; "
            "only slewright scenes SCENE --controller FILE@path knows them"
        )


def outside(ranges: Mapping[str, tuple[float, float]], values: Mapping[str, float]) -> list[str]:
    """What of `values` lies outside the trained ranges, in words; for a warning."""
    return [
        f"{name} {values[name]:g} is outside the trained {low:g} … {high:g}"
        for name, (low, high) in ranges.items()
        if name in values and not low <= values[name] <= high
    ]


class History:
    """Fills observations: `push` sensors and held commands every SPACING_S, then ask for `observation`."""

    def __init__(self, length: int = HISTORY) -> None:
        self.length = length
        self._rows: list[dict[str, float]] = []

    def push(self, sensors: Mapping[str, float], actions: Mapping[str, float]) -> None:
        """Sensors (SENSORS) now and the commands (ACTIONS) that were held up to now; SI."""
        row = {name: float(sensors[name]) for name in SENSORS}
        if not self._rows:
            still = row | dict.fromkeys(ACTIONS, 0.0)
            self._rows = [still] * (self.length - 1)
        self._rows = [*self._rows, row | {name: float(actions[name]) for name in ACTIONS}][-self.length :]

    def observation(self, targets: Mapping[str, float]) -> list[float]:
        """The N numbers for these targets (TARGETS), in the order of `layout`; after a `push`."""
        newest = self._rows[-1]["q_slew"]
        error = slew_error(newest, targets["target_x"], targets["target_y"])
        values: list[float] = []
        for name in CHANNELS:
            if name == SLEW_ERROR:
                values += [error + (row["q_slew"] - newest) for row in self._rows]
            else:
                values += [row[name] for row in self._rows]
        radius = math.hypot(targets["target_x"], targets["target_y"])
        return [*values, radius, targets["target_z"], targets["load_told"], targets["pace"]]


def slew_error(q_slew: float, target_x: float, target_y: float) -> float:
    """Angle past the target, wrapped to -pi .. pi, rad."""
    ahead = q_slew - math.atan2(target_y, target_x)
    return math.atan2(math.sin(ahead), math.cos(ahead))


def units() -> dict[str, str]:
    """Unit of each channel and of what stands once, by name."""
    special = {SLEW_ERROR: "rad", "target_radius": "m"}
    return {name: special.get(name) or signal(name).unit for name in (*CHANNELS, *ONCE)}


def _first_difference(name: str, have: Sequence[str], want: Sequence[str]) -> list[str]:
    if len(have) != len(want):
        return [f"{name} of {len(have)} entries, specs say {len(want)}"]
    for i, (a, b) in enumerate(zip(have, want, strict=True)):
        if a != b:
            return [f"{name} entry {i} is {a!r}, specs say {b!r}"]
    return []


def _shapes(ends: Mapping[str, Sequence[Any]]) -> str:
    return ", ".join(f"'{name}' {list(shape)}" for name, shape in ends.items()) or "none"
