"""Who may do what: a file with the roles' tokens, of which only the SHA-256 is kept.

A token has 160 random bits, so a plain hash of it is enough; it is shown once, when it is made.
"""

import hashlib
import hmac
import json
import os
import secrets
from dataclasses import dataclass
from pathlib import Path

from specs.errors import InputError

OPERATOR, SERVICE = "operator", "service"
ROLES = (OPERATOR, SERVICE)  # service may do what an operator may, and force inputs
BYTES = 20
FORMAT = 1


@dataclass(frozen=True)
class Entry:
    """One token's role and hash."""

    role: str
    sha256: str


def make(path: Path) -> dict[str, str]:
    """Write a file with a new token for each role, for this user only; role -> token.

    Raises InputError if it cannot be written.
    """
    made = {role: secrets.token_hex(BYTES) for role in ROLES}
    content = {"format": FORMAT, "tokens": [{"role": r, "sha256": _hash(t)} for r, t in made.items()]}
    temporary = path.with_name(path.name + ".new")
    try:
        temporary.unlink(missing_ok=True)
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "w") as file:
            json.dump(content, file, indent=1)
        temporary.replace(path)
    except OSError as error:
        raise InputError(f"tokens {path} cannot be written: {error.strerror}") from None
    return made


def read(path: Path) -> tuple[Entry, ...]:
    """The entries of a file; InputError for one that is damaged, or that others may write."""
    try:
        if path.stat().st_mode & 0o022:
            raise InputError(f"tokens {path}: others may write it; chmod 600 {path}")
        content = json.loads(path.read_text(encoding="utf-8"))
        found = tuple(Entry(str(e["role"]), str(e["sha256"])) for e in content["tokens"])
        right = content["format"] == FORMAT and all(e.role in ROLES and len(e.sha256) == 64 for e in found)
    except OSError as error:
        raise InputError(f"tokens {path} cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError):
        right, found = False, ()
    if not right or not found:
        raise InputError(f"tokens {path} is no token file; make one: slewright hmi --new-tokens {path}")
    return found


def role_of(token: str, entries: tuple[Entry, ...]) -> str | None:
    """The role of a token, None for one that is not known; takes as long whatever is wrong with it."""
    given, found = _hash(token), None
    for entry in entries:
        if hmac.compare_digest(given, entry.sha256):
            found = entry.role
    return found


def _hash(token: str) -> str:
    return hashlib.sha256(token.encode("utf-8", "surrogatepass")).hexdigest()
