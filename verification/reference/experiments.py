"""Experiments that an archive carries: FMI-LS-REF's manifest, its experiment files and results.

An experiment stands in the manifest itself (drafts of the standard), in a file with the role `experiment`, or
is the default experiment where there is a `result` only.  Sources are relative to the file that names them.
"""

import hashlib
import posixpath
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote, urlparse

from orchestrator.files import archive, xml_file
from orchestrator.files.xml_file import Element, local
from specs.errors import InputError

FOLDER = "extra/org.fmi-standard.fmi-ls-ref/"
MANIFESTS = ("fmi-ls-manifest.xml", "fmi-ls-ref.xml")
LOOSE = "experiments.xml"  # in SSPs without a manifest
NAMESPACE = "{http://fmi-standard.org/fmi-ls-manifest}"
HASHES: dict[str, Callable[[bytes], str]] = {
    f"SHA{kind}-{bits}": (lambda data, name=f"sha{three}{bits}": hashlib.new(name, data).hexdigest())
    for kind, three in (("3", "3_"), ("", ""))
    for bits in (224, 256, 384, 512)
}
LARGEST = 256 * 1024**2  # bytes of one file


@dataclass(frozen=True)
class Experiment:
    """What is run and compared; contents of files with their names, None where there is none."""

    name: str
    description: str = ""
    start_s: float | None = None
    stop_s: float | None = None
    step_s: float | None = None
    tolerance: float | None = None
    parameters: tuple[str, bytes] | None = None
    stimuli: tuple[str, bytes] | None = None
    references: tuple[str, bytes] | None = None
    signals: tuple[str, ...] = ()  # that are compared; none: all


def read(path: Path) -> list[Experiment]:
    """All experiments of an FMU or SSP; InputError where it carries none, or for a file that is wrong."""
    shown = str(path)
    with archive.opened(path, shown) as opened:
        names = set(opened.namelist())
        file = next((FOLDER + n for n in (*MANIFESTS, LOOSE) if FOLDER + n in names), None)
        if file is None:
            raise InputError(f"{path} carries no reference experiments: there is no {FOLDER}{MANIFESTS[0]}")
        found = list(_Reader(opened, names, shown).of(file))
    if not found:
        raise InputError(f"{path}: {file} names no experiment and no result")
    return found


class _Reader:
    """One archive."""

    def __init__(self, opened: zipfile.ZipFile, names: set[str], shown: str) -> None:
        self.opened, self.names, self.shown = opened, names, shown

    def of(self, file: str) -> Iterator[Experiment]:
        """Experiments of a manifest or of an experiment file."""
        root = xml_file.parse(self.content(file), f"{self.shown}: {file}")
        results = []
        for element in root:
            kind, role = local(element), (element.get("role") or "").partition("/")[0]
            if kind == "Experiment":
                yield self._experiment(element, file)
            elif kind == "Related" and role in ("experiment", "result"):
                source = self._source(element, file)
                content = self.content(source)
                self._check(element, source, content)
                if role == "experiment":
                    yield from self.of(source)
                elif source.lower().endswith(".csv"):
                    results.append(Experiment(source.rpartition("/")[2], references=(source, content)))
        yield from results

    def _experiment(self, element: Element, file: str) -> Experiment:
        where = f"{self.shown}: {file}"
        parts = {local(e): e for e in element}
        number = lambda n: xml_file.number(element, n, 0.0, where) if element.get(n) is not None else None  # noqa: E731
        signals = [e.get("name") for e in parts.get("References", ()) if local(e) == "Signal"]
        return Experiment(
            element.get("name") or "experiment", element.get("description") or "",
            number("startTime"), number("stopTime"), number("stepSize"), number("tolerance"),
            *(self._part(parts.get(n), file) for n in ("Parameters", "Stimuli", "References")),
            signals=tuple(s for s in signals if s),
        )  # fmt: skip

    def _part(self, element: Element | None, file: str) -> tuple[str, bytes] | None:
        if element is None:
            return None
        if element.get("mapping"):
            raise InputError(
                f"{self.shown}: {file} line {element.sourceline}: mappings of names are not supported"
            )
        source = self._source(element, file)
        return source, self.content(source)

    def _source(self, element: Element, file: str) -> str:
        """The place in the archive of a source, relative to the file that names it, else to the archive."""
        where = f"{self.shown}: {file} line {element.sourceline}"
        text = element.get("source")
        if not text:
            raise InputError(f"{where}: <{local(element)}> has no 'source'")
        if urlparse(text).scheme or text.startswith("/"):
            raise InputError(
                f"{where}: source '{text}' is not in the archive; only relative sources are read"
            )
        plain = unquote(text)
        for folder in (posixpath.dirname(file), ""):
            place = posixpath.normpath(posixpath.join(folder, plain))
            if place in self.names:
                return place
        raise InputError(f"{where}: there is no '{text}' in the archive")

    def content(self, place: str) -> bytes:
        """A file's bytes."""
        try:
            if self.opened.getinfo(place).file_size > LARGEST:
                raise InputError(f"{self.shown}: {place} is larger than {LARGEST} bytes")
            return self.opened.read(place)
        except archive.DAMAGE as error:
            raise InputError(f"{self.shown} is damaged: {place}: {error}") from None

    def _check(self, element: Element, place: str, content: bytes) -> None:
        """The checksum, where one is stated."""
        stated, kind = element.get("checksum"), element.get("checksumType") or "SHA3-256"
        if stated is None:
            return
        if kind not in HASHES:
            raise InputError(f"{self.shown}: {place}: checksumType {kind}; valid: {', '.join(HASHES)}")
        if HASHES[kind](content).lower() != stated.lower():
            raise InputError(f"{self.shown}: {place} is not what its {kind} checksum says")
