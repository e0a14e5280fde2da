"""What a collection's folder says of its recordings; `collect` writes it last."""

import json
from pathlib import Path
from typing import Any

from specs.errors import InputError

NAME = "collection.json"


def read(folder: Path) -> tuple[dict[str, Any], list[tuple[Path, dict[str, Any]]]]:
    """(manifest, file and entry of each recording that was not aborted); InputError names what is wrong."""
    path = folder / NAME
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        entries = [(folder / entry["file"], entry) for entry in content["recordings"] if not entry["aborted"]]
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; collect recordings first: slewright collect") from None
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} is damaged: {error}") from None
    return content, entries
