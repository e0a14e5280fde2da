"""What goes into a bundle, before it is compiled."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from deployment.bundling.blocks import Block, External, Outside
from deployment.bundling.guard import Zones
from runtime import bundle as form


@dataclass(frozen=True)
class Content:
    """What goes into a bundle: the controller's block, what evaluates it, files beside the core."""

    name: str
    controller: Block | External | Outside
    engine: str = form.NATIVE
    files: Mapping[str, bytes] = field(default_factory=dict)
    calibration: Mapping[str, float] = field(default_factory=dict)  # of the load estimate
    zeros: Mapping[str, float] = field(default_factory=dict)  # of sensors, SI
    arm: Mapping[str, float] = field(default_factory=dict)  # parameters of the arm loops
    guard: Zones | None = None  # what the guard keeps off; None: there is no guard
