"""One input of the fuzzer: the files of a system as text, and damage done to the archives made of them."""

import gzip
import hashlib
import io
import json
import re
import tempfile
import warnings
import zipfile
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from fmus.toolchain import compiler
from fmus.toolchain.build import BUILD, SHIM

CORPUS = Path(__file__).parent / "corpus.json.gz"
LIBRARY = "library"  # key of an FMU's part that says for which FMI version it has a binary: "2" or "3"
BINARIES = "binaries/"
SPONGES = BUILD / "fuzz" / "sponges"
IDENTIFIER = re.compile(r'<(?:CoSimulation|ScheduledExecution)[^>]*?modelIdentifier="([^"]*)"')


@dataclass(frozen=True)
class Case:
    """`files`: path in the SSP to content (bytes as Latin-1); `fmus`: path in the SSP to its parts.

    The parts of an FMU are its files, and LIBRARY.
    kind     ssp, ssd (a folder) or fmu (the first FMU alone)
    entries  (archive, name, content) added to an archive as they are, even if the name is there already
    patches  (archive, place from 0 to 1, bytes) written over an archive; archive "" is the SSP
    cuts     (archive, share of it that is kept)
    """

    kind: str = "ssp"
    files: dict[str, str] = field(default_factory=dict)
    fmus: dict[str, dict[str, str]] = field(default_factory=dict)
    entries: tuple[tuple[str, str, str], ...] = ()
    patches: tuple[tuple[str, float, str], ...] = ()
    cuts: tuple[tuple[str, float], ...] = ()

    @property
    def size(self) -> int:
        """Characters in all."""
        return len(json.dumps(asdict(self)))

    @property
    def foreign(self) -> bool:
        """Whether it brings machine code of its own, which nobody should run."""
        return any(name.startswith(BINARIES) for parts in self.fmus.values() for name in parts)

    def write(self, folder: Path, real: bool = False) -> Path:
        """Make the files in `folder` and return the one to load; `real`: with binaries that can run."""
        archives = {path: self._fmu(path, parts, real) for path, parts in self.fmus.items()}
        if self.kind == "fmu" and archives:
            target = folder / "case.fmu"
            target.write_bytes(next(iter(archives.values())))
            return target
        if self.kind == "ssd":
            contents = {
                name: text.encode("latin-1", "replace") for name, text in self.files.items()
            } | archives
            return _folder(folder, contents)
        target = folder / "case.ssp"
        target.write_bytes(self.archive(real))
        return target

    def archive(self, real: bool = True) -> bytes:
        """The case as a package, to be put into another one."""
        archives = {path: self._fmu(path, parts, real) for path, parts in self.fmus.items()}
        contents = {name: text.encode("latin-1", "replace") for name, text in self.files.items()}
        return self._damaged("", contents | archives)

    def _fmu(self, path: str, parts: dict[str, str], real: bool) -> bytes:
        contents = {n: text.encode("latin-1", "replace") for n, text in parts.items() if n != LIBRARY}
        version = parts.get(LIBRARY, "")[-1:]
        if version:
            contents |= binaries(parts.get("modelDescription.xml", ""), version, real)
        return self._damaged(path, contents)

    def _damaged(self, archive: str, contents: dict[str, bytes]) -> bytes:
        more = [(n, text.encode("latin-1", "replace")) for a, n, text in self.entries if a == archive]
        content = bytearray(_zip([*contents.items(), *more]))
        for _, place, text in (p for p in self.patches if p[0] == archive):
            new = text.encode("latin-1", "replace")
            at = int(place * len(content))
            content[at : at + len(new)] = new
        for _, share in (c for c in self.cuts if c[0] == archive):
            del content[int(share * len(content)) :]
        return bytes(content)


def read_corpus(path: Path = CORPUS) -> list[Case]:
    """The kept cases."""
    if not path.exists():
        return []
    return [case_of(entry) for entry in json.loads(gzip.decompress(path.read_bytes()))]


def write_corpus(cases: Iterable[Case], path: Path = CORPUS) -> None:
    """Keep cases; same cases, same bytes."""
    text = json.dumps([asdict(case) for case in cases], indent=0, ensure_ascii=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(gzip.compress(text.encode(), 9, mtime=0))


def binaries(description: str, version: str, real: bool) -> dict[str, bytes]:
    """The binary of an FMU, by its place: a sponge, which runs whatever its description says."""
    found = IDENTIFIER.search(description)
    name = found[1] if found else "none"
    target = compiler.host()
    folder = target.fmi2_folder if version == "2" else target.name
    return {f"binaries/{folder}/{name}{target.suffix}": sponge(version).read_bytes() if real else b""}


def sponge(version: str) -> Path:
    """The compiled library of sponge2.c or sponge3.c, kept by the hash of its source."""
    source = Path(__file__).with_name(f"sponge{version}.c")
    digest = hashlib.sha256(source.read_bytes()).hexdigest()[:16]
    library = SPONGES / f"sponge{version}-{digest}{compiler.host().suffix}"
    if not library.exists():
        SPONGES.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=SPONGES) as scratch:
            thing = Path(scratch) / "sponge.o"
            compiler.compile_object(
                source, thing, compiler.host().name, [f"-I{SHIM}", "-fvisibility=default"]
            )
            compiler.link_shared([thing], Path(scratch) / library.name, compiler.host().name).rename(library)
    return library


def case_of(entry: dict[str, Any]) -> Case:
    lists = {key: tuple(tuple(item) for item in entry[key]) for key in ("entries", "patches", "cuts")}
    return Case(**{**entry, **lists})


def _zip(entries: Iterable[tuple[str, bytes]]) -> bytes:
    target = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(target, "w") as archive:
        warnings.simplefilter("ignore")  # a second entry of one name
        for name, content in entries:
            archive.writestr(zipfile.ZipInfo(name or "empty"), content)
    return target.getvalue()


def _folder(folder: Path, contents: dict[str, bytes]) -> Path:
    """Unpacked as a user would have them, as far as the names allow."""
    for name, content in contents.items():
        path = folder / "open" / name
        if ".." not in path.parts and not name.startswith("/") and "\0" not in name:
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
            except OSError:
                continue
    return folder / "open" / "SystemStructure.ssd"
