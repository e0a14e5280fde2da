"""Recipes: what is trained, how, and for how long.  A variant is a changed copy of another one."""

from dataclasses import dataclass, replace
from typing import Literal

from specs.errors import InputError, nearest

Architecture = Literal["mlp", "tcn", "transformer"]


@dataclass(frozen=True)
class Recipe:
    """How one slew model is trained; the loss is the squared one-step error unless `unroll` says more."""

    name: str
    why: str
    architecture: Architecture = "mlp"
    pressure: bool = True  # the velocity network sees measured and predicted pressures
    inertia: bool = True
    mirror: bool = True  # every recording is also learned the other way round
    closed_loop: bool = True  # recordings of closed-loop control are learned from
    residual: bool = True  # networks predict changes, not values
    symmetric: bool = False  # mirror symmetry by construction
    epochs: int = 40
    batch: int = 1024
    rate: float = 1e-3  # largest learning rate
    unroll: int = 0  # steps of the second phase's open-loop loss; 0: no second phase
    unroll_epochs: int = 0
    unroll_rate: float = 3e-4


PROPOSED = Recipe("proposed", "the paper's networks: pressure first, then speed, one-step loss")
RECIPES = {
    recipe.name: recipe
    for recipe in (
        PROPOSED,
        replace(PROPOSED, name="no_pressure", why="speed from joystick and speed alone", pressure=False),
        replace(PROPOSED, name="no_inertia", why="without the slew inertia", inertia=False),
        replace(PROPOSED, name="no_mirroring", why="without the mirrored recordings", mirror=False),
        replace(PROPOSED, name="no_closed_loop", why="without the closed-loop recordings", closed_loop=False),
        replace(PROPOSED, name="absolute", why="predicts values in place of changes", residual=False),
        replace(
            PROPOSED, name="symmetric", why="mirror symmetry by construction", symmetric=True, mirror=False
        ),
        replace(
            PROPOSED,
            name="unrolled",
            why="then trained on 2 s of its own predictions",
            unroll=20,
            unroll_epochs=6,
        ),
        replace(
            PROPOSED, name="tcn", why="temporal convolutions over the history", architecture="tcn", epochs=20
        ),
        replace(
            PROPOSED,
            name="transformer",
            why="attention over the history",
            architecture="transformer",
            epochs=10,
        ),
    )
}
ENSEMBLE = "ensemble"  # the networks of all seeds of MEMBERS, averaged
MEMBERS = "unrolled"
TINY_EPOCHS = 2  # to see that all of it runs


def recipe(name: str, tiny: bool = False) -> Recipe:
    """The recipe of that name, cut down to seconds if `tiny`; raises InputError for an unknown one."""
    if name not in RECIPES:
        raise InputError(f"no recipe '{name}'; {nearest(name, RECIPES)}")
    found = RECIPES[name]
    if not tiny:
        return found
    return replace(found, epochs=TINY_EPOCHS, unroll=min(found.unroll, 3), unroll_epochs=min(found.unroll, 1))


def exportable(chosen: Recipe) -> bool:
    """Whether the recipe's networks can be plain weights."""
    return chosen.architecture == "mlp"


def whole(chosen: Recipe) -> bool:
    """Whether they also have all inputs of the paper's, so that they can stand in for the slew drive."""
    return exportable(chosen) and chosen.pressure and chosen.inertia
