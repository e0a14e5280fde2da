"""The parameters of the effects that every driven axis can have (native/axis.h), by name."""

import ctypes
import functools
from collections.abc import Mapping

import numpy as np

from blindtest.integrator import library
from specs.errors import InputError, nearest

PER_LAG = 0.5  # of the shortest lag: RK4 is unstable beyond 2.8, and far from exact before


@functools.cache
def absent() -> dict[str, float]:
    """Value of each parameter at which its effect is not there."""
    lib = library()
    lib.bt_axis_name.restype = ctypes.c_char_p
    lib.bt_axis_absent.restype = ctypes.c_double
    found: dict[str, float] = {}
    while name := lib.bt_axis_name(len(found)):
        found[name.decode()] = lib.bt_axis_absent(len(found))
    return found


def block(effects: Mapping[str, float]) -> np.ndarray:
    """Parameters of an axis with `effects`, in the order of native/axis.h; InputError for a wrong name."""
    values = dict(absent())
    for name, value in effects.items():
        if name not in values:
            raise InputError(f"an axis has no parameter '{name}'; {nearest(name, values)}")
        values[name] = value
    return np.array(list(values.values()))


def blocks(values: Mapping[str, float], names: tuple[str, ...]) -> np.ndarray:
    """Parameters of several axes [axes, parameters] from values named `axis.parameter`."""
    own = {name: {} for name in names}
    for key, value in values.items():
        axis, _, parameter = key.rpartition(".")
        if axis in own:
            own[axis][parameter] = value
    return np.stack([block(own[name]) for name in names])


def longest(step: float, values: Mapping[str, float], lags: tuple[str, ...]) -> float:
    """The longest step (s) of a run: `step`, or less for the shortest of its lags that is there."""
    there = [lag for name in lags if (lag := values.get(name, 0.0)) > 0.0]
    return min([step, *(PER_LAG * lag for lag in there)])
