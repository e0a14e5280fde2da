"""Files of others, read up to a bound."""

from pathlib import Path

from specs.errors import InputError


def read(path: Path, largest: int, too_large: str) -> bytes:
    """The contents of a file of at most `largest` bytes; InputError if it cannot be read or is longer."""
    try:
        if not path.is_file():
            raise InputError(f"{path}: there is no such file")
        with path.open("rb") as file:
            data = file.read(largest + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    if len(data) > largest:
        raise InputError(f"{path}: {too_large}")
    return data
