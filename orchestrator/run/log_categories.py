"""Which log categories FMUs are told to write; without any they log what they always do."""

from collections.abc import Sequence

from orchestrator.fmi.component import Component
from orchestrator.system.system import System
from specs.errors import InputError, listed

ALL = "all"  # of every FMU


def check_log_categories(system: System, names: Sequence[str]) -> None:
    """InputError for a category that no FMU of the system has, with those that there are."""
    known = sorted({name for c in system.components.values() for name in c.model.log_categories})
    for name in names:
        if name != ALL and name not in known:
            raise InputError(
                f"no FMU of system {system.name} has the log category '{name}'; "
                f"valid: {listed([*known, ALL], 20)}"
            )


def told(component: Component, names: Sequence[str]) -> tuple[str, ...] | None:
    """The categories that an FMU is told; (): all of them; None: nothing is told."""
    if ALL in names:
        return ()
    return tuple(name for name in component.model.log_categories if name in names) or None
