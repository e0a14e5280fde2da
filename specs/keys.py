"""Random numbers by key: the same key gives the same number on every platform and in every version."""

import hashlib


def uniform(*key: object) -> float:
    """A number in [0, 1), uniformly distributed over keys: the first 53 bits of the key's SHA-256."""
    text = "/".join(str(part) for part in key)
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return (int.from_bytes(digest[:8], "big") >> 11) / 2.0**53
