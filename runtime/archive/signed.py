"""What an archive holds, and whether it is what its signature says.

release.json               the manifest: format, name of the release, size and SHA-256 of every other file
release.sig                Ed25519 signature over it, and which key's
bundle/                    the bundle's folder as `slewright bundle` makes it
specs/                     DBC, register map and signals that it was built with
sbom.cdx.json              what is in it and what it needs, as CycloneDX
configuration/machine.toml if one was given

The SHA-256 of release.json stands for the whole: it is the bundle's digest in stores and on screens.
"""

import base64
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from runtime import bundle as form
from runtime.archive.differences import part
from runtime.archive.keys import ARCHIVE, PrivateKey
from runtime.archive.names import BUNDLE, DBC, MANIFEST, MAP, NEEDED, SHOWN, SIGNALS, SIGNATURE
from runtime.archive.trust import Trust
from specs.dbc import render
from specs.errors import InputError
from specs.schema import ROOT
from specs.tables import modbus_csv

FORMAT = 1
RELEASE = re.compile(r"[A-Za-z0-9_.+-]{0,40}", re.ASCII)
DIGEST = re.compile(r"[0-9a-f]{64}", re.ASCII)


@dataclass(frozen=True)
class Signed:
    """A checked archive, or a checked folder of a store."""

    files: Mapping[str, bytes]
    digest: str
    release: str
    signer: str  # name of the key
    manifest: Mapping[str, Any]  # of the bundle

    @property
    def name(self) -> str:
        """How it is shown: controller, release, digest."""
        return " ".join(p for p in (self.manifest["controller"], self.release, self.digest[:SHOWN]) if p)


def sign(files: Mapping[str, bytes], release: str, key: PrivateKey) -> dict[str, bytes]:
    """`files` with manifest and signature; InputError for a release's name that is none."""
    check_release(release)
    told = {n: {"bytes": len(data), "sha256": form.digest(data)} for n, data in files.items()}
    manifest = _json({"format": FORMAT, "release": release, "files": told})
    made = {"key": key.public.id, "signature": base64.b64encode(key.sign(ARCHIVE, manifest)).decode()}
    return {**files, MANIFEST: manifest, SIGNATURE: _json(made)}


def check_release(name: str) -> None:
    """Raise InputError for what cannot be a release's name."""
    if not RELEASE.fullmatch(name):
        raise InputError(f"release '{name[:40]}': up to 40 letters, digits and . _ + -")


def verify(files: Mapping[str, bytes], trust: Trust, where: str) -> Signed:
    """Check signature and contents; raises InputError, `where` first, with what is wrong.

    Nothing of the manifest is read before its signature has been checked.
    """
    for name in (MANIFEST, SIGNATURE):
        if name not in files:
            raise InputError(f"{where}: {name} is missing: it is not signed")
    key, signature = _signature(files[SIGNATURE], where)
    signer = trust.signer(key, files[MANIFEST], signature, where)
    release = check_contents(files, where)
    bundle = form.parse(files[BUNDLE + form.MANIFEST], where)
    return Signed(files, form.digest(files[MANIFEST]), release, signer, bundle)


def check_contents(files: Mapping[str, bytes], where: str) -> str:
    """Name of the release; InputError unless the files are those of the manifest."""
    told, release = _manifest(files[MANIFEST], where)
    found = files.keys() - {MANIFEST, SIGNATURE}
    for name in sorted(told.keys() | found | set(NEEDED)):
        if name not in found:
            raise InputError(f"{where}: {name} is missing")
        if name not in told:
            raise InputError(f"{where}: {name} is not in its manifest")
        if told[name] != {"bytes": len(files[name]), "sha256": form.digest(files[name])}:
            raise InputError(f"{where}: {name} was changed since it was signed")
    return release


def check_fit(signed: Signed, where: str) -> None:
    """Raise InputError for a bundle of another version, process image, platform or specs than here."""
    form.check_version(signed.manifest, where)
    if form.host() not in signed.manifest["platforms"]:
        have = ", ".join(signed.manifest["platforms"])
        raise InputError(f"{where}: it has no core for {form.host()}, only for {have}")
    for name, here in specs().items():
        if name != SIGNALS and signed.files[name] != here:
            raise InputError(f"{where}: made for other specs: {name} differs{_first(name, signed, here)}")


def specs() -> dict[str, bytes]:
    """The specs of this version, by their names in an archive."""
    made = {DBC: render().encode(), MAP: modbus_csv().encode()}
    return {**made, SIGNALS: (ROOT / "signals.toml").read_bytes()}


def _first(name: str, signed: Signed, here: bytes) -> str:
    """The first difference in words; "" where it is one of remarks only, or cannot be told."""
    try:
        changes = part(name, {name: here}, signed.files)
    except InputError:
        return ""
    return f" ({changes[0]})" if changes else ""


def _signature(data: bytes, where: str) -> tuple[str, bytes]:
    try:
        told = json.loads(data)
        key, signature = told["key"], base64.b64decode(told["signature"], validate=True)
    except (ValueError, KeyError, TypeError, RecursionError):
        raise InputError(f"{where}: {SIGNATURE} cannot be read") from None
    if not isinstance(key, str) or data != _json(told):
        raise InputError(f"{where}: {SIGNATURE} cannot be read")
    return key, signature


def _manifest(data: bytes, where: str) -> tuple[dict[str, Any], str]:
    """(files, release)"""
    try:
        told = json.loads(data)
        kind, files, release = told["format"], told["files"], told["release"]
    except (ValueError, KeyError, TypeError, RecursionError):
        raise InputError(f"{where}: {MANIFEST} cannot be read") from None
    if kind != FORMAT:
        raise InputError(f"{where}: format {kind!r}: this version reads {FORMAT}")
    if not isinstance(files, dict) or not isinstance(release, str) or not RELEASE.fullmatch(release):
        raise InputError(f"{where}: {MANIFEST} cannot be read")
    return files, release


def _json(content: Any) -> bytes:
    return (json.dumps(content, indent=1, sort_keys=True) + "\n").encode()
