"""What a case needs of each kind of machine: how to draw it, drive it, and which effects it can have."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from blindtest.effects import axis as axis_effects, machine
from blindtest.effects.effect import Effect, Scale
from blindtest.systems import arm, drives, machine as whole, servo, slew, tool
from blindtest.systems.drives import Driven

JOINTS = ("boom", "stick")
# The plain servo has viscous friction of its own: more of it is another value of that, no missing effect.
SERVO = tuple(e for e in axis_effects.EFFECTS if e.name != "viscous_friction")


@dataclass(frozen=True)
class Kit:
    """One kind of machine; effects depend on the machine drawn (which joint it is about)."""

    name: str
    draw: Callable[[np.random.Generator], Any]  # -> System
    drives: Callable[[Any, np.random.Generator], list[Driven]]
    scale: Callable[[Any, list[Driven]], Scale]
    effects: Callable[[Any], tuple[Effect, ...]]
    besides: Callable[[Any], tuple[Effect, ...]]
    outside: Callable[[Any], tuple[Effect, ...]]

    def declared(self, system: Any) -> tuple[Effect, ...]:
        """All effects of the catalogue that an answer may hold: those that cases have and those besides."""
        return (*self.effects(system), *self.besides(system))


KITS = {
    kit.name: kit
    for kit in (
        Kit(
            "servo",
            servo.draw,
            drives.servo,
            drives.servo_scale,
            lambda _: SERVO,
            lambda _: (*axis_effects.BESIDES, axis_effects.ANY_ANGLE),
            lambda _: axis_effects.OUTSIDE,
        ),
        Kit(
            "arm",
            arm.draw,
            drives.arm,
            drives.arm_scale,
            lambda system: machine.arm(JOINTS[system.active]),
            lambda system: machine.arm_besides(JOINTS[system.active]),
            lambda system: machine.arm_outside(JOINTS[system.active]),
        ),
        Kit(
            "tool",
            tool.draw,
            drives.tool,
            drives.tool_scale,
            lambda _: machine.tool(),
            lambda _: machine.tool_besides(),
            lambda _: machine.tool_outside(),
        ),
        Kit(
            "slew",
            slew.draw,
            drives.slew,
            drives.slew_scale,
            lambda _: machine.slew(),
            lambda _: axis_effects.BESIDES,
            lambda _: machine.slew_outside(),
        ),
        Kit(
            "machine",
            whole.draw,
            drives.machine,
            drives.machine_scale,
            lambda _: machine.whole(),
            lambda _: machine.whole_besides(),
            lambda _: machine.whole_outside(),
        ),
    )
}
