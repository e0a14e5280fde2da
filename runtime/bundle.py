"""Reads a bundle: the folder with a compiled control core that `slewright bundle` makes.

Nothing of it is used before the SHA-256 of every file has been compared with the manifest's; a file that is
changed, missing or not in the manifest, another process image, format or platform is an InputError.
"""

import hashlib
import json
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from runtime import image
from specs import scene_text
from specs.errors import InputError
from specs.scene import Scene
from specs.version import VERSION

MANIFEST, PARAMETERS = "manifest.json", "parameters.json"
GUARD_SCENE = "guard-scene.json"  # what the guard keeps off: specs/scene_text.py
FORMAT = 1
NATIVE, ONNXRUNTIME, OUTSIDE = "native", "onnxruntime", "outside"
ENGINES = (NATIVE, ONNXRUNTIME, OUTSIDE)
KEYS = {"format": int, "controller": str, "engine": str, "slewright": str, "layout": str, "identity": str}
SUFFIXES = {"linux": ".so", "darwin": ".dylib", "windows": ".dll"}


@dataclass(frozen=True)
class Bundle:
    """A checked bundle; `identity` is what its compiled cores say they are."""

    folder: Path
    controller: str
    engine: str  # what evaluates it: C in the core, onnxruntime beside it, or an outside node
    identity: str
    platforms: tuple[str, ...]
    digest: str  # SHA-256 of the manifest: stands for the whole bundle
    guard: str = ""  # the scene that its guard keeps off; empty: it has none

    def library(self, name: str = "") -> Path:
        """The compiled core of a platform (default: this machine's); InputError if it holds none."""
        name = name or host()
        if name not in self.platforms:
            raise InputError(
                f"bundle {self.folder} has no core for {name}; it has {', '.join(self.platforms)} "
                f"(slewright bundle … --platform {name})"
            )
        return self.folder / f"core-{name}{SUFFIXES[name.partition('-')[2]]}"


def load(folder: Path, expected: str = "") -> Bundle:
    """Read and check a bundle; raises InputError naming the file or entry that is wrong.

    `expected` is the digest of the manifest that another process has checked.
    """
    content = _read(folder)
    check_version(content, f"bundle {folder}")
    _check_files(folder, content["files"])
    found = digest((folder / MANIFEST).read_bytes())
    if expected and found != expected:
        raise InputError(f"bundle {folder}: it was replaced while the runtime started")
    return Bundle(
        folder,
        content["controller"],
        content["engine"],
        content["identity"],
        tuple(content["platforms"]),
        found,
        content.get("guard", ""),
    )


def scene_of(folder: Path) -> Scene | None:
    """What the guard of a checked bundle keeps off; None where it has none, or was built before scenes were
    kept. InputError for a file that is no scene.
    """
    path = folder / GUARD_SCENE
    if not path.is_file():
        return None
    try:
        return scene_text.of(json.loads(path.read_bytes()), str(path))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path} is no scene ({error})") from None


def parse(text: bytes, where: str) -> dict[str, Any]:
    """A manifest's content; raises InputError, `where` first, for one of another form."""
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: {MANIFEST} is no JSON ({error})") from None
    _check_form(content, where)
    return content


def check_version(content: Mapping[str, Any], where: str) -> None:
    """Raise InputError for a manifest of another format, version or process image."""
    for what, expected in (("format", FORMAT), ("slewright", VERSION), ("layout", image.token())):
        if content[what] != expected:
            said = "specs/signals.toml has changed since" if what == "layout" else f"here it is {expected}"
            raise InputError(f"{where}: {what} {content[what]}: {said}; build it again")


def hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of every file below `folder` but the manifest, by path with forward slashes."""
    files = {p.relative_to(folder).as_posix(): p for p in sorted(folder.rglob("*")) if p.is_file()}
    return {name: digest(path.read_bytes()) for name, path in files.items() if name != MANIFEST}


def parameters_of(path: Path) -> str:
    """SHA-256 of a bundle's `parameters.json`; InputError for one that holds no parameters.

    Its values are compiled into the core; the file shows them, so it must be the one of that core.
    """
    try:
        text = path.read_bytes()
        content = json.loads(text)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is no JSON ({error})") from None
    if not isinstance(content, dict) or not content:
        raise InputError(f"{path} holds no table of parameters")
    for name, entry in content.items():
        value = entry.get("value") if isinstance(entry, dict) else None
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise InputError(f"{path}: {name} has no number as its value")
    return digest(text)


def digest(content: bytes) -> str:
    """SHA-256 in hexadecimal."""
    return hashlib.sha256(content).hexdigest()


def host() -> str:
    """This machine's platform as bundles name it, e.g. x86_64-linux."""
    machine = platform.machine().lower()
    return f"{ {'amd64': 'x86_64', 'arm64': 'aarch64'}.get(machine, machine) }-{platform.system().lower()}"


def _read(folder: Path) -> dict[str, Any]:
    path = folder / MANIFEST
    try:
        return parse(path.read_bytes(), f"bundle {folder}")
    except OSError as error:
        raise InputError(f"{folder} is no bundle: {path.name} cannot be read ({error.strerror})") from None


def _check_form(content: Any, where: str) -> None:
    if not isinstance(content, dict):
        raise InputError(f"{where}: {MANIFEST} holds no object")
    for key, kind in KEYS.items():
        if not isinstance(content.get(key), kind):
            raise InputError(f"{where}: {MANIFEST}: {key} is missing or no {kind.__name__}")
    names, files = content.get("platforms"), content.get("files")
    if not isinstance(names, list) or not all(isinstance(n, str) for n in names):
        raise InputError(f"{where}: {MANIFEST}: platforms is missing or no list of names")
    if not isinstance(files, dict) or not all(isinstance(v, str) for v in files.values()):
        raise InputError(f"{where}: {MANIFEST}: files is missing or no table of SHA-256")


def _check_files(folder: Path, told: dict[str, str]) -> None:
    found = hashes(folder)
    for name in sorted(told.keys() | found.keys()):
        if name not in found:
            raise InputError(f"bundle {folder}: {name} is missing")
        if name not in told:
            raise InputError(f"bundle {folder}: {name} is not in its manifest")
        if found[name] != told[name]:
            raise InputError(f"bundle {folder}: {name} was changed since it was built")
