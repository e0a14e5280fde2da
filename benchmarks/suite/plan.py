"""Which case is what: system and seed of each case follow from the suite's seed and the case's number."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from specs.errors import InputError, nearest

# Twenty cases hold every system at least three times: 15 %.
BLOCK = {"servo": 5, "arm": 5, "tool": 4, "slew": 3, "machine": 3}
NOISES = ("low", "high")
VISIBLE = ("drawn", "none", "outside")
SETTINGS = "suite.json"


@dataclass(frozen=True)
class Case:
    """A case to do: its number, its system and the seed that it is drawn from."""

    number: int
    system: str
    seed: int

    @property
    def key(self) -> str:
        """Name of its folder."""
        return f"{self.number:04d}"


@dataclass(frozen=True)
class Settings:
    """What the cases of a suite depend on.

    `system` None: the mix of BLOCK; `visible` "drawn": one to three effects, "none": none, "outside": one of
    them is not in the catalogue.
    """

    seed: int
    noise: str = "low"
    system: str | None = None
    visible: str = "drawn"

    def __post_init__(self) -> None:
        for what, value, known in (
            ("noise", self.noise, NOISES),
            ("system", self.system, (None, *BLOCK)),
            ("set of visible effects", self.visible, VISIBLE),
        ):
            if value not in known:
                raise InputError(f"no {what} '{value}'; {nearest(str(value), [k for k in known if k])}")
        if self.seed < 0:
            raise InputError(f"seed {self.seed} is negative; seeds are 0 or more")

    def case(self, number: int) -> Case:
        """The case of a number, from 0."""
        size = sum(BLOCK.values())
        kinds = [name for name, count in BLOCK.items() for _ in range(count)]
        order = np.random.default_rng([self.seed, number // size, 0]).permutation(size)
        seed = int(np.random.default_rng([self.seed, number, 1]).integers(2**62))
        return Case(number, self.system or kinds[order[number % size]], seed)


def settle(out: Path, seed: int | None, fresh: int, **wanted) -> Settings:
    """The settings of the suite in `out`: those it was begun with, which must be the ones wanted.

    `seed` None takes the suite's own, or `fresh` for a new one.
    Raises InputError when another suite lies there, or something that is none.
    """
    path = out / SETTINGS
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; name a folder for the suite")
    if not path.is_file():
        if out.is_dir() and any(out.iterdir()):
            raise InputError(f"{out} holds something else than a suite; name a new folder")
        found = Settings(fresh if seed is None else seed, **wanted)
        out.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(asdict(found), indent=1) + "\n")
        return found
    there = read(path)
    asked = Settings(there.seed if seed is None else seed, **wanted)
    for name, value in asdict(asked).items():
        if value != (old := asdict(there)[name]):
            raise InputError(f"{out} holds a suite with {name} {old}, not {value}; name another folder")
    return there


def read(path: Path) -> Settings:
    """The settings of a suite's file; InputError when it is none."""
    try:
        return Settings(**json.loads(path.read_text()))
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"{path} holds no settings of a suite: {error}") from None
