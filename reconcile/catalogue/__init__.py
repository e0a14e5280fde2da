"""The catalogue of effects: every module here that has `EFFECTS`, one small file a place.

Sensor quantization cannot be told by a fit; reconcile/judging/quantization.py finds it in the values.
"""

from importlib import import_module
from pkgutil import iter_modules

from reconcile.catalogue.effect import Effect, Scales

# The order of search and tables; other modules come after them.
FIRST = (
    *("inputs", "forces", "inertias", "couplings", "hydraulics"),
    *("loads", "pendulum", "reactions", "groups", "outputs"),
)


def _effects(module: str) -> tuple[Effect, ...]:
    return getattr(import_module(f"reconcile.catalogue.{module}"), "EFFECTS", ())


_MODULES = dict.fromkeys((*FIRST, *sorted(found.name for found in iter_modules(__path__))))
ALL: tuple[Effect, ...] = tuple(effect for module in _MODULES for effect in _effects(module))

__all__ = ["ALL", "Effect", "Scales"]
