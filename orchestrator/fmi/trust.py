"""Which FMUs may run in this process: an FMU is foreign machine code, unless it was built here.

Others run in a process of their own (orchestrator/core/remote.c), where a crash or a hang ends in a report.
"""

from fmus.paths import built_here
from orchestrator.fmi.component import Component


def runs_here(component: Component, trust: bool) -> bool:
    """Whether the FMU of a component runs in this process: it was built here, or the user trusts it."""
    return trust or built_here(component.sha256)
