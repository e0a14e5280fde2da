"""Drawn scenes: six families, in four disjoint sets, each scene from the SHA-256 of (family, set, number).

training, tuning, validation; test is sealed as the machines' test draws are (specs/draws.py): it is opened
for final figures alone, and each opening is logged.  A scene is named FAMILY:SET:NUMBER.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from specs import keys
from specs.draws import SEALED, Opened
from specs.errors import InputError, nearest
from specs.scene import Box, Cylinder, Goal, HeightMap, Hopper, Scene, Truck, Zone, load

SETS = {"training": 8, "tuning": 4, "validation": 4, SEALED: 4}  # scenes of each family
GRAB_M = 1.0  # from the grab point to the lowest of the grab, about


@dataclass(frozen=True)
class Draw:
    """Uniform numbers by name."""

    family: str
    which: str
    number: int

    def __call__(self, name: str, low: float, high: float) -> float:
        share = keys.uniform("scene", self.family, self.which, self.number, name)
        return round(low + (high - low) * share, 3)

    def side(self) -> float:
        """1 or -1."""
        return 1.0 if self("side", 0.0, 1.0) < 0.5 else -1.0


def names(which: str) -> list[str]:
    """The names of a set's scenes."""
    if which not in SETS:
        raise InputError(f"unknown set of scenes '{which}'; {nearest(which, SETS)}")
    return [f"{family}:{which}:{k}" for family in FAMILIES for k in range(SETS[which])]


def draw(name: str, opened: Opened | None = None) -> Scene:
    """The scene FAMILY:SET:NUMBER; InputError for another name, and for a sealed one without leave."""
    family, _, rest = name.partition(":")
    which, _, number = rest.partition(":")
    if family not in FAMILIES:
        raise InputError(f"scene {name}: unknown family '{family}'; {nearest(family, FAMILIES)}")
    if which not in SETS:
        raise InputError(f"scene {name}: unknown set '{which}'; {nearest(which, SETS)}")
    if not number.isdigit() or int(number) >= SETS[which]:
        raise InputError(f"scene {name}: numbers of set {which} are 0 to {SETS[which] - 1}")
    if which == SEALED and opened is None:
        raise InputError(
            f"scene {name}: the test scenes are sealed: --sealed PURPOSE opens them, and logs it"
        )
    made = FAMILIES[family](Draw(family, which, int(number)))
    return Scene(name=name, family=family, **made)


def _at(slew_deg: float, radius: float, height: float) -> Goal:
    return Goal(slew_deg=round(slew_deg, 3), radius_m=round(radius, 3), height_m=round(height, 3))


def _place(slew_deg: float, radius: float) -> tuple[float, float]:
    slew = math.radians(slew_deg)
    return round(radius * math.cos(slew), 6), round(radius * math.sin(slew), 6)


def _pile(name: str, slew_deg: float, radius: float, top: float) -> HeightMap:
    """A pyramid of 4 by 4 cells."""
    x, y = _place(slew_deg, radius)
    cells = [[min(i, 3 - i, j, 3 - j) for i in range(4)] for j in range(4)]
    heights = tuple(tuple(round(top * (0.4 + 0.6 * c), 3) for c in row) for row in cells)
    return HeightMap(name=name, corner=(round(x - 2, 6), round(y - 2, 6)), cell=1.0, heights=heights)


def _wall(name: str, slew_deg: float, inner: float, outer: float, top: float) -> Box:
    """A wall that runs outwards from the machine."""
    middle = _place(slew_deg, (inner + outer) / 2)
    return Box(
        name=name, middle=(*middle, top / 2), size=(round(outer - inner, 6), 0.4, top), turn_deg=slew_deg
    )


def _truck(d: Draw) -> dict[str, Any]:
    """From a pile over the side wall of a truck, and back."""
    side, radius, walls = d.side(), d("radius", 10.0, 11.5), d("walls", 0.8, 1.4)
    turn = side * d("turn", 75.0, 115.0)
    x, y = _place(turn, radius)
    pile = d("pile", 0.8, 1.8)
    truck = Truck(name="truck", middle=(x, y), turn_deg=turn + 90.0, walls=walls)
    high = 1.2 + walls + GRAB_M + d("above", 0.6, 1.2)
    slow = Zone(
        kind="slow",
        shape=Box(name="over the truck", middle=(x, y, 2.5), size=(7.0, 2.5, 5.0), turn_deg=turn + 90.0),
        speed_m_s=1.5,
    )
    start = _at(0.0, d("pick", 9.0, 10.5), pile + GRAB_M + d("lift", 0.7, 1.2))
    return {
        "description": "From a pile over the side wall into a truck, and back",
        "start": start,
        "targets": (_at(turn, radius, high), start),
        "things": (truck, _pile("pile", 0.0, start.radius_m, pile)),
        "zones": (slow,),
    }


def _bays(d: Draw) -> dict[str, Any]:
    """From bay to bay over the walls between them."""
    first, width = d("first", -80.0, -50.0), d("width", 42.0, 55.0)
    tops = [d(f"wall {k}", 2.5, 5.0) for k in range(2)]
    walls = [
        _wall(f"bay wall {k + 1}", first + (k + 0.5) * width, 6.5, 13.0, top) for k, top in enumerate(tops)
    ]
    places = [_at(first + k * width, d(f"r {k}", 8.8, 10.8), d(f"h {k}", 2.6, 4.5)) for k in range(3)]
    return {
        "description": "Sorting between three bays",
        "start": places[0],
        "targets": (places[1], places[2], places[0]),
        "things": tuple(walls),
    }


def _hopper(d: Draw) -> dict[str, Any]:
    """From the ground into a hopper, below its rim."""
    side, radius, rim = d.side(), d("radius", 9.5, 11.0), d("rim", 3.2, 4.5)
    turn = side * d("turn", 60.0, 130.0)
    hopper = Hopper(
        name="hopper", middle=_place(turn, radius), turn_deg=turn, rim=rim, bottom=1.0,
        opening=(d("length", 3.8, 4.6), d("width", 3.8, 4.6)),
    )  # fmt: skip
    start = _at(0.0, d("pick", 9.0, 10.5), d("lift", 2.2, 3.5))
    return {
        "description": "Into a hopper below its rim, and back",
        "start": start,
        "targets": (_at(turn, radius, rim + d("dip", 0.1, 0.6)), start),
        "things": (hopper,),
    }


def _gantry(d: Draw) -> dict[str, Any]:
    """Below a gantry's beam, with the arm kept low."""
    side, turn = d.side(), d("turn", 70.0, 110.0)
    middle = side * turn * d("where", 0.4, 0.6)
    radius, height = d("radius", 11.0, 12.5), d("height", 11.6, 12.6)
    x, y = _place(middle, radius)
    beam = Box(name="beam", middle=(x, y, height), size=(1.0, 10.0, 1.0), turn_deg=middle + 90.0)
    legs = [
        Cylinder(name=f"leg {k}", foot=(*_place(middle, r), 0.0), radius=0.3, height=height)
        for k, r in ((1, radius + 5.0),)
    ]
    return {
        "description": "Past a gantry whose beam the arm has to clear",
        "start": _at(0.0, d("from", 9.5, 10.5), d("low", 2.8, 3.6)),
        "targets": (_at(side * turn, d("to", 9.5, 10.5), d("end", 2.8, 3.6)),),
        "things": (beam, *legs),
    }


def _pole(d: Draw) -> dict[str, Any]:
    """A pole between start and target, near enough for the boom."""
    side, turn = d.side(), d("turn", 70.0, 120.0)
    where = side * turn * d("where", 0.35, 0.65)
    pole = Cylinder(
        name="pole", foot=(*_place(where, d("radius", 7.5, 9.5)), 0.0), radius=d("thick", 0.15, 0.3),
        height=d("height", 4.0, 6.5),
    )  # fmt: skip
    post = Cylinder(name="post", foot=(*_place(where + 25.0, 13.5), 0.0), radius=0.2, height=8.0)
    return {
        "description": "Past a pole near the boom",
        "start": _at(0.0, d("from", 9.0, 11.0), d("low", 2.8, 4.5)),
        "targets": (_at(side * turn, d("to", 9.0, 11.0), d("end", 2.8, 4.5)),),
        "things": (pole, post),
    }


def _gap(d: Draw) -> dict[str, Any]:
    """A wall close behind the machine, and bays ahead: the tail swings through a narrow gap."""
    side, turn = d.side(), d("turn", 60.0, 120.0)
    gap = d("gap", 0.5, 1.0)  # beyond the carriage's turning circle
    tail = 3.55 + gap
    behind = Box(name="wall behind", middle=(-(tail + 0.2), 0.0, 2.0), size=(0.4, 12.0, 4.0))
    wall = _wall("bay wall", side * turn / 2, 7.0, 13.0, d("wall", 3.0, 4.5))
    return {
        "description": "Over a wall, with a wall close behind the machine",
        "start": _at(0.0, d("from", 9.0, 10.5), d("low", 2.6, 4.0)),
        "targets": (_at(side * turn, d("to", 9.0, 10.5), d("end", 2.6, 4.0)),),
        "things": (behind, wall),
    }


FAMILIES: dict[str, Callable[[Draw], dict[str, Any]]] = {
    "truck": _truck, "bays": _bays, "hopper": _hopper, "gantry": _gantry, "pole": _pole, "gap": _gap,
}  # fmt: skip


def find(texts: Sequence[str]) -> list[Scene]:
    """Scenes as a user names them: a file, one that ships, FAMILY:SET:NUMBER, or all of a set.

    InputError names the valid ones.
    """
    found = []
    for text in texts:
        if text in SETS:
            found += [draw(name) for name in names(text)]
        elif ":" in text and not text.endswith(".toml"):
            found.append(draw(text))
        else:
            found.append(load(text, [*SETS, *(f"{family}:tuning:0" for family in FAMILIES)]))
    called = [scene.name for scene in found]
    if twice := [name for name in called if called.count(name) > 1]:
        raise InputError(f"scene {twice[0]} is named twice")
    return found


def single(text: str) -> Scene:
    """The one scene that a text names; InputError for a set of them, and as `find`."""
    found = find([text])
    if len(found) != 1:
        raise InputError(f"'{text}' is a set of {len(found)} scenes; name one, as {found[0].name}")
    return found[0]


def sealed(opened: Opened) -> list[Scene]:
    """All scenes of the sealed set."""
    return [draw(name, opened) for name in names(SEALED)]
