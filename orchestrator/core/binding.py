"""orchestrator/core/core.h through ctypes: structures and prototypes, nothing else."""

import ctypes
import functools
from ctypes import (
    POINTER,
    Structure,
    c_bool,
    c_char_p,
    c_double,
    c_int,
    c_int32,
    c_int64,
    c_size_t,
    c_uint32,
    c_uint64,
)

from orchestrator.core import native

SINK = 0xFFFFFFFF  # SLW_SINK
TARGET = 0x80000000  # SLW_TARGET
NO_CLOCK = 0xFFFFFFFF  # SLW_NO_CLOCK
ALGORITHM = {"jacobi": 0, "gauss-seidel": 1, "iterate": 2, "adaptive": 3}  # slw_algorithm
CLOCK_KIND = {
    "grid": 0,
    "periodic": 1,
    "fixed": 2,
    "tunable": 3,
    "changing": 4,
    "countdown": 5,
}  # slw_clock_kind
DONE, FAILED, ENDED = range(3)  # slw_outcome
SET, GET, SET_DISCRETE = range(3)  # slw_direction

# slw_what
(
    DOING_SET,
    DOING_STEP,
    DOING_GET,
    DOING_EVENT,
    DOING_STATE,
    DOING_INITIALISE,
    NOT_FINITE,
    NOT_IN_TABLE,
    NO_CONVERGENCE,
    STEP_TOO_SMALL,
    RETURNED_EARLY,
    NO_PROGRESS,
    INJECTED,
    BAD_TIME,
    BAD_INTERVAL,
    CLOCK_INSIDE,
) = range(16)


class Cell(ctypes.Union):
    """slw_cell."""

    _fields_ = (("real", c_double), ("integer", c_int64))


class Blob(Structure):
    """slw_blob."""

    _fields_ = (("data", ctypes.c_void_p), ("size", c_size_t), ("capacity", c_size_t))


class Failure(Structure):
    """slw_failure."""

    _fields_ = (
        ("what", c_int),
        ("status", c_int),
        ("block", c_uint32),
        ("cell", c_uint32),
        ("loop", c_uint32),
        ("tick", c_int64),
        ("time", c_double),
        ("told", c_double),
        ("from_s", c_double),
        ("to_s", c_double),
        ("clock", c_uint32),
        ("qualifier", c_int32),
    )


class BlockStatistics(Structure):
    """slw_block_statistics."""

    _fields_ = (
        *((n, c_uint64) for n in ("steps", "discards", "events", "early_returns", "warnings", "rollbacks")),
        ("seconds", c_double),
    )


class Statistics(Structure):
    """slw_statistics."""

    _fields_ = (
        *((n, c_uint64) for n in ("steps", "rejected", "sweeps", "late")),
        *((n, c_double) for n in ("late_max_s", "late_p50_s", "late_p99_s", "late_p999_s")),
        ("waits", c_uint64),
    )


CORE = ctypes.c_void_p
FMU = ctypes.c_void_p
INDICES = ctypes.c_void_p  # uint32_t *
REALS = ctypes.c_void_p  # double *
INTEGERS = ctypes.c_void_p  # int64_t *

PROTOTYPES: dict[str, tuple[object, ...]] = {  # name: (result, *arguments)
    "new": (CORE, c_uint32, c_uint32, c_double, c_double),
    "free": (None, CORE),
    "cells": (ctypes.c_void_p, CORE),
    "blobs": (POINTER(Blob), CORE),
    "error": (c_char_p, CORE),
    "write_blob": (c_bool, CORE, c_uint32, c_char_p, c_size_t),
    "block": (c_bool, CORE, FMU, c_uint32, c_bool, c_bool, POINTER(c_uint32)),
    "group": (c_bool, CORE, c_uint32, c_int, c_int, c_size_t, INDICES, c_size_t, c_uint32),
    "move": (c_bool, CORE, c_uint32, c_size_t, INDICES, c_uint32, REALS, REALS),
    "table": (c_bool, CORE, c_uint32, c_uint32, c_uint32, c_size_t, INTEGERS, INTEGERS, c_bool),
    "copy": (c_bool, CORE, c_uint32, c_uint32, c_uint32),
    "fault": (c_bool, CORE, c_uint32, c_uint32, c_int, c_int64, c_int64, c_double, c_double, c_uint64),
    "fail": (c_bool, CORE, c_uint32, c_int64),
    "stimulus": (c_bool, CORE, c_int64, c_uint32, c_int64),
    "parameter": (c_bool, CORE, c_int64, c_uint32, c_int, c_uint32, c_int64),
    "clock": (c_bool, CORE, c_uint32, c_uint32, c_int64, c_int64),
    "timed_clock": (c_bool, CORE, c_uint32, c_uint32, c_int, c_bool, c_double, c_double),
    "clock_told": (c_bool, CORE, c_uint32, c_uint32),
    "parts": (c_bool, CORE, c_uint32, c_double),
    "source_clock": (c_bool, CORE, c_uint32, c_uint32),
    "target_clock": (c_bool, CORE, c_uint32, c_uint32, c_uint32, c_uint32, POINTER(c_uint32)),
    "clocked": (c_bool, CORE, c_uint32, c_int, c_uint32, c_int, c_size_t, INDICES, c_size_t, c_uint32),
    "algorithm": (c_bool, CORE, c_int, c_double, c_uint32, c_uint32),
    "nominal": (c_bool, CORE, c_uint32, c_double),
    "order": (c_bool, CORE, INDICES, INDICES),
    "log": (c_bool, CORE, c_size_t, INDICES, c_size_t),
    "pace": (c_bool, CORE, c_double),
    "timing": (c_bool, CORE, c_bool),
    "initialise": (c_int, CORE),
    "run": (c_int, CORE, c_int64),
    "tick": (c_int64, CORE),
    "log_last": (c_bool, CORE),
    "log_finish": (None, CORE),
    "failure": (POINTER(Failure), CORE),
    "take": (c_size_t, CORE, ctypes.c_void_p, c_size_t, c_size_t, c_int),
    "statistics": (None, CORE, POINTER(Statistics)),
    "block_statistics": (None, CORE, c_uint32, POINTER(BlockStatistics)),
    "snapshot_size": (c_size_t, CORE),
    "snapshot": (c_bool, CORE, ctypes.c_void_p, c_size_t),
    "restore": (c_bool, CORE, c_char_p, c_size_t),
}


@functools.cache
def library() -> ctypes.CDLL:
    """The core's library with the prototypes of core.h."""
    loaded = native.library()
    for name, (result, *arguments) in PROTOTYPES.items():
        function = getattr(loaded, f"slw_core_{name}")
        function.restype, function.argtypes = result, arguments
    return loaded
