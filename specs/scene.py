"""Scenes: what stands around the machine, and where its grab is to go (`specs/scenes/*.toml`, schema).

Things are boxes (turned about the vertical), upright cylinders, half-spaces and height maps; a truck and a
hopper are made of boxes.  A thing may move along a given path.  Zones are keep-out or slow.  The ground at
z = 0 is always there.  Lengths in m, in the machine's base frame: x forward at slew angle 0, y left, z up.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from specs.errors import InputError, nearest
from specs.scenario import Target
from specs.schema import ROOT, STRICT, read_toml, validate

FOLDER = ROOT / "scenes"
Vector = tuple[float, float, float]
MOST_TARGETS, MOST_THINGS, MOST_SOLIDS = 20, 200, 400
GROUND = "ground"  # a thing's name that is taken
FARTHEST_M = 200.0  # of anything from the slew axis
WIDEST_M = 5.0  # of a tolerance: more is no target


@dataclass(frozen=True, kw_only=True)
class Goal(Target):
    """A target of a scene: where the grab stops, or what it passes (`through`); one that moves has a `path`.

    Rows of `path`: time [s] since the machine sets out for it, and how far from its place it is then [m].
    """

    through: bool = False
    path: tuple[tuple[float, float, float, float], ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if any(b[0] <= a[0] for a, b in pairwise(self.path)):
            raise InputError("path: times must grow")
        if self.through and self.path:
            raise InputError("through: a target that moves cannot be passed")

    def at(self, seconds: np.ndarray) -> np.ndarray:
        """Where it is (n, 3) at times since the machine set out [s]; before and after its path it rests."""
        places = np.tile(self.xyz, (len(seconds), 1))
        if self.path:
            times, *away = np.array(self.path).T
            places = places + np.stack([np.interp(seconds, times, one) for one in away], axis=1)
        return places


@dataclass(frozen=True, kw_only=True)
class Thing:
    """What all things share: a name for messages, and where it is at which time, if it moves."""

    __pydantic_config__: ClassVar[Any] = STRICT

    name: str
    path: tuple[tuple[float, float, float, float], ...] = ()  # time [s], and how far from its place [m]

    def __post_init__(self) -> None:
        if not self.name.strip():
            raise InputError("empty name")
        if any(b[0] <= a[0] for a, b in pairwise(self.path)):
            raise InputError("path: times must grow")

    def places(self) -> tuple[Vector, ...]:
        """How far from its place it comes, at the corners of its path."""
        return tuple(row[1:] for row in self.path) or ((0.0, 0.0, 0.0),)


@dataclass(frozen=True, kw_only=True)
class Box(Thing):
    """A box, its sides turned by `turn_deg` about the vertical."""

    middle: Vector
    size: Vector
    turn_deg: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        _positive(size=min(self.size))


@dataclass(frozen=True, kw_only=True)
class Cylinder(Thing):
    """An upright cylinder on its `foot`."""

    foot: Vector
    radius: float
    height: float

    def __post_init__(self) -> None:
        super().__post_init__()
        _positive(radius=self.radius, height=self.height)


@dataclass(frozen=True, kw_only=True)
class HalfSpace(Thing):
    """Everything behind a plane: `normal` points to the free side."""

    point: Vector
    normal: Vector

    def __post_init__(self) -> None:
        super().__post_init__()
        if math.hypot(*self.normal) < 1e-6:
            raise InputError("normal has no direction")

    @property
    def unit(self) -> Vector:
        """The normal of length 1."""
        length = math.hypot(*self.normal)
        x, y, z = (value / length for value in self.normal)
        return x, y, z


@dataclass(frozen=True, kw_only=True)
class HeightMap(Thing):
    """A pile: a column of the given height above z = 0 on each cell; rows along y, entries along x."""

    corner: tuple[float, float]  # smallest x and y
    cell: float
    heights: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        _positive(cell=self.cell)
        if not self.heights or not self.heights[0]:
            raise InputError("heights: no cells")
        widths = [len(row) for row in self.heights]
        for number, width in enumerate(widths, 1):
            if width != max(widths):
                raise InputError(
                    f"heights: row {number} has {width} cells, others {max(widths)}: the map has gaps; "
                    "write 0 where nothing lies"
                )
        if min(map(min, self.heights)) < 0.0:
            raise InputError("heights: none below 0")

    def columns(self) -> Iterator[Box]:
        """The cells that have a height, as boxes; runs of equal height in a row are one."""
        for j, row in enumerate(self.heights):
            start = 0
            for i in range(1, len(row) + 1):
                if i < len(row) and row[i] == row[start]:
                    continue
                if row[start] > 0.0:
                    x = self.corner[0] + self.cell * (start + i) / 2
                    y = self.corner[1] + self.cell * (j + 0.5)
                    size = (self.cell * (i - start), self.cell, row[start])
                    yield Box(name=self.name, middle=(x, y, row[start] / 2), size=size, path=self.path)
                start = i


@dataclass(frozen=True, kw_only=True)
class Truck(Thing):
    """A truck on the ground: bed with walls, open above, and a cab in front of it (along its +x)."""

    middle: tuple[float, float]  # of the bed
    turn_deg: float = 0.0
    bed: tuple[float, float] = (7.0, 2.5)
    floor: float = 1.2
    walls: float = 1.4
    cab_height: float = 3.2

    def __post_init__(self) -> None:
        super().__post_init__()
        _positive(bed=min(self.bed), floor=self.floor, walls=self.walls, cab_height=self.cab_height)

    def parts(self) -> Iterator[Box]:
        """Floor, four walls, cab."""
        length, width = self.bed
        thick, top = 0.1, self.floor + self.walls / 2
        sizes = {
            "floor": ((0.0, 0.0, self.floor / 2), (length, width, self.floor)),
            "left wall": ((0.0, width / 2, top), (length, thick, self.walls)),
            "right wall": ((0.0, -width / 2, top), (length, thick, self.walls)),
            "front wall": ((length / 2, 0.0, top), (thick, width, self.walls)),
            "tailgate": ((-length / 2, 0.0, top), (thick, width, self.walls)),
            "cab": ((length / 2 + 1.4, 0.0, self.cab_height / 2), (2.2, width, self.cab_height)),
        }
        yield from _assembled(self, (*self.middle, 0.0), self.turn_deg, sizes)


@dataclass(frozen=True, kw_only=True)
class Hopper(Thing):
    """A hopper on the ground, open above: four walls as high as its rim, and the bottom inside."""

    middle: tuple[float, float]
    turn_deg: float = 0.0
    opening: tuple[float, float] = (3.2, 3.2)
    rim: float = 3.5
    bottom: float = 1.5

    def __post_init__(self) -> None:
        super().__post_init__()
        _positive(opening=min(self.opening), bottom=self.bottom)
        if self.rim <= self.bottom:
            raise InputError(f"rim = {self.rim:g}: above the bottom ({self.bottom:g})")

    def parts(self) -> Iterator[Box]:
        """Bottom and four walls."""
        a, b = self.opening
        thick, half = 0.2, self.rim / 2
        sizes = {
            "bottom": ((0.0, 0.0, self.bottom / 2), (a, b, self.bottom)),
            "left rim": ((0.0, b / 2, half), (a + thick, thick, self.rim)),
            "right rim": ((0.0, -b / 2, half), (a + thick, thick, self.rim)),
            "front rim": ((a / 2, 0.0, half), (thick, b + thick, self.rim)),
            "rear rim": ((-a / 2, 0.0, half), (thick, b + thick, self.rim)),
        }
        yield from _assembled(self, (*self.middle, 0.0), self.turn_deg, sizes)


@dataclass(frozen=True, kw_only=True)
class Zone:
    """A place that the grab keeps out of, or is no faster in than `speed_m_s`."""

    __pydantic_config__: ClassVar[Any] = STRICT

    kind: Literal["keep_out", "slow"]
    shape: Box | Cylinder
    speed_m_s: float = 1.0

    def __post_init__(self) -> None:
        _positive(speed_m_s=self.speed_m_s)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A scene, checked for itself; whether the machine fits in is checked by who plans in it."""

    __pydantic_config__: ClassVar[Any] = STRICT

    name: str
    description: str
    start: Goal
    targets: tuple[Goal, ...]
    family: str = ""
    tolerance_m: float = 0.5  # within which a target is reached
    load_kg: tuple[float, float] = (0.0, 2000.0)  # from, to: drawn, not told
    things: tuple[Thing, ...] = ()
    zones: tuple[Zone, ...] = field(default=())

    def __post_init__(self) -> None:
        if not 1 <= len(self.targets) <= MOST_TARGETS:
            raise InputError(f"targets: {len(self.targets)}, need 1 to {MOST_TARGETS}")
        if len(self.things) > MOST_THINGS:
            raise InputError(f"things: {len(self.things)}, at most {MOST_THINGS}")
        if self.start.through or self.start.path:
            raise InputError("start: the grab hangs there; it is not passed, and does not move")
        if self.targets[-1].through:
            raise InputError("targets: the last one is where the way ends, it cannot be passed")
        for number, target in enumerate(self.targets[:-1], 1):
            if target.path:
                raise InputError(f"targets.{number}: only the last one may move")
        _positive(tolerance_m=self.tolerance_m)
        _at_most(WIDEST_M, tolerance_m=self.tolerance_m)
        if not 0.0 <= self.load_kg[0] <= self.load_kg[1] <= 5000.0:
            raise InputError("load_kg: need 0 <= from <= to <= 5000")
        if len(self.solids()) > MOST_SOLIDS:
            count = {thing.name: len(list(parts_of(thing))) for thing in self.things}
            most = max(count, key=lambda name: count[name])
            raise InputError(
                f"things: {len(self.solids())} solids, at most {MOST_SOLIDS}; '{most}' alone has "
                f"{count[most]}: larger cells or fewer things"
            )
        names = [GROUND, *(thing.name for thing in self.things)]
        if twice := [name for name in names if names.count(name) > 1]:
            raise InputError(f"two things called '{twice[0]}'")

    def stops(self) -> tuple[tuple[Goal, ...], ...]:
        """The targets of each leg: those passed on the way, then the one it stops at."""
        found: list[tuple[Goal, ...]] = []
        passed: tuple[Goal, ...] = ()
        for target in self.targets:
            passed = (*passed, target)
            if not target.through:
                found.append(passed)
                passed = ()
        return tuple(found)

    def solids(self) -> tuple[Box | Cylinder | HalfSpace, ...]:
        """Everything that must not be touched, as boxes, cylinders and half-spaces; the ground among them."""
        ground = HalfSpace(name=GROUND, point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))
        return (ground, *(part for thing in self.things for part in parts_of(thing)))

    def keep_outs(self) -> tuple[Box | Cylinder, ...]:
        """The keep-out zones' shapes."""
        return tuple(zone.shape for zone in self.zones if zone.kind == "keep_out")


KINDS: dict[str, type[Thing]] = {
    "box": Box, "cylinder": Cylinder, "half_space": HalfSpace, "height_map": HeightMap,
    "truck": Truck, "hopper": Hopper,
}  # fmt: skip
ZONES = {kind: KINDS[kind] for kind in ("box", "cylinder")}


def names() -> list[str]:
    """The scenes that ship."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load(text: str, also: Sequence[str] = ()) -> Scene:
    """The scene of this name, or of a file (path ending in .toml).

    InputError names the valid ones, those of `also` among them.
    """
    if text.endswith(".toml"):
        return build(Path(text).stem, read_toml(Path(text)), text)
    if text not in names():
        raise InputError(f"unknown scene '{text}'; {nearest(text, [*names(), *also])}, or a .toml file")
    return build(text, read_toml(FOLDER / f"{text}.toml"), f"specs/scenes/{text}.toml")


def build(name: str, data: Mapping[str, Any], where: str) -> Scene:
    """The content of a scene file as a Scene; every mistake names `where` and the key."""
    parts: dict[str, Any] = {"name": name, **data}
    if "start" in data:
        parts["start"] = validate(Goal, data["start"], f"{where}: start")
    parts["targets"] = tuple(
        validate(Goal, entry, f"{where}: targets.{i}")
        for i, entry in enumerate(_list(data, "targets", where), 1)
    )
    parts["things"] = tuple(
        _thing(entry, KINDS, f"{where}: things.{i}")
        for i, entry in enumerate(_list(data, "things", where), 1)
    )
    parts["zones"] = tuple(
        _zone(entry, f"{where}: zones.{i}") for i, entry in enumerate(_list(data, "zones", where), 1)
    )
    return validate(Scene, parts, where)


def _list(data: Mapping[str, Any], key: str, where: str) -> Sequence[Any]:
    found = data.get(key, [])
    if not isinstance(found, list):
        raise InputError(f"{where}: {key}: a list of tables, as in [[{key}]]")
    return found


def _thing(entry: Any, kinds: Mapping[str, type[Thing]], where: str) -> Thing:
    if not isinstance(entry, dict):
        raise InputError(f"{where}: expected a table")
    kind = entry.get("kind", "")
    if kind not in kinds:
        raise InputError(f"{where}: unknown shape '{kind}'; valid: {', '.join(kinds)}")
    if kinds[kind] is HeightMap:
        _refuse_gaps(entry.get("heights"), where)
    thing = validate(kinds[kind], {k: v for k, v in entry.items() if k != "kind"}, where)
    lengths = {k: v for k, v in vars(thing).items() if k not in ("turn_deg", "normal")}
    lengths["path"] = thing.places()  # without its times
    for value in _numbers(lengths):
        if abs(value) > FARTHEST_M:
            raise InputError(f"{where}: {value:g} is too large: at most {FARTHEST_M:g} m")
    if abs(vars(thing).get("turn_deg", 0.0)) > 360.0:
        raise InputError(f"{where}: turn_deg = {vars(thing)['turn_deg']:g}: at most 360")
    return thing


def _refuse_gaps(heights: Any, where: str) -> None:
    """Raise InputError at the first cell that has no height: nan, or a text."""
    for j, row in enumerate(heights if isinstance(heights, list) else [], 1):
        for i, cell in enumerate(row if isinstance(row, list) else [], 1):
            if isinstance(cell, str) or (isinstance(cell, float) and math.isnan(cell)):
                raise InputError(
                    f"{where}: heights: row {j}, cell {i} is {cell!r}: the map has gaps; "
                    "write 0 where nothing lies"
                )


def _zone(entry: Any, where: str) -> Zone:
    if not isinstance(entry, dict):
        raise InputError(f"{where}: expected a table")
    own = {k: v for k, v in entry.items() if k in ("kind", "speed_m_s")}
    if own.get("kind") not in ("keep_out", "slow"):
        raise InputError(f"{where}: unknown kind '{own.get('kind', '')}'; valid: keep_out, slow")
    shape = {k: v for k, v in entry.items() if k not in own}
    shape = {"kind": shape.pop("shape", ""), "name": shape.pop("name", own["kind"]), **shape}
    return validate(Zone, {**own, "shape": _thing(shape, ZONES, where)}, where)


def _numbers(values: Any) -> Iterator[float]:
    if isinstance(values, Mapping):
        values = values.values()
    if isinstance(values, int | float):
        yield float(values)
    elif not isinstance(values, str):
        for value in values:
            yield from _numbers(value)


def parts_of(thing: Thing) -> Iterator[Box | Cylinder | HalfSpace]:
    """What a thing is made of."""
    if isinstance(thing, Truck | Hopper):
        yield from thing.parts()
    elif isinstance(thing, HeightMap):
        yield from thing.columns()
    elif isinstance(thing, Box | Cylinder | HalfSpace):
        yield thing


def _assembled(
    thing: Thing, at: Vector, turn_deg: float, sizes: Mapping[str, tuple[Vector, Vector]]
) -> Iterator[Box]:
    """Boxes given in a thing's own frame, put where it stands."""
    turn = math.radians(turn_deg)
    for part, ((x, y, z), size) in sizes.items():
        middle = (
            at[0] + x * math.cos(turn) - y * math.sin(turn),
            at[1] + x * math.sin(turn) + y * math.cos(turn),
            at[2] + z,
        )
        yield Box(name=f"{thing.name}: {part}", middle=middle, size=size, turn_deg=turn_deg, path=thing.path)


def moved(solid: Box | Cylinder | HalfSpace, by: Vector) -> Box | Cylinder | HalfSpace:
    """The same solid, `by` so much away."""
    place = {Box: "middle", Cylinder: "foot", HalfSpace: "point"}[type(solid)]
    x, y, z = (a + b for a, b in zip(getattr(solid, place), by, strict=True))
    return replace(solid, **{place: (x, y, z)})


def _positive(**values: float) -> None:
    for key, value in values.items():
        if not value > 0.0:
            raise InputError(f"{key} = {value:g}: must be positive")


def _at_most(most: float, **values: float) -> None:
    for key, value in values.items():
        if value > most:
            raise InputError(f"{key} = {value:g}: at most {most:g} m")
