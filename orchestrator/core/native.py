"""The compiled core: packaged with the wheel, or compiled once from orchestrator/core and cached.

Two files: a shared library (the core and the FMU binding) and the host program, in which a foreign FMU runs.
Both are of one set of sources; a library whose source hash differs from the sources beside it is refused.
"""

import contextlib
import ctypes
import functools
import hashlib
import os
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fmus.paths import BUILD, SHIM
from fmus.toolchain import compiler
from specs.errors import InputError, RunError

SOURCES = Path(__file__).parent
PACKAGED = SOURCES / "bin"
PROGRAM = "host.c"  # the only source with a main; the rest of what it needs is in BINDING
LIBRARY, HOST = "slewright_core", "slewright-fmu-host"  # file names, the library's without suffix
BINDING = ("channel.c", "cvode.c", "fmi2.c", "fmi3.c", "fmu.c", "me.c", "scheduled.c")
HASH_SYMBOL = "slw_source_hash"
LINUX_LIBRARIES = ("-Wl,--no-as-needed", "-ldl")


@dataclass(frozen=True)
class Binaries:
    """Paths of the shared library and of the host program (None where it is not supported)."""

    library: Path
    host: Path | None


def source_hash() -> str:
    """SHA-256 over all that is compiled: names, contents and flags."""
    digest = hashlib.sha256(repr(compiler.FLAGS).encode())
    for path in _files():
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def build(folder: Path, target: str | None = None, extra: Sequence[str] = ()) -> Binaries:
    """Compile the core into `folder` for a platform of fmus.toolchain.compiler.TARGETS (default: this one).

    `extra`: further compiler flags (sanitizers).  Raises InputError without a compiler, RunError if C fails.
    """
    name = target or compiler.host().name
    kind = compiler.target(name)
    stamp = f'-DSLW_SOURCE_HASH="{source_hash()}"'
    flags = [f"-I{SHIM}", "-fvisibility=default", "-D_GNU_SOURCE", stamp, *extra]
    with tempfile.TemporaryDirectory() as scratch:
        objects = {
            path.name: compiler.compile_object(path, Path(scratch) / f"{path.stem}.o", name, flags)
            for path in _files()
            if path.suffix == ".c" and (path.name != PROGRAM or name.endswith("linux"))
        }
        program = objects.pop(PROGRAM, None)
        folder.mkdir(parents=True, exist_ok=True)
        more = [*extra, *(LINUX_LIBRARIES if name.endswith("linux") else ())]
        library = folder / f"{LIBRARY}{kind.suffix}"
        compiler.link_shared([*objects.values()], library, name, more)
        if program is None:
            return Binaries(library, None)
        host = folder / HOST
        compiler.link_program([program, *(objects[n] for n in BINDING)], host, name, more)
    return Binaries(library, host)


@functools.cache
def binaries() -> Binaries:
    """The core for this machine: packaged, cached, or compiled now."""
    packaged = _existing(PACKAGED)
    if packaged is not None:
        return packaged
    key = hashlib.sha256((source_hash() + compiler.identity(compiler.host().name)).encode()).hexdigest()[:16]
    folder = BUILD / "core" / key
    return _existing(folder) or _build_into(folder)


@functools.cache
def library() -> ctypes.CDLL:
    """The core's shared library, loaded; InputError if it was made from other sources."""
    path = binaries().library
    loaded = ctypes.CDLL(str(path))
    getattr(loaded, HASH_SYMBOL).restype = ctypes.c_char_p
    found = getattr(loaded, HASH_SYMBOL)().decode()
    if found != source_hash():
        raise InputError(
            f"{path} was compiled from other sources ({found[:12]}) than those beside it "
            f"({source_hash()[:12]}): install the package again"
        )
    return loaded


def _files() -> list[Path]:
    return sorted(p for p in SOURCES.iterdir() if p.suffix in (".c", ".h"))


def _existing(folder: Path) -> Binaries | None:
    library, host = folder / f"{LIBRARY}{compiler.host().suffix}", folder / HOST
    return Binaries(library, host if host.is_file() else None) if library.is_file() else None


def _build_into(folder: Path) -> Binaries:
    """Build beside and rename: another process may do the same, and a reader never sees half of it."""
    part = folder.with_name(f"{folder.name}.{os.getpid()}.part")
    try:
        build(part)
        with contextlib.suppress(OSError):  # somebody else was faster
            part.rename(folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    built = _existing(folder)
    if built is None:
        raise RunError(f"the compiled core could not be put into {folder}")
    return built
