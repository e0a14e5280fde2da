"""The keys that a machine trusts: a folder of public keys, NAME.pem trusted, NAME.retired not any more.

Whoever may write to the folder decides what runs; so the first key comes in by hand, and each later one only
with an endorsement: a signature over it by a key that is trusted already.  A retired key stays, so that it is
refused by name and does not come back.
"""

import base64
import binascii
import json
import re
from dataclasses import dataclass
from pathlib import Path

from runtime.archive.keys import ARCHIVE, KEY, PrivateKey, PublicKey, read_public
from runtime.retain.copies import Folder
from specs.errors import InputError, nearest

TRUSTED, RETIRED, ENDORSED = ".pem", ".retired", ".endorsed"
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_+-]{0,39}", re.ASCII)


@dataclass(frozen=True)
class Known:
    """A key of the folder."""

    name: str
    key: PublicKey
    retired: bool


@dataclass(frozen=True)
class Trust:
    """The keys of a folder, by name."""

    folder: Path
    known: tuple[Known, ...]

    @property
    def trusted(self) -> tuple[Known, ...]:
        """Those whose signatures count."""
        return tuple(k for k in self.known if not k.retired)

    def signer(self, key: str, message: bytes, signature: bytes, where: str, purpose: bytes = ARCHIVE) -> str:
        """Name of the trusted key with the id `key`, whose signature this is.

        Raises InputError, `where` first, for an unknown or retired key, or a signature that is not the key's.
        """
        found = [k for k in self.known if k.key.id == key]
        if not found:
            have = ", ".join(f"{k.name} ({k.key.id})" for k in self.trusted) or "none (deploy keys add)"
            raise InputError(f"{where}: signed by the unknown key {key[:16]!r}; trusted: {have}")
        if retired := [k for k in found if k.retired]:
            raise InputError(f"{where}: signed by {retired[0].name} ({key}), which was retired")
        if not found[0].key.signed(purpose, message, signature):
            raise InputError(f"{where}: the signature is not one of {found[0].name} ({key}) of this manifest")
        return found[0].name


def read(folder: Path) -> Trust:
    """The keys in `folder`, none if there is no such folder; InputError for a file that holds no key."""
    known = []
    for path in sorted(folder.glob("*")):
        if path.suffix in (TRUSTED, RETIRED):
            known.append(Known(path.stem, read_public(path), path.suffix == RETIRED))
    return Trust(folder, tuple(known))


def endorse(key: PublicKey, by: PrivateKey) -> bytes:
    """The contents of an endorsement's file."""
    told = {"key": key.id, "by": by.public.id, "signature": _text(by.sign(KEY, key.raw))}
    return (json.dumps(told, indent=1) + "\n").encode()


def add(folder: Path, name: str, key: PublicKey, endorsement: bytes | None) -> str:
    """Trust `key` from now on under `name`; the name of the key that endorsed it, "" for the first one.

    Raises InputError for a name or key that is there already or was retired, and for a second or later key
    without the endorsement of a trusted one.
    """
    trust = read(folder)
    if not NAME.fullmatch(name):
        raise InputError(f"key name '{name[:40]}': up to 40 letters, digits, - and _ ; --name gives another")
    for known in trust.known:
        if known.key == key:
            raise InputError(
                f"key {key.id} is there already: {known.name}" + (", retired" if known.retired else "")
            )
        if known.name == name:
            raise InputError(f"{folder} has a key {name} already ({known.key.id}); --name gives another")
    by = _endorser(trust, key, endorsement) if trust.known else ""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be made: {error.strerror}") from None
    _put(folder, f"{name}{TRUSTED}", key.pem())
    return by


def retire(folder: Path, name: str) -> Known:
    """Trust the key `name` (or with this id) no more; InputError if there is none that is trusted."""
    known = find(read(folder), name)
    files = Folder(folder)
    files.rename(known.name + TRUSTED, known.name + RETIRED)
    files.sync_folder()
    return known


def find(trust: Trust, name: str) -> Known:
    """The trusted key with a name or id; InputError with those there are."""
    for known in trust.trusted:
        if name in (known.name, known.key.id):
            return known
    have = nearest(name, [k.name for k in trust.trusted]) if trust.trusted else "there is none"
    raise InputError(f"{trust.folder}: no trusted key '{name}'; {have}")


def _endorser(trust: Trust, key: PublicKey, endorsement: bytes | None) -> str:
    if endorsement is None:
        who = ", ".join(k.name for k in trust.trusted) or "none is left"
        raise InputError(
            f"key {key.id} has no endorsement by a trusted key ({who}); "
            "slewright deploy keys endorse makes one"
        )
    where = f"endorsement of {key.id}"
    told, by, signature = _parsed(endorsement, where)
    if told != key.id:
        raise InputError(f"{where}: it is one of the key {told[:16]!r}")
    return trust.signer(by, key.raw, signature, where, KEY)


def _parsed(endorsement: bytes, where: str) -> tuple[str, str, bytes]:
    """(key, endorsing key, signature)"""
    try:
        told = json.loads(endorsement)
        return str(told["key"]), str(told["by"]), base64.b64decode(told["signature"], validate=True)
    except (ValueError, KeyError, TypeError, RecursionError, binascii.Error):
        raise InputError(f"{where}: cannot be read") from None


def _text(signature: bytes) -> str:
    return base64.b64encode(signature).decode()


def _put(folder: Path, name: str, data: bytes) -> None:
    """Write a file whole: a power cut leaves the old state or the new one."""
    files, part = Folder(folder), f".{name}.part"
    files.write(part, data)
    files.sync(part)
    files.rename(part, name)
    files.sync_folder()
