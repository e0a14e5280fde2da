"""`slewright bundle --sign`: a bundle's folder, its specs, SBOM and configuration as one signed archive."""

import os
from collections.abc import Callable
from pathlib import Path

from deployment.bundling.sbom import sbom
from runtime import configuration
from runtime.archive import container, keys
from runtime.archive.names import BUNDLE, CONFIGURATION, SBOM
from runtime.archive.signed import Signed, check_release, sign, specs, verify
from runtime.archive.trust import Known, Trust
from runtime.bundle import Bundle, parse
from specs.errors import InputError


def default_path(out: Path) -> Path:
    """Where the archive of the bundle in `out` is written if nothing else is said."""
    return out.with_name(out.name + container.SUFFIX)


def check(
    archive: Path, key: Path, release: str, config: Path | None, passphrase: Callable[[], str]
) -> keys.PrivateKey:
    """The key that signs; InputError for anything that would be in the way, before it is compiled."""
    check_release(release)
    if not archive.parent.is_dir() or archive.is_dir():
        why = "it is a folder" if archive.is_dir() else f"there is no folder {archive.parent}"
        raise InputError(f"{archive}: {why}")
    if config is not None:
        configuration.read(config)
    return keys.read_private(key, passphrase)


def write(
    bundle: Bundle, archive: Path, key: keys.PrivateKey, release: str = "", config: Path | None = None
) -> Signed:
    """Write the archive of a bundle; what it is.  Same bundle, specs, software and key: same bytes.

    Raises InputError for a configuration or a release's name that is none.
    """
    files = contents(bundle.folder, config)
    manifest = parse(files[BUNDLE + "manifest.json"], str(bundle.folder))
    files[SBOM] = sbom(files, manifest, release)
    whole = sign(files, release, key)
    part = archive.with_name(f".{archive.name}.{os.getpid()}.part")
    try:
        part.write_bytes(container.pack(whole))
        trust = Trust(part, (Known("own", key.public, False),))
        signed = verify(container.read(part), trust, str(archive))
        part.replace(archive)
    finally:
        part.unlink(missing_ok=True)
    return signed


def contents(folder: Path, config: Path | None) -> dict[str, bytes]:
    """What is archived but SBOM, manifest and signature, by name."""
    inside = {p.relative_to(folder).as_posix(): p for p in folder.rglob("*") if p.is_file()}
    files = {BUNDLE + name: path.read_bytes() for name, path in inside.items()}
    if config is not None:
        files[CONFIGURATION] = config.read_bytes()
    return {**files, **specs()}
