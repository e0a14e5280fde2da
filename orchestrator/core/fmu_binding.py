"""orchestrator/core/fmu.h through ctypes: structures and prototypes, nothing else."""

import ctypes
from ctypes import POINTER, Structure, c_bool, c_char_p, c_double, c_int, c_size_t, c_void_p
from functools import cache
from typing import Any

from orchestrator.core import native
from orchestrator.core.binding import Blob

MESSAGES = 20  # SLW_MESSAGES


class Options(Structure):
    """slw_fmu_options."""

    _fields_ = (
        ("fmi_version", c_int),
        ("library", c_char_p),
        ("name", c_char_p),
        ("token", c_char_p),
        ("resources", c_char_p),
        ("event_mode", c_bool),
        ("early_return", c_bool),
        ("exchange", c_char_p),
        ("scheduled", c_char_p),
        ("log", c_char_p),
    )


class Group(Structure):
    """slw_group."""

    _fields_ = (
        ("type", c_int),
        ("n_vr", c_size_t),
        ("n", c_size_t),
        ("vr", c_void_p),
        ("cells", c_void_p),
        ("native", c_void_p),
        ("blobs", c_void_p),
        ("told", c_void_p),
    )


class StepResult(Structure):
    """slw_step_result."""

    _fields_ = (("reached", c_double), ("event", c_bool), ("terminate", c_bool), ("early", c_bool))


class EventResult(Structure):
    """slw_event_result."""

    _fields_ = (
        ("more", c_bool),
        ("terminate", c_bool),
        ("next_event_defined", c_bool),
        ("next_event", c_double),
    )


class Interval(Structure):
    """slw_interval."""

    _fields_ = (("qualifier", c_int), ("seconds", c_double))


FMU = c_void_p
REFERENCES = c_void_p
# slw_fmu_functions, in its order: arguments after the instance.
FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "enter_configuration": (),
    "exit_configuration": (),
    "enter_initialisation": (c_double, c_bool, c_double, c_double),
    "exit_initialisation": (),
    "set": (POINTER(Group),),
    "get": (POINTER(Group),),
    "step": (c_double, c_double, POINTER(StepResult)),
    "after_discard": (POINTER(StepResult),),
    "enter_event": (),
    "update_discrete": (POINTER(EventResult),),
    "enter_step": (),
    "interval": (ctypes.c_uint32, c_bool, POINTER(Interval)),
    "shift": (ctypes.c_uint32, c_bool, POINTER(c_double)),
    "get_state": (POINTER(c_void_p),),
    "set_state": (c_void_p,),
    "free_state": (POINTER(c_void_p),),
    "serialized_size": (c_void_p, POINTER(c_size_t)),
    "serialize": (c_void_p, c_void_p, c_size_t),
    "deserialize": (c_char_p, c_size_t, POINTER(c_void_p)),
    "directional": (
        *(REFERENCES, c_size_t, REFERENCES, c_size_t),
        *(c_void_p, c_size_t, c_void_p, c_size_t),
    ),
    "terminate": (),
    "reset": (),
    "free": (),
}
TYPES = {
    name: ctypes.CFUNCTYPE(None if name == "free" else c_int, FMU, *arguments)
    for name, arguments in FUNCTIONS.items()
}


@cache
def library() -> ctypes.CDLL:
    """The core's library with the prototypes of fmu.h."""
    loaded = native.library()
    loaded.slw_blob_release.restype = None
    loaded.slw_blob_release.argtypes = (POINTER(Blob),)
    loaded.slw_fmu_load.restype = c_void_p
    loaded.slw_fmu_load.argtypes = (POINTER(Options), c_char_p, c_size_t)
    loaded.slw_fmu_message.restype = c_char_p
    loaded.slw_fmu_message.argtypes = (FMU, ctypes.c_uint)
    loaded.slw_fmu_messages.restype = ctypes.c_uint64
    loaded.slw_fmu_messages.argtypes = (FMU,)
    loaded.slw_fmu_hurry.restype = None
    loaded.slw_fmu_hurry.argtypes = (FMU, c_double)
    loaded.slw_native_size.restype = c_size_t
    loaded.slw_native_size.argtypes = (c_int, c_int)
    if hasattr(loaded, "slw_fmu_spawn"):
        loaded.slw_fmu_spawn.restype = c_void_p
        loaded.slw_fmu_spawn.argtypes = (POINTER(Options), c_char_p, c_double, c_char_p, c_size_t)
    return loaded
