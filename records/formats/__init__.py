"""Recordings in other tools' formats, read and written with units, channel masters and start time.

One module a format; `docs/recordings.md` says what each keeps and what is mended how.
"""

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

from records.measurement import Measurement
from specs.errors import InputError

# Modules are imported when a file of theirs comes: most need a package that few commands have.
FORMATS = {
    ".parquet": "parquet_file",
    ".recording": "parquet_file",
    ".csv": "csv_file",
    ".tsv": "csv_file",
    ".txt": "csv_file",
}


def read_measurement(
    path: Path | str, *, dbc: Path | str | None = None, names: Mapping[str, str] | None = None
) -> Measurement:
    """Read a recording of any known format; what was mended stands in `repairs`.

    `names` renames channels ({theirs: ours}); ours may state a unit the file lacks and turn the sign, as in
    "p_slew_a [bar]" or "-q_slew [deg]", and "time [ms]" names the clock of a table.  A channel with the name
    of a signal comes in that signal's unit.  `dbc` decodes CAN logs (default: specs/generated/slewright.dbc).

    Raises InputError naming the file and the place of what cannot be mended.
    """
    from records.formats.assemble import assemble

    path = Path(path)
    module = _module(path)
    if path.is_dir():
        raise InputError(f"{path} is a folder; name a recording")
    if not path.is_file() and not Path(f"{path}.recording").is_file():
        raise InputError(f"no recording at {path}")
    return assemble(module.read(path, names or {}), str(path), names)


def _module(path: Path):
    """The module that reads and writes files of this name."""
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"{path}: unknown format '{path.suffix}'; valid: {', '.join(FORMATS)}")
    return import_module(f"records.formats.{FORMATS[path.suffix.lower()]}")
