"""A collection plan (`specs/collections/*.toml`): which recordings are made, how, and within which limits.

A plan has parts; a part has a kind, and recordings of one length in each split.  Every recording has its own
arm pose, load and random numbers, all drawn from the plan's seed and its own name, so that adding a part or
a recording changes no other.  docs/how-to/collection.md explains every key.
"""

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal, get_args

import numpy as np

from fmus.equations import kinematics
from learning.collection.draws import Draws
from specs.errors import InputError, nearest
from specs.parameters import parameter
from specs.schema import ROOT, STRICT, read_toml, validate

FOLDER = ROOT / "collections"
PERIOD_S = 0.1  # commands are held so long: the policy's rate
Kind = Literal["steps", "sines", "trapezoids", "random_references", "driving", "closed_loop", "replay"]
KINDS: tuple[str, ...] = get_args(Kind)
SPLITS = ("train", "validation", "test")
PLAN_COMMANDS = ("u_slew", "qd_boom_ref", "qd_stick_ref")  # what a replay may state
ATTEMPTS = 5000
RADIUS_M = 0.1  # a drawn radius is met to this
ROOM_M = 0.2  # between a starting grab and the keep-out with its margin
Range = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What the supervisor keeps (learning/collection/supervisor.py), from sensors alone."""

    __pydantic_config__: ClassVar[Any] = STRICT

    boom_rad: Range  # arm pose
    stick_rad: Range
    slew_speed_rad_s: float
    keepout_margin_m: float  # beyond keepout_height and keepout_radius of specs/parameters/geometry.toml
    tool_swing_rad: float  # beyond it all commands go to neutral, slowly
    tool_swing_abort_rad: float
    stopping_s: float = 0.9  # from a command until the arm follows it, at most
    rest_s: float = 1.5  # and so for this long after
    silence_s: float = 0.5  # without a fresh sensor value

    def __post_init__(self) -> None:
        for name in ("boom_rad", "stick_rad"):
            low, high = getattr(self, name)
            joint = name.removesuffix("_rad")
            least, most = (parameter(f"{joint}_{end}", "geometry").value for end in ("min", "max"))
            if not least <= low < high <= most:
                raise InputError(
                    f"{name} = [{low:g}, {high:g}]: must rise, within the joint's {least:g} … {most:g} rad"
                )
        for name in ("slew_speed_rad_s", "tool_swing_rad", "stopping_s", "rest_s", "silence_s"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"{name} = {getattr(self, name):g}: must be above 0")
        if not self.keepout_margin_m >= 0.0:
            raise InputError(f"keepout_margin_m = {self.keepout_margin_m:g}: must not be negative")
        if not self.tool_swing_abort_rad > self.tool_swing_rad:
            raise InputError("tool_swing_abort_rad must be above tool_swing_rad")


@dataclass(frozen=True, kw_only=True)
class Part:
    """Recordings of one kind; `amplitude` is of the joystick, `period_s` how long a shape takes.

    `commands`, of a replay only: a value for every command period, by name (left out: neutral).
    """

    __pydantic_config__: ClassVar[Any] = STRICT

    kind: Kind
    recording_s: float
    recordings: dict[Literal["train", "validation", "test"], int]
    amplitude: Range = (0.15, 1.0)
    period_s: Range = (2.0, 12.0)
    boom_rad: Range | None = None  # where the arm starts; None: anywhere within the limits
    stick_rad: Range | None = None
    radius_m: Range | None = (
        None  # of the hanging grab at the start, evenly; None: as the joints' ranges give
    )
    loads_kg: tuple[float, ...] = (0.0,)
    commands: dict[Literal["u_slew", "qd_boom_ref", "qd_stick_ref"], tuple[float, ...]] | None = None

    def __post_init__(self) -> None:
        ticks = self.recording_s / PERIOD_S
        if not (ticks >= 20.0 and abs(ticks - round(ticks)) < 1e-6):
            raise InputError(f"recording_s = {self.recording_s:g}: a multiple of {PERIOD_S:g} s, 2 s or more")
        if not any(self.recordings.values()) or min(self.recordings.values()) < 0:
            raise InputError("recordings: at least one, in train, validation or test, and none below 0")
        if not 0.0 < self.amplitude[0] <= self.amplitude[1] <= 1.0:
            raise InputError(f"amplitude = {list(self.amplitude)}: must rise, within 0 … 1")
        if not 2 * PERIOD_S <= self.period_s[0] <= self.period_s[1]:
            raise InputError(f"period_s = {list(self.period_s)}: must rise, from {2 * PERIOD_S:g} s on")
        if self.radius_m is not None and not 0.0 < self.radius_m[0] < self.radius_m[1]:
            raise InputError(f"radius_m = {list(self.radius_m)}: must rise, from above 0")
        most = parameter("load_mass", "geometry").max or 0.0
        if not self.loads_kg or not all(0.0 <= load <= most for load in self.loads_kg):
            raise InputError(f"loads_kg = {list(self.loads_kg)}: 0 … {most:g} kg each")
        self._check_commands()

    def _check_commands(self) -> None:
        if (self.commands is not None) != (self.kind == "replay"):
            raise InputError("commands: a replay has them, and no other kind")
        top = parameter("arm_velocity_limit", "arm_velocity").value
        count = round(self.recording_s / PERIOD_S)
        for name, values in (self.commands or {}).items():
            if len(values) != count:
                raise InputError(
                    f"commands.{name}: {len(values)} values; recording_s = {self.recording_s:g} has {count} "
                    f"periods of {PERIOD_S:g} s"
                )
            most = 1.0 if name == "u_slew" else top
            if max(map(abs, values)) > most:
                raise InputError(f"commands.{name}: must stay within ±{most:g}")


@dataclass(frozen=True, kw_only=True)
class _File:
    __pydantic_config__: ClassVar[Any] = STRICT

    name: str
    description: str
    limits: Limits
    parts: dict[str, Part]
    seed: int = 1
    train_min: float | None = None  # minutes of training data that the recordings must add up to
    gains: dict[str, float] = field(default_factory=dict)  # of the closed loop; left out: tuned


@dataclass(frozen=True)
class Recording:
    """One recording to be made: `number` counts all of the plan, `index` those of its part and split."""

    number: int
    name: str
    part: str
    kind: Kind
    split: str
    index: int
    seconds: float
    q_boom: float
    q_stick: float
    load_kg: float

    @property
    def periods(self) -> int:
        """Its length in command periods."""
        return round(self.seconds / PERIOD_S)

    def draws(self, *what: object) -> Draws:
        """Random numbers of this recording, of the plan's seed in `what[0]`."""
        return Draws("collection", *what, self.part, self.split, self.index)


@dataclass(frozen=True)
class Plan:
    """A checked plan and all its recordings, in the order in which they are made."""

    name: str
    description: str
    seed: int
    limits: Limits
    parts: dict[str, Part]
    recordings: tuple[Recording, ...]
    gains: dict[str, float]

    def minutes(self, split: str) -> float:
        """Length of all recordings of a split."""
        return sum(r.seconds for r in self.recordings if r.split == split) / 60.0

    def digest(self, recording: Recording, more: Any = None) -> str:
        """SHA-256 of all of the plan that one recording depends on, and of `more` (machine, controller)."""
        part = asdict(self.parts[recording.part]) | {"recordings": None}
        if part["commands"] is None:
            del part["commands"]
        whole = [
            self.seed,
            asdict(self.limits),
            part,
            asdict(recording) | {"number": None, "name": None},
            more,
        ]
        return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()


def load_plan(path: Path) -> Plan:
    """Read and check a plan: a file, or the name of one in specs/collections.

    Raises InputError naming file and key of every mistake.
    """
    known = [p.stem for p in FOLDER.glob("*.toml")]
    if not path.suffix and not path.exists():
        if str(path) not in known:
            raise InputError(f"no collection plan '{path}'; {nearest(str(path), known)}, or a .toml file")
        path = FOLDER / f"{path}.toml"
    file = validate(_File, read_toml(path), str(path))
    try:
        found = tuple(_recordings(file))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    plan = Plan(file.name, file.description, file.seed, file.limits, file.parts, found, file.gains)
    train = plan.minutes("train")
    if file.train_min is not None and abs(train - file.train_min) > 1e-6:
        raise InputError(
            f"{path}: train_min = {file.train_min:g}, but the recordings add up to {train:g} min"
        )
    return plan


def _recordings(file: _File) -> Iterator[Recording]:
    number = 0
    for name, part in file.parts.items():
        if not name.isidentifier():
            raise InputError(f"parts.{name}: a part's name has letters, digits and underscores")
        for split in SPLITS:
            for index in range(part.recordings.get(split, 0)):
                boom, stick = _pose(file, name, split, index)
                load = part.loads_kg[index % len(part.loads_kg)]
                where = (f"{number:03d}_{name}", name, part.kind, split, index)
                yield Recording(number, *where, part.recording_s, boom, stick, load)
                number += 1


def _pose(file: _File, name: str, split: str, index: int) -> tuple[float, float]:
    """A pose within limits and keep-out, where the arm can also move a little; drawn until one fits."""
    part, draws = file.parts[name], Draws("collection", file.seed, name, split, index, "pose")
    ranges = (part.boom_rad or file.limits.boom_rad, part.stick_rad or file.limits.stick_rad)
    for given, limit, key in zip(
        ranges, (file.limits.boom_rad, file.limits.stick_rad), ("boom_rad", "stick_rad"), strict=True
    ):
        if not limit[0] <= given[0] <= given[1] <= limit[1]:
            raise InputError(
                f"parts.{name}.{key} = {list(given)}: must rise, within the limits {list(limit)}"
            )
    radius = draws.between(*part.radius_m) if part.radius_m else None
    for _ in range(ATTEMPTS):
        boom, stick = (round(draws.between(*given), 4) for given in ranges)
        tip, _height = kinematics.arm_tip(boom, stick, kinematics.geometry())
        placed = radius is None or abs(tip - radius) < RADIUS_M
        if placed and clearance(boom, stick).min() >= file.limits.keepout_margin_m + ROOM_M:
            return boom, stick
    where = f"boom {list(ranges[0])}, stick {list(ranges[1])} rad"
    where += f" with the grab at a radius of {radius:.2f} m" if radius is not None else ""
    raise InputError(
        f"parts.{name}: no pose in {where} keeps it {file.limits.keepout_margin_m + ROOM_M:g} m off the "
        "keep-out"
    )


def clearance(q_boom: Any, q_stick: Any, pitch: Any = 0.0) -> np.ndarray:
    """How far the grab is [above the keep-out height, outside the keep-out radius], m.

    The height counts as if the tool hung still, its lowest place; `pitch` swings it towards the slew axis.
    """
    g = kinematics.geometry()
    radius, height = kinematics.arm_tip(q_boom, q_stick, g)
    inward = g.tool_length * np.sin(np.maximum(pitch, 0.0))
    return np.array([height - g.tool_length - g.keepout_height, radius - inward - g.keepout_radius])
