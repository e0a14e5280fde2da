"""The guard's C code without a core around it: for runs in which something else drives the machine.

What is compiled is `runtime/core/guard.c` with the bounds, body and zones of a bundle for the same scene.
"""

import ctypes
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

import casadi as ca
import numpy as np

from deployment.bundling import guard
from deployment.bundling.blocks import CORE
from deployment.bundling.build import UNCHECKED, Cached
from fmus.paths import SHIM
from fmus.toolchain import codegen, compiler
from specs.scene import Scene

SENSORS = (
    *("q_slew", "q_boom", "q_stick", "imu_cabin_rate_z"),
    *("imu_tool_pitch", "imu_tool_roll", "imu_tool_rate_y", "imu_tool_rate_x"),
)  # as SlrGuardView
AXES = ("u_slew", "u_boom", "u_stick")
HAND_WRITTEN = ("guard.c", "guard_alone.c")


class Alone:
    """A guard that keeps off one scene, one run after the other; `reads` are the sensors that it needs."""

    reads = SENSORS

    def __init__(self, scene: Scene) -> None:
        """InputError for a scene that holds the machine itself."""
        self._library = ctypes.CDLL(str(_library(guard.zones(scene))))
        self._library.slr_alone_size.restype = ctypes.c_size_t
        self._library.slr_alone_start.restype = ctypes.c_double
        self._past = ctypes.create_string_buffer(self._library.slr_alone_size())

    def begin(self, sensors: Mapping[str, float]) -> float:
        """The machine stands still, and has for a while: the distance that is left after all margins, m."""
        return self._library.slr_alone_start(self._past, _seen(sensors))

    def step(self, sensors: Mapping[str, float], wanted: Mapping[str, float]) -> tuple[dict[str, float], str]:
        """One tick: what may be sent, and for which part of the machine it is less than wanted ("": not)."""
        commands = _doubles(np.clip([wanted[name] for name in AXES], -1.0, 1.0))
        part = self._library.slr_alone_step(self._past, _seen(sensors), commands)
        return dict(zip(AXES, commands, strict=True)), guard.PARTS[part]


def _seen(sensors: Mapping[str, float]) -> ctypes.Array[ctypes.c_double]:
    return _doubles([sensors[name] for name in SENSORS])


def _doubles(values: Iterable[float]) -> ctypes.Array[ctypes.c_double]:
    found = [float(value) for value in values]
    return (ctypes.c_double * len(found))(*found)


def _library(zones: guard.Zones) -> Path:
    """The compiled guard for these zones, from a cache where it was compiled before."""
    sources = {"guard_config.c": guard.guard_c(zones, guard.constants({})), "geometry.c": _geometry()}
    sources |= {path.name: path.read_text() for path in sorted(CORE.glob("*.h"))}
    sources |= {name: (CORE / name).read_text() for name in HAND_WRITTEN}
    sources["slw_math.h"] = (SHIM / "slw_math.h").read_text()
    host = compiler.host().name
    cached = Cached(repr((sorted(sources.items()), compiler.identity(host), host)))
    if not cached.path.is_file():
        with tempfile.TemporaryDirectory(prefix="slewright-") as scratch:
            cached.put(_linked(sources, Path(scratch), host))
    return cached.path


def _linked(sources: Mapping[str, str], folder: Path, host: str) -> Path:
    for name, text in sources.items():
        (folder / name).write_text(text)
    objects = [
        compiler.compile_object(
            folder / name, folder / f"{name}.o", host, ["-I", str(folder)], name in UNCHECKED
        )
        for name in sources
        if name.endswith(".c")
    ]
    return compiler.link_shared(objects, folder / "guard.so", host)


def _geometry() -> str:
    """`geometry.c`, as far as the guard needs it."""
    generator = ca.CodeGenerator("geometry.c", codegen.CASADI_OPTIONS)
    generator.add(guard.pose())
    code = codegen.with_our_mathematics(generator.dump())
    return f'{code}\n#include "slr.h"\n{guard.POSE_C}'
