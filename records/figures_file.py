"""Files of figures (JSON, with seed and versions), written whole or not at all."""

import json
import math
import os
import platform
import tempfile
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from specs.errors import InputError
from specs.version import VERSION


def check_target(path: Path | None) -> Path | None:
    """Refuse a file that could not be written, before the command spends minutes on its figures."""
    if path is None:
        return None
    if path.is_dir():
        raise InputError(f"{path} is a folder; name a file")
    if path.exists() and not path.is_file():
        raise InputError(f"{path} is a device or pipe, which a file would replace; name a file")
    folder = path.parent
    if not folder.is_dir():
        raise InputError(f"{path}: there is no folder {folder}")
    if not os.access(folder, os.W_OK):
        raise InputError(f"{path}: the folder {folder} cannot be written to")
    return path


def make_folder(path: Path) -> Path:
    """Make a folder for results, with those above it; InputError where a file is in its way."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise InputError(f"{path} is a file; name a folder") from None
    except OSError as error:
        raise InputError(f"{path}: the folder cannot be made ({error.strerror})") from None
    return path


def check_suffix(path: Path | None, *valid: str) -> Path | None:
    """Refuse a file whose name says that it holds something else than what would be written."""
    if path is not None and path.suffix not in valid:
        raise InputError(f"{path}: its name ends in '{path.suffix}'; valid: {', '.join(valid)}")
    return check_target(path)


def write(path: Path | None, figures: Mapping[str, Any], seed: int | None = None) -> None:
    """Write `figures` with `seed` and versions to `path` as JSON, if a path is given.

    Numbers that JSON does not know (NaN, infinities) become null; numpy scalars and arrays are converted.
    """
    if path is None:
        return
    content = {**figures, "seed": seed, "versions": versions()}
    write_text(path, json.dumps(plain(content), indent=2, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path` by way of a temporary file beside it: a reader sees the old file or the new."""
    with tempfile.NamedTemporaryFile(
        "w", encoding="utf-8", dir=path.parent, prefix=f".{path.name}.", delete=False
    ) as file:
        temporary = Path(file.name)
        try:
            file.write(text)
            file.flush()
            # Temporary files are private; the figures get the permissions of any other new file.
            temporary.chmod(0o666 & ~_umask())
            temporary.replace(path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise


def versions() -> dict[str, str]:
    """Versions that a figure may depend on; a package that is not installed is left out."""
    found = {
        "slewright": VERSION,
        "python": platform.python_version(),
        "platform": f"{platform.system()}-{platform.machine()}".lower(),
    }
    for package in ("casadi", "numpy", "scipy", "fmpy"):
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found


def _umask() -> int:
    mask = os.umask(0o022)
    os.umask(mask)
    return mask


def plain(value: Any) -> Any:
    """The same value in JSON's own types: numbers that JSON does not know are null, numpy's become plain."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    as_list = getattr(value, "tolist", None)  # numpy
    return plain(as_list()) if as_list else value
