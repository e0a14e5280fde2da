"""Recordings in other tools' formats, read and written with units, channel masters and start time.

One module a format; `docs/reference/recordings.md` says what each keeps and what is mended how.
"""

import ast
import re
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from records.formats.assemble import assemble
from records.formats.stated import statement_of
from records.formats.tables import is_clock
from records.formats.text.options import TextOptions
from records.measurement import Measurement
from records.recording import first_line
from specs.errors import InputError, RunError
from specs.schema import ROOT

FOLDER = Path(__file__).parent
FIRST = (
    "parquet_file",
    "csv_file",
    "mdf4",
    "mcap_file",
    "can_log",
    "ros2_bag",
    "ros2_sqlite",
)  # others come after them
STATED = re.compile(r"^(READS|WRITES) = (\(.*\))$", re.MULTILINE)


def _stated() -> dict[str, dict[str, tuple[str, ...]]]:
    """{module: {"READS": suffixes, "WRITES": suffixes}} of every module that states both, on a line each.

    Modules are imported when a file of theirs comes: most need a package that few commands have.
    """
    modules = sorted({*FIRST, *(path.stem for path in FOLDER.glob("*.py"))}, key=_place)
    texts = {m: (FOLDER / f"{m}.py").read_text(encoding="utf-8") for m in modules if m != "__init__"}
    found = {m: {k: ast.literal_eval(v) for k, v in STATED.findall(text)} for m, text in texts.items()}
    return {m: stated for m, stated in found.items() if len(stated) == 2}


def _place(module: str) -> tuple[int, str]:
    return (FIRST.index(module) if module in FIRST else len(FIRST), module)


_FOUND = _stated()
FORMATS = {
    suffix: module for module, of in _FOUND.items() for suffix in dict.fromkeys((*of["READS"], *of["WRITES"]))
}
READ_ONLY = tuple(s for of in _FOUND.values() for s in of["READS"] if s not in of["WRITES"])
WRITE_ONLY = tuple(s for of in _FOUND.values() for s in of["WRITES"] if s not in of["READS"])
CAN_LOGS = (".blf", ".asc", ".log", ".candump", ".trc")
MAY_HOLD_FRAMES = (".mf4", ".mdf", ".dat")  # of a bus, besides channels
DBC = ROOT / "generated" / "slewright.dbc"


def read_measurement(
    path: Path | str,
    *,
    dbc: Path | str | None = None,
    names: Mapping[str, str] | None = None,
    text: TextOptions | None = None,
    protocol: str | None = None,
) -> Measurement:
    """Read a recording of any known format; what was mended stands in `repairs`.

    `names` renames channels ({theirs: ours}); ours may state a unit the file lacks and turn the sign, as in
    "p_slew_a [bar]" or "-q_slew [deg]", and "time [ms]" names the clock of a table.  A channel with the name
    of a signal comes in that signal's unit.  `dbc` decodes CAN logs (default: specs/generated/slewright.dbc).
    `protocol` says whether J1939's rules hold where the DBC does not.
    `text` states what else is decided from a text file: marks, encoding, clock, words for missing values.
    What is not given here is what was stated about the file (`stated.py`).

    Raises InputError naming the file and the place of what cannot be mended.
    """
    path = Path(path)
    known = statement_of(path)
    names = known.names if names is None else names
    text = _for(path, known.text) if text is None else text
    if path.suffix.lower() in WRITE_ONLY and not _in_folder(path):
        raise InputError(
            f"{path}: a bag of ROS 2 is read where it is a folder with .mcap or .db3 files in it"
        )
    if path.is_dir() and not _in_folder(path):
        raise InputError(
            f"{path} is a folder, neither the recorder's (*.mcap) nor a bag of ROS 2 (*.mcap, *.db3); name a "
            "recording"
        )
    module, options = _module(path, dbc)
    if not path.exists() and not Path(f"{path}.recording").is_file():
        raise InputError(f"no recording at {path}")
    if path.is_file() and not path.stat().st_size:
        raise InputError(f"{path} is empty")
    if protocol is not None:
        if protocol not in ("j1939", "can") or "dbc" not in options:
            logs = ", ".join((*CAN_LOGS, *(f"{s} with --dbc" for s in MAY_HOLD_FRAMES)))
            raise InputError(f"--protocol {protocol}: j1939 or can, for CAN logs ({logs})")
        options["protocol"] = protocol
    if text is not None and text.stated:
        _for_text(path, text, options)
    clocks = [theirs for theirs, ours in (names or {}).items() if is_clock(ours)]
    if clocks and not getattr(module, "TIME_COLUMN", False):
        raise InputError(f"{path} has times of its own; '{clocks[0]}' cannot be its time")
    return assemble(module.read(path, names or {}, **options), str(path), names)


def write_measurement(
    measurement: Measurement, path: Path | str, *, dbc: Path | str | None = None
) -> list[str]:
    """Write a recording in the format of the suffix, whole or not at all; returns what is not kept.

    Raises InputError where the format cannot hold it: one time for channels of several rates (`on_grid`
    first), a value beyond its place on CAN.  RunError when the disk refuses.
    """
    path = Path(path)
    check_format(path)
    module, options = _module(path, dbc)
    if path.is_dir() or not path.parent.is_dir():
        raise InputError(
            f"{path}: there is no folder {path.parent}" if not path.is_dir() else f"{path} is a folder"
        )
    if not any(len(c.time) for c in measurement.channels.values()):
        raise InputError(f"{measurement.source or 'the recording'} holds no samples")
    with TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as folder:
        temporary = Path(folder) / path.name
        try:
            lost = module.write(measurement, temporary, **options)
            temporary.replace(path)
        except (OSError, RunError) as error:
            cause = error.__cause__ or error
            reason = cause.strerror if isinstance(cause, OSError) else None
            raise RunError(f"cannot write {path}: {reason or first_line(cause)}") from error
    return lost


def is_segments(path: Path) -> bool:
    """Whether it is a folder of the runtime's recorder."""
    return path.is_dir() and any(path.glob("*.mcap"))


def _in_folder(path: Path) -> str:
    """The suffix of the recordings in a folder; "" for what is no folder with any."""
    return next((s for s in (".mcap", ".db3") if path.is_dir() and any(path.glob(f"*{s}"))), "")


def check_format(path: Path) -> None:
    """Raise InputError for a file that is of no format that is written."""
    if path.suffix.lower() not in FORMATS or path.suffix.lower() in READ_ONLY:
        valid = ", ".join(s for s in FORMATS if s not in READ_ONLY)
        raise InputError(f"{path}: '{path.suffix}' is no format that is written; valid: {valid}")


def check_text(paths: Sequence[Path], text: TextOptions) -> None:
    """Raise InputError where something is stated about text files and none of `paths` can take it."""
    wrong = [_not_for(path, text) for path in paths]
    if wrong and all(wrong):
        raise InputError(
            f"{paths[0]} is no text file: {', '.join(wrong[0])} is for .csv, .tsv, .txt and .lvm"
        )


def _not_for(path: Path, text: TextOptions) -> list[str]:
    """What is stated and a file of this kind cannot take; a Parquet file takes the clock alone."""
    module = FORMATS.get(path.suffix.lower())
    if module == "csv_file":
        return []
    return [option for option in text.stated if option != "--clock" or module != "parquet_file"]


def _for(path: Path, text: TextOptions | None) -> TextOptions | None:
    """Of what is stated about several files, what this one can take."""
    if text is None or not (wrong := _not_for(path, text)):
        return text
    return text.without(wrong)


def _for_text(path: Path, text: TextOptions, options: dict[str, Any]) -> None:
    """Hand over what is stated about a text file."""
    check_text([path], text)
    options["text"] = text


def _module(path: Path, dbc: Path | str | None) -> tuple[Any, dict[str, Any]]:
    """The module that reads and writes files of this name, and its options."""
    suffix = _in_folder(path) or path.suffix.lower()
    if suffix not in FORMATS:
        raise InputError(f"{path}: unknown format '{path.suffix}'; valid: {', '.join(FORMATS)}")
    frames = suffix in CAN_LOGS or (suffix in MAY_HOLD_FRAMES and dbc is not None)
    if dbc is not None and not frames:
        raise InputError(f"{path} is no CAN log: a DBC is for {', '.join((*CAN_LOGS, *MAY_HOLD_FRAMES))}")
    options: dict[str, Any] = {"dbc": Path(dbc or DBC)} if frames else {}
    return import_module(f"records.formats.{FORMATS[suffix]}"), options
