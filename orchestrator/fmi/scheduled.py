"""What the core is told of an FMU of scheduled execution (orchestrator/core/scheduled.c)."""

from collections.abc import Iterator

from orchestrator.fmi.component import Component


def described(component: Component) -> bytes | None:
    """The clocks that a partition may announce, a line each; None: another kind."""
    return "\n".join(_clocks(component)).encode() if component.model.scheduled else None


def _clocks(component: Component) -> Iterator[str]:
    for variable in component.model.variables.values():
        if variable.clock is None:
            continue
        if variable.causality == "output":
            yield f"output {variable.vr}"
        elif variable.clock.interval_variability == "countdown":
            yield f"{'fraction' if variable.clock.supports_fraction else 'countdown'} {variable.vr}"
