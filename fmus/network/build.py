"""Compiles and packs FMUs on networks: network.c around an FMU's own file."""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from fmus.network import description
from fmus.network.definition import NetworkFmu, config_h
from fmus.paths import SHIM
from fmus.toolchain import compiler
from fmus.toolchain.build import HEADERS, mark_built, pack
from fmus.toolchain.variables import model_token

HERE = Path(__file__).parent
SHARED = ("network.h", "network.c", "unsupported.c", "operations.h", "operations.c")
LICENSE = b"Apache License, Version 2.0 (SPDX: Apache-2.0)\n"


def write_sources(fmu: NetworkFmu, own: Mapping[str, str], folder: Path, salt: str = "") -> str:
    """Write network.c and the FMU's `own` files by name into `folder`; returns the token.

    `own` has app.h with the FMU's state; `salt`: what else the binary is made of.
    """
    files = {name: (HERE / name).read_text() for name in SHARED} | dict(own)
    text = "".join(f"{name}\n{content}" for name, content in sorted(files.items()))
    token = model_token(repr((fmu, compiler.FLAGS, salt)) + text)
    for name, content in {**files, "network_config.h": config_h(fmu, token)}.items():
        (folder / name).write_text(content)
    (folder / "fmi").mkdir(exist_ok=True)
    for name in HEADERS[3]:
        (folder / "fmi" / name).write_bytes((SHIM / "fmi" / name).read_bytes())
    return token


def compile_sources(folder: Path, target: str, extra: Sequence[str] = ()) -> list[Path]:
    """Compile every C file of `folder` without any warning; the objects."""
    flags = ["-I", str(folder), *extra]
    return [
        compiler.compile_object(path, folder / f"{path.stem}.o", target, flags)
        for path in sorted(folder.glob("*.c"))
    ]


def archive(fmu: NetworkFmu, token: str, library: bytes, sources: Mapping[str, bytes]) -> bytes:
    """The FMU for this platform, marked as built here; `sources` by their place below sources/."""
    host = compiler.host()
    files = description.files(fmu, token)
    files[f"binaries/{host.name}/{fmu.name}{host.suffix}"] = library
    files["documentation/licenses/license.txt"] = LICENSE
    content = pack(files | {f"sources/{name}": data for name, data in sources.items()})
    mark_built(content)
    return content


def build(fmu: NetworkFmu, own: Mapping[str, str], included: Mapping[str, str] | None = None) -> bytes:
    """Compile and pack an FMU whose own files are `own`; RunError if C fails.

    `included`: files in folders, which these include.
    """
    host, more = compiler.host(), included or {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name, text in more.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text)
        token = write_sources(fmu, own, folder, repr(sorted(more.items())))
        sources = {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*.[ch]")}
        objects = compile_sources(folder, host.name)
        library = compiler.link_shared(objects, folder / f"fmu{host.suffix}", host.name).read_bytes()
    return archive(fmu, token, library, sources)
