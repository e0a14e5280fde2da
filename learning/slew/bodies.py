"""The inertia number of other people's networks from the masses and lengths that they computed it with.

Theirs is `kinematics.inertia_z` with their bodies in place of the project's.  Networks take one number, so
that the map between both is a straight line, by least squares over poses and loads.
"""

from collections.abc import Mapping
from itertools import product
from types import SimpleNamespace

import numpy as np

from fmus.equations import kinematics
from specs.errors import InputError, nearest

BODIES = (
    "carriage_mass", "carriage_length", "carriage_width", "carriage_x",
    "cabin_mass", "cabin_length", "cabin_width", "cabin_x", "cabin_y",
    "boom_mass", "boom_length", "boom_com", "boom_foot_x",
    "stick_mass", "stick_length", "stick_com", "tool_mass",
)  # fmt: skip
MOST_APART = 0.1  # rms of the line's error over the mean of their number
POSES, LOADS_KG = 9, (0.0, 1000.0, 2000.0)


def check(bodies: Mapping[str, float]) -> None:
    """InputError for names that are no body's, or values that cannot be one's."""
    for name, value in bodies.items():
        if name not in BODIES:
            raise InputError(
                f"inertia.bodies: no '{name}'; {nearest(name, BODIES)} (specs/parameters/geometry)"
            )
        signed = name.endswith(("_x", "_y"))  # places; masses, lengths and shares are above 0
        if not np.isfinite(value) or (value <= 0.0 and not signed):
            raise InputError(f"inertia.bodies: {name} = {value:g}: finite{'' if signed else ', above 0'}")


def line(bodies: Mapping[str, float]) -> tuple[float, float]:
    """(scale, offset [kg m2]) of their number over the project's, where these bodies differ from its own.

    InputError where the numbers of the poses are no straight line of one another.
    """
    own = kinematics.geometry()
    theirs = SimpleNamespace(**{**vars(own), **bodies})
    ours, wanted = (np.array([kinematics.inertia_z(*at, g) for at in _places(own)]) for g in (own, theirs))
    scale, offset = (float(v) for v in np.polyfit(ours, wanted, 1))
    apart = float(np.std(scale * ours + offset - wanted)) / float(np.mean(wanted))
    if not (scale > 0.0 and apart <= MOST_APART):
        raise InputError(
            "inertia.bodies: their number is no straight line of the project's over the poses: "
            f"{100 * apart:.0f} % off (rms), scale {scale:.2f}; "
            f"at most {100 * MOST_APART:.0f} %, scale above 0"
        )
    return scale, offset


def _places(g: SimpleNamespace) -> list[tuple[float, float, float]]:
    """Boom, stick [rad] and load [kg], over the arm's range."""
    boom, stick = (
        np.linspace(getattr(g, f"{j}_min"), getattr(g, f"{j}_max"), POSES) for j in ("boom", "stick")
    )
    return [(float(q), float(s), load) for q, s, load in product(boom, stick, LOADS_KG)]
