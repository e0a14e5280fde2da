"""A commissioning's folder: a record and a trace of each step, what it left for later, and where it stands.

    session.json        machine, bundle, who; refused when it is gone on with another bundle or machine
    01-bus.json         verdict, checks with limits, what the operator was asked and said, times, bundle
    digest 01-bus.parquet      every tick of it: inputs as they came, what the controller sent
    calibration.json    after the last step of those that measure: zeros, signs, dead bands, tool, files

A step's record is written when the step ends, whichever way.  Redoing a step removes the records of all
later ones: they rest on it.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from deployment.commissioning.rig import Trace
from records.figures_file import write_text
from records.recording import RecordWriter
from runtime.image import INPUT, OUTPUT
from specs.errors import InputError
from specs.version import VERSION

HEAD = "session.json"
PASSED, FAILED, INTERRUPTED = "passed", "failed", "interrupted"


@dataclass(frozen=True)
class Session:
    """The folder and what it is of."""

    folder: Path
    steps: tuple[str, ...]
    identity: Mapping[str, Any]

    @classmethod
    def open(
        cls, folder: Path, steps: tuple[str, ...], identity: Mapping[str, Any], resume: bool
    ) -> "Session":
        """Begin in a new folder, or go on in one that was begun; InputError where that does not fit."""
        head = folder / HEAD
        if head.is_file() and not resume:
            raise InputError(
                f"{folder} holds a commissioning: --resume goes on with it; or name another --out"
            )
        if resume and not head.is_file():
            raise InputError(f"--resume: {folder} holds no commissioning")
        if not resume and folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(f"{folder} holds something else; name another --out")
        if resume:
            _check_same(folder, _read(head), identity)
        else:
            folder.mkdir(parents=True, exist_ok=True)
            write_text(head, json.dumps({**identity, "begun": _now(), "slewright": VERSION}, indent=2) + "\n")
        return cls(folder, steps, dict(identity))

    def path(self, step: str, suffix: str = ".json") -> Path:
        """The file of a step."""
        return self.folder / f"{self.steps.index(step) + 1:02d}-{step}{suffix}"

    def record(self, step: str) -> dict[str, Any] | None:
        """A step's record; None if it has none."""
        path = self.path(step)
        return _read(path) if path.is_file() else None

    def passed(self, step: str) -> bool:
        """Whether a step's last record says so."""
        found = self.record(step)
        return bool(found) and found["verdict"] == PASSED

    def findings(self) -> dict[str, dict[str, Any]]:
        """What the steps that passed found, by step."""
        return {s: record["found"] for s in self.steps if (record := self.record(s)) and self.passed(s)}

    def begin(self, step: str) -> None:
        """Forget the step's record and those of all later ones."""
        for later in self.steps[self.steps.index(step) :]:
            for suffix in (".json", ".parquet"):
                self.path(later, suffix).unlink(missing_ok=True)

    def write(self, step: str, verdict: str, content: Mapping[str, Any], trace: Trace) -> None:
        """A step's record and trace."""
        columns = ("time", *(s.name for s in INPUT.signals), *(s.name for s in OUTPUT.signals))
        meta = {**self.identity, "step": step, "verdict": verdict}
        with RecordWriter(self.path(step, ".parquet"), columns, meta) as writer:
            writer.append(np.column_stack([trace.time, trace.inputs, trace.outputs]))
        record = {
            "step": step,
            "verdict": verdict,
            **self.identity,
            "slewright": VERSION,
            "ended": _now(),
            **content,
        }
        write_text(self.path(step), json.dumps(_plain(record), indent=2, allow_nan=False) + "\n")

    def put(self, name: str, text: str) -> None:
        """A file that a step made."""
        write_text(self.folder / name, text)


def _check_same(folder: Path, told: Mapping[str, Any], identity: Mapping[str, Any]) -> None:
    for key, value in identity.items():
        if key != "who" and told.get(key) != value:
            raise InputError(
                f"--resume: {folder} was begun with {key} {told.get(key) or 'nothing'}, "
                f"this is {value or 'nothing'}; "
                "begin anew in another --out"
            )


def _read(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}); remove it to do its step again") from None
    if not isinstance(found, dict):
        raise InputError(f"{path}: no record; remove it to do its step again")
    return found


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _plain(value: Any) -> Any:
    """Numbers that JSON has; NaN becomes null."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
