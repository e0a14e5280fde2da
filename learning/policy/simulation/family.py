"""The drives that a policy must be right on: slew networks as they are, mirrored, late and taken forward.

A policy that is trained on one network learns that network's own answer to fast changes of the joystick. With
a family each network takes part four times: as it is and as its mirror image, with the speed that it was
trained on and with that speed taken forward (plant.py, `ahead`).  Nothing tells the policy which one it
drives.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from fmus.models.slew_nn.network import SlewNetwork
from learning.policy.recipe import Recipe
from specs.policy import SPACING_S


@dataclass(frozen=True)
class Member:
    """A slew network, how many periods it runs ahead of the clock, and a name for messages."""

    network: SlewNetwork
    ahead: int
    name: str


def members(recipe: Recipe, networks: Sequence[SlewNetwork]) -> list[Member]:
    """Whom the machines are shared out among; networks of the same sizes and `ahead` are neighbours."""
    ahead = round(recipe.ahead_s / SPACING_S)
    if not recipe.family:
        return [Member(network, ahead, f"{i + 1}") for i, network in enumerate(networks)]
    found = []
    for i, network in enumerate(networks):
        for periods in sorted({0, ahead}):
            name = f"{i + 1}, {periods} ahead"
            found.append(Member(network, periods, name))
            if not network.symmetric:
                found.append(Member(network.mirrored(), periods, f"{name}, mirrored"))
    return found
