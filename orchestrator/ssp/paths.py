"""Files that a description names by relative URI (SSP 2.0, 2.3): found inside of the package, or refused."""

import os
from pathlib import Path
from urllib.parse import unquote

from orchestrator.files.archive import MAX_NAME
from orchestrator.files.xml_file import shortened
from orchestrator.ssp.text import Place
from specs.errors import InputError


def inside(place: Place, root: Path, folder: Path, source: str, of: str = "") -> Path:
    """The file `source` (`of` what) seen from `folder`; InputError, naming the place, if not below `root`."""
    name = unquote(source)
    path = Path(os.path.normpath(folder / name))
    foreign = ":" in source or "\\" in name or "\0" in name or name.startswith("/")
    if any(len(os.fsencode(part)) > MAX_NAME for part in path.parts):
        raise InputError(f"{place}: source '{shortened(source)}'{of} has too long a name")
    if not name or foreign or not path.is_relative_to(root):
        raise InputError(f"{place}: source '{source}'{of} is not inside the package")
    return path
