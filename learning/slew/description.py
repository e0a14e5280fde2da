"""The small file beside a pair of networks: which number is what, in which unit and sense (slew.toml).

    format = 1
    spacing_s = 0.1                # of the history; other spacings are other networks
    history = 10
    activation = "relu"
    symmetric = false              # true: evaluate on the mirror image too, and average
    normalisation = "outside"      # "inside": means and deviations are in the (ONNX) graphs already
    visited = "00ff…"              # in exports: the bits of SlewNetwork.visited, in hexadecimal

    [channels.u]                   # and p_l, p_r, omega, inertia; SI numbers unless said here
    unit = "1"                     # specs/units.py
    full_scale = 850               # the stored number that is one unit; or scale = units of one stored number
    sign = -1                      # turned round

    [pressure]                     # and [velocity]
    inputs = ["u", "p_l", "p_r", "omega", "inertia"]     # any order
    outputs = ["p_l", "p_r"]       # velocity: ["omega"]
    order = "old_to_new"           # or "new_to_old"
    layout = "by_channel"          # or "by_time": all channels of one instant, then of the next
    residual = false               # true: outputs are changes from the last known values
    layers = [41, 128, 128, 128, 128, 32, 2]             # if given, they are checked
    mean_in = { u = 0, p_l = 60, … }                     # a table by channel, or 41 numbers in `inputs` order
    std_in = …                     # likewise; without them 0 and 1
    mean_out = [60, 60]            # in order of `outputs`
    std_out = [50, 50]

    [inertia]                      # the number that the networks were trained on:
    scale = 0.82                   # scale * I + offset, with the project's I [kg m2]; 1 and 0 if it is that
    offset = -55500.0
    applied = false                # true in exports: the networks take the project's number already
    # or the masses [kg] and lengths [m] that it was computed with, where they are not the project's, by their
    # names in specs/parameters/geometry.toml: bodies = { carriage_x = 1.6, boom_mass = 7200 }

    [region]                       # SI: what the networks were trained on, if known; inertia in their number
    u = [-1.0, 1.0]

Only the tables `pressure` and `velocity` with inputs and outputs must be there.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import SkipValidation

from fmus.models.slew_nn.network import CELL_AXES, HISTORY, INPUTS, PERIOD_S
from learning.slew import bodies
from specs.errors import InputError
from specs.schema import STRICT, read_toml, validate
from specs.units import unit as find_unit

CHANNELS = ("u", "p_l", "p_r", "omega", "inertia")  # in network.py's order
PLACES = [(channel, row) for channel in CHANNELS[:-1] for row in range(HISTORY)] + [("inertia", 0)]
SI = {"u": "1", "p_l": "Pa", "p_r": "Pa", "omega": "rad/s", "inertia": "kg.m2"}
OUTPUTS = {"pressure": ("p_l", "p_r"), "velocity": ("omega",)}
Statistics = Annotated[dict[str, float] | list[float] | None, SkipValidation]  # checked by Description


@dataclass(frozen=True, kw_only=True)
class ChannelUnit:
    """How a stored number becomes SI: sign * (number * scale in `unit`)."""

    __pydantic_config__: ClassVar[Any] = STRICT

    unit: str
    scale: float | None = None
    full_scale: float | None = None
    sign: Literal[1, -1] = 1

    def __post_init__(self) -> None:
        find_unit(self.unit)
        if self.scale is not None and self.full_scale is not None:
            raise InputError("give scale or full_scale, not both")
        if not self.step > 0:
            raise InputError("scale and full_scale must be above 0 (sign turns a channel round)")

    @property
    def step(self) -> float:
        """SI units of one stored number, without the sign."""
        if self.full_scale is not None:
            size = 1.0 / self.full_scale if self.full_scale else 0.0
        else:
            size = 1.0 if self.scale is None else self.scale
        return size * find_unit(self.unit).factor

    @property
    def zero(self) -> float:
        """SI value of the stored number 0."""
        return self.sign * find_unit(self.unit).offset


@dataclass(frozen=True, kw_only=True)
class Part:
    """One of the two networks, as its author wrote it."""

    __pydantic_config__: ClassVar[Any] = STRICT

    inputs: list[str]
    outputs: list[str]
    order: Literal["old_to_new", "new_to_old"] = "old_to_new"
    layout: Literal["by_channel", "by_time"] = "by_channel"
    residual: bool = False
    layers: list[int] | None = None
    mean_in: Statistics = None
    std_in: Statistics = None
    mean_out: Statistics = None
    std_out: Statistics = None

    def places(self) -> list[tuple[str, int]]:
        """(channel, place from old to new) of each of the 41 inputs, in the author's order."""
        rows = range(HISTORY) if self.order == "old_to_new" else range(HISTORY - 1, -1, -1)
        found: list[tuple[str, int]] = []
        for group in _groups(self.inputs) if self.layout == "by_time" else [[c] for c in self.inputs]:
            if group == ["inertia"]:
                found.append(("inertia", 0))
            else:
                found += [(channel, row) for row in rows for channel in group]
        return found

    def inputs_of(self, name: str) -> np.ndarray:
        """`mean_in` or `std_in` for each of the 41 inputs, in the author's order."""
        given = getattr(self, name)
        if isinstance(given, dict):
            _same_names(name, given, CHANNELS)
            return np.array([given[channel] for channel, _ in self.places()], np.float64)
        return self._numbers(name, INPUTS)

    def outputs_of(self, name: str) -> np.ndarray:
        """`mean_out` or `std_out` for each output, in the author's order."""
        given = getattr(self, name)
        if isinstance(given, dict):
            _same_names(name, given, self.outputs)
            return np.array([given[channel] for channel in self.outputs], np.float64)
        return self._numbers(name, len(self.outputs))

    def _numbers(self, name: str, count: int) -> np.ndarray:
        given = getattr(self, name)
        if given is None:
            return np.full(count, 1.0 if name.startswith("std") else 0.0)
        if len(given) != count:
            raise InputError(f"{name} has {len(given)} numbers; {count} are needed (or a table by channel)")
        return np.array(given, np.float64)


@dataclass(frozen=True, kw_only=True)
class Inertia:
    """The inertia number of the networks from the project's: scale * I + offset [kg m2], or by its bodies."""

    __pydantic_config__: ClassVar[Any] = STRICT

    scale: float = 1.0
    offset: float = 0.0
    applied: bool = False
    bodies: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.bodies and (self.scale, self.offset, self.applied) != (1.0, 0.0, False):
            raise InputError("inertia: bodies, or scale and offset, not both")
        bodies.check(self.bodies)
        if not (0.0 < self.scale < math.inf and math.isfinite(self.offset)):
            raise InputError(f"scale = {self.scale:g}, offset = {self.offset:g}: finite, scale above 0")

    @property
    def line(self) -> tuple[float, float]:
        """(scale, offset); InputError where the bodies' number is no straight line of the project's."""
        return bodies.line(self.bodies) if self.bodies else (self.scale, self.offset)


@dataclass(frozen=True, kw_only=True)
class Description:
    """The whole file."""

    __pydantic_config__: ClassVar[Any] = STRICT

    pressure: Part
    velocity: Part
    channels: dict[str, ChannelUnit] = field(default_factory=dict)
    format: Literal[1] = 1
    spacing_s: float = PERIOD_S
    history: int = HISTORY
    activation: Literal["relu"] = "relu"
    symmetric: bool = False
    normalisation: Literal["inside", "outside"] = "outside"
    inertia: Inertia | None = None
    region: dict[str, tuple[float, float]] = field(default_factory=dict)
    visited: str | None = None
    meta: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if abs(self.spacing_s - PERIOD_S) > 1e-9 or self.history != HISTORY:
            raise InputError(
                f"a history of {self.history} values every {self.spacing_s:g} s; "
                f"this model has {HISTORY} every {PERIOD_S:g} s (a shorter history fits with columns of "
                "zeros in the first layer for what is older)"
            )
        for name in {*self.channels, *self.region} - {*CHANNELS}:
            raise InputError(f"no channel '{name}'; valid: {', '.join(CHANNELS)}")
        for name, (low, high) in self.region.items():
            if not -math.inf < low < high < math.inf:
                raise InputError(f"region.{name} = [{low:g}, {high:g}]: two finite numbers, the lower first")
        self.cells_visited()
        for name, outputs in OUTPUTS.items():
            self._check_part(name, self.part(name), outputs)

    def _check_part(self, name: str, part: Part, outputs: tuple[str, ...]) -> None:
        missing = [channel for channel in CHANNELS if channel not in part.inputs]
        if missing and {*part.inputs} <= {*CHANNELS}:
            raise InputError(
                f"{name}.inputs: {', '.join(missing)} missing; of what a network does not use, its first "
                "layer has columns of zeros"
            )
        _same_names(f"{name}.inputs", part.inputs, CHANNELS)
        _same_names(f"{name}.outputs", part.outputs, outputs)
        for key in ("mean_in", "std_in"):
            _check_form(f"{name}.{key}", getattr(part, key), CHANNELS, INPUTS)
            self._check_numbers(f"{name}.{key}", part.inputs_of(key))
        for key in ("mean_out", "std_out"):
            _check_form(f"{name}.{key}", getattr(part, key), outputs, len(outputs))
            self._check_numbers(f"{name}.{key}", part.outputs_of(key))

    def _check_numbers(self, name: str, values: np.ndarray) -> None:
        if not np.isfinite(values).all() or (".std" in name and not np.all(values > 0)):
            raise InputError(f"{name}: must be finite, deviations above 0 (is {values.tolist()})")

    def part(self, name: str) -> Part:
        """`pressure` or `velocity`."""
        return getattr(self, name)

    def cells_visited(self) -> np.ndarray | None:
        """SlewNetwork.visited; InputError if the bits or the region's ranges are not all there."""
        if self.visited is None:
            return None
        shape = tuple(CELL_AXES.values())
        digits = 2 * ((int(np.prod(shape)) + 7) // 8)
        if not set(self.visited) <= set("0123456789abcdef") or len(self.visited) != digits:
            raise InputError(f"visited: {digits} hexadecimal digits are needed")
        if missing := sorted({*CELL_AXES} - {*self.region}):
            raise InputError(f"visited: the region of {', '.join(missing)} is missing")
        bits = np.unpackbits(np.frombuffer(bytes.fromhex(self.visited), np.uint8), count=int(np.prod(shape)))
        return bits.reshape(shape).astype(bool)

    def unit_of(self, channel: str) -> ChannelUnit:
        """How a channel is stored: as said, else SI."""
        return self.channels.get(channel) or ChannelUnit(unit=SI[channel])


def read(path: Path | str) -> Description:
    """Read the file; raises InputError naming file and key."""
    path = Path(path)
    found = validate(Description, read_toml(path), str(path))
    for channel, stored in found.channels.items():
        if find_unit(stored.unit).exponents != find_unit(SI[channel]).exponents:
            raise InputError(
                f"{path}: channels.{channel}.unit: '{stored.unit}' is no unit like {SI[channel]}"
            )
    return found


def _groups(inputs: list[str]) -> list[list[str]]:
    """The channels with a history that stand together, and the inertia, which has none, alone."""
    groups: list[list[str]] = [[]]
    for channel in inputs:
        if channel == "inertia":
            groups += [[channel], []]
        else:
            groups[-1].append(channel)
    return [group for group in groups if group]


def _check_form(name: str, given: Any, channels: tuple[str, ...], count: int) -> None:
    """Refuse what is neither a table by channel nor a list, and what in it is no number."""
    if given is None:
        return
    if not isinstance(given, dict | list):
        numbers = "one number in brackets, such as [0.0]" if count == 1 else f"{count} numbers in brackets"
        table = ", ".join(f"{channel} = …" for channel in channels)
        raise InputError(f"{name} is {given!r}; write {numbers}, or a table by channel: {{ {table} }}")
    for key, value in given.items() if isinstance(given, dict) else enumerate(given):
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"{name}.{key}: {value!r} is no number")


def _same_names(what: str, given: list[str] | Mapping[str, Any], wanted: tuple[str, ...] | list[str]) -> None:
    if sorted(given) != sorted(wanted):
        raise InputError(f"{what}: {', '.join(given)}; needed, in any order: {', '.join(wanted)}")
