"""The bill of materials of an archive, CycloneDX 1.6 JSON: what is in it, what it needs to run, what made it.

No time and no random number: the same content makes the same bytes.  Hashes of what is in the archive are of
the files; those of Python packages are the ones that requirements/test.lock allows, where there is one and it
has the installed version.
"""

import json
import re
import uuid
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement

from fmus.toolchain import compiler
from runtime import bundle as form
from specs.version import VERSION

VERSION_OF_FORMAT = "1.6"
PROJECT, EXTRA = "slewright", "runtime"
LOCK = Path(__file__).parents[2] / "requirements" / "test.lock"
ONNX = ".onnx"
LONGEST = 60  # characters of a licence's name
BUILDING = ("casadi", "numpy", "onnx")  # Python packages that had a part in the generated code


def sbom(files: Mapping[str, bytes], manifest: Mapping[str, Any], release: str) -> bytes:
    """The SBOM of an archive with `files`, whose bundle has `manifest`."""
    needed = runtime_packages(manifest["engine"])
    own = [_file(name, data) for name, data in sorted(files.items())]
    packages = [_package(name) for name in needed]
    about = {
        "type": "application",
        "bom-ref": "bundle",
        "name": f"{PROJECT} bundle {manifest['controller']}",
        "version": release or manifest["identity"][:12],
    }
    content = {
        "bomFormat": "CycloneDX",
        "specVersion": VERSION_OF_FORMAT,
        "version": 1,
        "metadata": {"component": about, "tools": {"components": _tools(manifest["platforms"])}},
        "components": [*own, *packages],
        "dependencies": _dependencies(own, packages),
    }
    serial = uuid.uuid5(uuid.NAMESPACE_OID, form.digest(json.dumps(content, sort_keys=True).encode()))
    whole = {
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "serialNumber": serial.urn,
        **content,
    }
    return (json.dumps(whole, indent=1) + "\n").encode()


def runtime_packages(engine: str = form.NATIVE) -> list[str]:
    """Names of this project and of every installed package that its extra `runtime` asks for, sorted."""
    found, waiting = set(), [(PROJECT, EXTRA)] + [(engine, "")] * (engine == form.ONNXRUNTIME)
    while waiting:
        name, extra = waiting.pop()
        if (name, extra) in found:
            continue
        found.add((name, extra))
        for text in _requirements(name):
            wanted = Requirement(text)
            if wanted.marker is None or wanted.marker.evaluate({"extra": extra}):
                waiting += [(_normal(wanted.name), e) for e in ("", *wanted.extras)]
    return sorted({name for name, _ in found if _installed(name)})


def _requirements(name: str) -> Sequence[str]:
    return metadata.requires(name) or () if _installed(name) else ()


def _installed(name: str) -> bool:
    try:
        metadata.version(name)
    except metadata.PackageNotFoundError:
        return False
    return True


def _file(name: str, data: bytes) -> dict[str, Any]:
    """A file of the archive."""
    kind = "machine-learning-model" if name.endswith(ONNX) else "file"
    hashes = [{"alg": "SHA-256", "content": form.digest(data)}]
    return {"type": kind, "bom-ref": f"file:{name}", "name": name, "hashes": hashes}


def _package(name: str) -> dict[str, Any]:
    version = VERSION if name == PROJECT else metadata.version(name)
    address = f"pkg:pypi/{name}@{version}"
    found: dict[str, Any] = {
        "type": "library",
        "bom-ref": address,
        "name": name,
        "version": version,
        "purl": address,
    }
    if licences := _licences(name):
        found["licenses"] = licences
    if hashes := locked(name, version):
        told = [{"alg": "SHA-256", "content": h} for h in hashes]
        reference = {"type": "distribution", "url": address, "comment": "one of these", "hashes": told}
        found["externalReferences"] = [reference]
    return found


def _licences(name: str) -> list[dict[str, Any]]:
    """As the package says it: an SPDX expression or a name; none where a whole text stands in its place."""
    about = metadata.metadata(name)
    if found := about.get_all("License-Expression"):
        return [{"expression": found[0]}]
    named = [text for text in about.get_all("License") or () if 0 < len(text) <= LONGEST and "\n" not in text]
    return [{"license": {"name": text}} for text in named]


def locked(name: str, version: str) -> list[str]:
    """SHA-256 of every file of a package's version that the lock allows; none without lock or version."""
    if not LOCK.is_file():
        return []
    blocks = re.split(r"\n(?=[a-z0-9])", LOCK.read_text())
    for block in blocks:
        if re.match(rf"{re.escape(name)}(\[[^]]*\])?=={re.escape(version)}[\s\\]", block):
            return sorted(re.findall(r"--hash=sha256:([0-9a-f]{64})", block))
    return []


def _tools(platforms: Sequence[str]) -> list[dict[str, Any]]:
    compilers = sorted({compiler.identity(name) for name in platforms})
    made = [{"type": "application", "name": "C compiler", "version": text} for text in compilers]
    names = [PROJECT, *(n for n in BUILDING if _installed(n))]
    return [*made, *({"type": "library", "name": n, "version": metadata.version(n)} for n in names)]


def _dependencies(own: Sequence[Mapping[str, Any]], packages: Sequence[Mapping[str, Any]]) -> list[Any]:
    """The bundle consists of its files, and needs the runtime; what that needs is listed flat."""
    project = next(p["bom-ref"] for p in packages if p["name"] == PROJECT)
    others = [p["bom-ref"] for p in packages if p["name"] != PROJECT]
    return [
        {"ref": "bundle", "dependsOn": [*(f["bom-ref"] for f in own), project]},
        {"ref": project, "dependsOn": others},
    ]


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
