"""What is done to a finished package so that it must be refused."""

import io
import zipfile
from collections.abc import Callable, Mapping

Files = dict[str, bytes]
EPOCH = (2020, 1, 1, 0, 0, 0)
FMU = "resources/gain.fmu"  # the one that is damaged


def zipped(files: Mapping[str, bytes], links: Mapping[str, str] | None = None) -> bytes:
    """A zip archive, the same bytes for the same content; `links`: symbolic links and where they lead."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in sorted(files.items()):
            _add(archive, name, content, 0o100644)
        for name, target in (links or {}).items():
            _add(archive, name, target.encode(), 0o120777)
    return buffer.getvalue()


def _add(archive: zipfile.ZipFile, name: str, content: bytes, mode: int) -> None:
    entry = zipfile.ZipInfo(name, EPOCH)
    entry.compress_type, entry.create_system, entry.external_attr = zipfile.ZIP_DEFLATED, 3, mode << 16
    archive.writestr(entry, content)


def unzipped(content: bytes) -> Files:
    """The files of an archive."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def _in_fmu(change: Callable[[Files], Files]) -> Callable[[Files], bytes]:
    def damaged(files: Files) -> bytes:
        return zipped({**files, FMU: zipped(change(unzipped(files[FMU])))})

    return damaged


def _described(old: str, new: str) -> Callable[[Files], bytes]:
    """A change of the FMU's modelDescription.xml."""
    name = "modelDescription.xml"

    def change(fmu: Files) -> Files:
        text = fmu[name].decode()
        if old not in text:
            raise ValueError(f"the model description holds no {old}")
        return {**fmu, name: text.replace(old, new).encode()}

    return _in_fmu(change)


ENTITIES = (
    '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>\n<fmiModelDescription'
)
DAMAGES: Mapping[str, Callable[[Files], bytes]] = {
    "truncated": lambda files: zipped(files)[: len(zipped(files)) // 2],
    "not a zip": lambda files: b"This is no archive.\n",
    "no description": lambda files: zipped({k: v for k, v in files.items() if not k.endswith(".ssd")}),
    "escapes": lambda files: zipped({**files, "../escaped.txt": b"out"}),
    "links": lambda files: zipped(files, {"resources/link.txt": "/etc/passwd"}),
    "FMU missing": lambda files: zipped({k: v for k, v in files.items() if k != FMU}),
    "FMU truncated": lambda files: zipped({**files, FMU: files[FMU][: len(files[FMU]) // 2]}),
    "FMU escapes": _in_fmu(lambda fmu: {**fmu, "../../escaped.txt": b"out"}),
    "FMU of another platform": _in_fmu(
        lambda fmu: {
            (k if "binaries" not in k else f"binaries/riscv64-none/{k.rpartition('/')[2]}"): v
            for k, v in fmu.items()
        }
    ),
    "FMU without description": _in_fmu(lambda fmu: {k: v for k, v in fmu.items() if "binaries" in k}),
    "FMU's library is text": _in_fmu(
        lambda fmu: {k: (b"This is no library.\n" if "binaries" in k else v) for k, v in fmu.items()}
    ),
    "FMU's description is cut": _described("</ModelVariables>", "<"),
    "FMU of version 1": _described('fmiVersion="2.0"', 'fmiVersion="1.0"'),
    "FMU without co-simulation": _described("<CoSimulation", "<ModelExchange"),
    "FMU needs a tool": _described("<CoSimulation", '<CoSimulation needsExecutionTool="true"'),
    "FMU's token is another": _described("slewright-testpack", "another"),
    "FMU's name twice": _described('name="b"', 'name="k"'),
    "FMU expands": _described("<fmiModelDescription", ENTITIES),
}
