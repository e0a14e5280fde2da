"""What the core is told of an FMU of model exchange (orchestrator/core/me.c), and where its solver lies."""

import importlib.util
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from fmus.toolchain.compiler import host
from orchestrator.fmi.component import Component
from specs.errors import InputError

SOLVER = "libcasadi_integrator_cvodes"


def described(component: Component) -> bytes | None:
    """Counts, solver and names of derivatives as me.c reads them; None: co-simulation."""
    model, exchange = component.model, component.model.exchange
    if exchange is None:
        return None
    rates = list(_derivatives(component))
    indicators = sum(component.size(model.variables[name]) for name in exchange.indicators)
    numbers = (len(rates), exchange.n_indicators + indicators, int(exchange.wants_steps))
    first = " ".join(map(str, (*numbers, repr(model.default_tolerance or 0.0))))
    names = [" ".join(name.split()) for name in rates]
    return "\n".join((first, str(solver()), *names)).encode()


@cache
def solver() -> Path:
    """The library with CVODE, which CasADi brings for every platform; InputError without it."""
    found = importlib.util.find_spec("casadi")
    folders = [] if found is None else list(found.submodule_search_locations or ())
    paths = [Path(folder) / f"{SOLVER}{host().suffix}" for folder in folders]
    path = next((path for path in paths if path.is_file()), None)
    if path is None:
        raise InputError(
            "model exchange needs CVODE, which comes with casadi: pip install 'slewright[verify]'"
        )
    return path


def _derivatives(component: Component) -> Iterator[str]:
    """Names of the states' derivatives, element by element, in the order of the FMU."""
    model = component.model
    for name in model.exchange.derivatives if model.exchange else ():
        size = component.size(model.variables[name])
        yield from (name if size == 1 else f"{name}[{i + 1}]" for i in range(size))
