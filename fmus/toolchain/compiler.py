"""One driver for every C compilation: the system's `cc`, else the `ziglang` package, which also crosses.

Results must be the same bits everywhere, so contraction and fast-math are off and libm is never linked.
"""

import functools
import importlib.util
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from specs.errors import InputError, RunError, nearest


@dataclass(frozen=True)
class Target:
    """A platform: its FMI 3 tuple, the folder FMI 2 uses for it, zig's name, and the library suffix.

    FMI 2.0 defines no folder for aarch64; there the FMI 3 tuple is used, as other exporters do, because
    importers that run on such a machine look for it and no other name is in common use.
    """

    name: str
    fmi2_folder: str
    zig: str
    suffix: str


TARGETS = {
    t.name: t
    for t in (
        Target("x86_64-linux", "linux64", "x86_64-linux-gnu.2.17", ".so"),
        Target("x86_64-windows", "win64", "x86_64-windows-gnu", ".dll"),
        Target("aarch64-linux", "aarch64-linux", "aarch64-linux-gnu.2.17", ".so"),
        Target("aarch64-darwin", "aarch64-darwin", "aarch64-macos", ".dylib"),
        Target("x86_64-darwin", "darwin64", "x86_64-macos", ".dylib"),
    )
}

ALWAYS_ZIG = "SLEWRIGHT_ZIG"  # environment variable: ziglang even beside a cc; the result runs on older Linux
FLAGS = ["-std=c11", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fvisibility=hidden"]
WARNINGS = ["-Wall", "-Wextra", "-Wconversion", "-Werror"]
GENERATED_WARNINGS = ["-w"]  # generated code is checked by what it computes


def host() -> Target:
    """The platform this process runs on."""
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(
        platform.machine().lower(), platform.machine().lower()
    )
    return target(f"{machine}-{platform.system().lower()}")


def target(name: str) -> Target:
    """Return the target called `name`, or raise InputError with the valid names."""
    if name not in TARGETS:
        raise InputError(f"no build target '{name}'; {nearest(name, TARGETS)}")
    return TARGETS[name]


@functools.cache
def command(name: str) -> tuple[str, ...]:
    """Compiler command line for a target: the system's cc for the host, ziglang for all else.

    Raises InputError when neither is there.
    """
    if name == host().name and not os.environ.get(ALWAYS_ZIG) and (cc := shutil.which("cc")):
        return (cc,)
    if importlib.util.find_spec("ziglang") is None:
        raise InputError(f"no C compiler for {name}: install one as `cc`, or `pip install ziglang`")
    return (sys.executable, "-m", "ziglang", "cc", "-target", target(name).zig, "-fno-sanitize=undefined")


@functools.cache
def identity(name: str) -> str:
    """The compiler's version, for cache keys: the first line of --version, or that of the ziglang package."""
    if "ziglang" in command(name):
        return "ziglang " + metadata.version("ziglang")
    out = subprocess.run([*command(name), "--version"], capture_output=True, text=True, check=False)
    return out.stdout.partition("\n")[0]


def compile_object(
    source: Path, out: Path, name: str, extra: Sequence[str] = (), generated: bool = False
) -> Path:
    """Compile one C file for target `name`; raises RunError with the compiler's words."""
    pic = [] if name.endswith("windows") else ["-fPIC"]
    warnings = GENERATED_WARNINGS if generated else WARNINGS
    _run([*command(name), *FLAGS, *pic, *warnings, *extra, "-c", str(source), "-o", str(out)])
    return out


def link_shared(
    objects: Sequence[Path], out: Path, name: str, extra: Sequence[str] = (), libraries: Sequence[str] = ()
) -> Path:
    """Link object files into a shared library for target `name`; `libraries`: such as -lm."""
    strip = [] if name.endswith("darwin") else ["-s"]
    _run([*command(name), "-shared", *strip, *extra, *map(str, objects), *libraries, "-o", str(out)])
    return out


def link_program(objects: Sequence[Path], out: Path, name: str, extra: Sequence[str] = ()) -> Path:
    """Link object files into a program for target `name`."""
    _run([*command(name), *extra, *map(str, objects), "-o", str(out)])
    return out


def _run(line: list[str]) -> None:
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RunError(f"the C compiler failed: {' '.join(line)}\n{done.stderr.strip()[:2000]}")
