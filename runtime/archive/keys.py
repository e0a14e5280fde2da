"""Ed25519 keys that sign archives (RFC 8032), in the PEM files that OpenSSL reads and writes too.

What is signed begins with what it is for, so that a signature for one thing is none for another.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization as form
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from runtime.archive import bounded
from specs.errors import InputError

ARCHIVE, KEY = b"slewright archive 1\0", b"slewright key 1\0"  # what a signature is for
LARGEST = 1 << 14  # bytes of a key's file
PUBLIC = ".pub.pem"
PRIVATE = b"PRIVATE KEY-----"


@dataclass(frozen=True)
class PublicKey:
    """A public key, 32 bytes."""

    raw: bytes

    @property
    def id(self) -> str:
        """What it is called in signatures and shown as: the first 16 digits of its SHA-256."""
        return sha256(self.raw).hexdigest()[:16]

    def signed(self, purpose: bytes, message: bytes, signature: bytes) -> bool:
        """Whether `signature` is this key's, of `message` for `purpose`."""
        try:
            Ed25519PublicKey.from_public_bytes(self.raw).verify(signature, purpose + message)
        except (InvalidSignature, ValueError):
            return False
        return True

    def pem(self) -> bytes:
        """The contents of its file."""

        key = Ed25519PublicKey.from_public_bytes(self.raw)
        return key.public_bytes(form.Encoding.PEM, form.PublicFormat.SubjectPublicKeyInfo)


class PrivateKey:
    """A key that signs."""

    def __init__(self, key: Ed25519PrivateKey) -> None:
        self._key = key
        self.public = PublicKey(key.public_key().public_bytes_raw())

    def sign(self, purpose: bytes, message: bytes) -> bytes:
        """Signature of `message` for `purpose`, 64 bytes."""
        return self._key.sign(purpose + message)


def new(path: Path, passphrase: str = "") -> PrivateKey:
    """Make a key: the private one in `path`, readable by its owner only, the public one beside it.

    Raises InputError where one of the files is there already, or the folder is not.
    """

    key = Ed25519PrivateKey.generate()
    lock = form.BestAvailableEncryption(passphrase.encode()) if passphrase else form.NoEncryption()
    for target in (path, public_path(path)):
        if target.exists():
            raise InputError(f"{target} is there already; choose another name")
    made = PrivateKey(key)
    _write(public_path(path), made.public.pem(), 0o644)
    _write(path, key.private_bytes(form.Encoding.PEM, form.PrivateFormat.PKCS8, lock), 0o600)
    return made


def public_path(path: Path) -> Path:
    """Where the public key of the private key in `path` is written."""
    return path.with_name(path.name.removesuffix(".pem") + PUBLIC)


def read_private(path: Path, passphrase: Callable[[], str] = str) -> PrivateKey:
    """The private key in a PEM file; `passphrase` is asked where it is encrypted.

    Raises InputError for a file that holds none, or a wrong passphrase.
    """

    data = read(path)
    if PRIVATE not in data:
        raise InputError(f"{path} holds no private key (PEM); slewright deploy keys new makes one")
    secret = passphrase().encode() if b"ENCRYPTED" in data else b""
    try:
        key = form.load_pem_private_key(data, secret or None)
    except (ValueError, TypeError, UnsupportedAlgorithm):
        said = "the passphrase is wrong" if b"ENCRYPTED" in data else "it cannot be read as a private key"
        raise InputError(f"{path}: {said}") from None
    if not isinstance(key, Ed25519PrivateKey):
        raise InputError(f"{path}: a key of another kind; an archive is signed with Ed25519")
    return PrivateKey(key)


def read_public(path: Path) -> PublicKey:
    """The public key in a PEM file; InputError if it is none."""

    data = read(path)
    if PRIVATE in data:
        raise InputError(f"{path} is a private key: it stays where bundles are signed; give *{PUBLIC}")
    try:
        key = form.load_pem_public_key(data)
    except (ValueError, UnsupportedAlgorithm):
        raise InputError(f"{path} cannot be read as a public key (PEM)") from None
    if not isinstance(key, Ed25519PublicKey):
        raise InputError(f"{path}: a key of another kind; an archive is signed with Ed25519")
    return PublicKey(key.public_bytes_raw())


def read(path: Path) -> bytes:
    """The contents of a file that is as small as a key's; InputError if it is not, or cannot be read."""
    return bounded.read(path, LARGEST, "too large for a key")


def _write(path: Path, data: bytes, mode: int) -> None:
    try:
        number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
    with os.fdopen(number, "wb") as file:
        file.write(data)
