"""Small archives with everything that a real one has but machine code, and keys that are always the same."""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from runtime import bundle, image
from runtime.archive import container, signed
from runtime.archive.keys import PrivateKey
from runtime.archive.names import BUNDLE, DBC, MAP, SBOM, SIGNALS
from runtime.archive.trust import Known, Trust
from specs.version import VERSION

SPECS = {DBC: b"", MAP: b"table,name\n", SIGNALS: b""}  # of no machine: verified, but fitting none


@cache
def key(number: int = 1) -> PrivateKey:
    """The private key with a number."""
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    return PrivateKey(Ed25519PrivateKey.from_private_bytes(bytes([number]) * 32))


def trust(*trusted: int, retired: tuple[int, ...] = ()) -> Trust:
    """Keys by their numbers, called works1 and so on."""
    known = [Known(f"works{n}", key(n).public, n in retired) for n in (*trusted, *retired)]
    return Trust(Path("keys"), tuple(known))


def bundle_files(gain: float = 1.0, **changes: object) -> dict[str, bytes]:
    """A bundle's folder by name; `changes` of its manifest."""
    parameters = {"gate_rise": {"value": 10.0, "unit": "1/s", "source": "x"}, "gain": {"value": gain}}
    files = {
        f"core-{bundle.host()}.so": f"machine code {gain}".encode(),
        "parameters.json": json.dumps(parameters).encode(),
        "sources/core/step.c": b"/* step */\n",
    }
    manifest = {
        **{"format": bundle.FORMAT, "controller": "pd", "engine": bundle.NATIVE, "slewright": VERSION},
        **{"layout": image.token(), "identity": f"{gain}", "platforms": [bundle.host()]},
        "files": {name: bundle.digest(data) for name, data in files.items()},
    }
    return {**files, bundle.MANIFEST: json.dumps({**manifest, **changes}).encode()}


def contents(
    gain: float = 1.0, specs: Mapping[str, bytes] | None = None, **changes: object
) -> dict[str, bytes]:
    """What is signed, by name; specs are this version's unless given."""
    files = {BUNDLE + name: data for name, data in bundle_files(gain, **changes).items()}
    parts = [{"type": "library", "name": "numpy", "version": "2.0"}]
    sbom = json.dumps({"bomFormat": "CycloneDX", "components": parts}).encode()
    return {**files, SBOM: sbom, **(signed.specs() if specs is None else specs)}


def archive(
    gain: float = 1.0,
    by: int = 1,
    release: str = "",
    specs: Mapping[str, bytes] | None = None,
    **changes: object,
) -> dict[str, bytes]:
    """A signed archive's files."""
    return signed.sign(contents(gain, specs, **changes), release, key(by))


def tiny(gain: float = 1.0, by: int = 1) -> signed.Signed:
    """A verified one whose specs are almost empty: quick to write, for power cuts."""
    return signed.verify(archive(gain, by, specs=SPECS), trust(1, 2), "tiny")


def written(path: Path, files: Mapping[str, bytes]) -> Path:
    """An archive's file."""
    path.write_bytes(container.pack(files))
    return path
