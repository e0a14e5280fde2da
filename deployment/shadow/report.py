"""The report of a run in shadow mode: everything computed, then written into one folder."""

import json
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deployment.shadow import agreement, closeness, handover, ranges
from deployment.shadow.closeness import Piece
from deployment.shadow.page import page
from deployment.shadow.recorded import Report, Shadowed, check_source, read
from records import figures_file as written
from runtime.bundle import Bundle
from specs import draws
from specs.errors import InputError, RunError

PAGE, FIGURES = "report.html", "report.json"
OURS = (PAGE, FIGURES, handover.FILE)


@dataclass(frozen=True)
class Request:
    """A recording, the bundle that made it, and what it is compared with."""

    recording: Path
    bundle: Bundle
    out: Path
    source: str | None = None  # of the operator's commands: joystick or valves
    load: float | None = None  # kg in the grab
    machine: str = draws.NOMINAL  # the reference machine that it is compared with


def check(request: Request) -> None:
    """InputError for what cannot be done, before anything takes time."""
    check_source(request.source)
    closeness.check_machine(request.machine)
    _check_folder(request.out)


def _check_folder(out: Path) -> None:
    """InputError for a folder that holds anything but an earlier report."""
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; name a folder for the report")
    foreign = sorted(p.name for p in out.iterdir() if p.name not in OURS) if out.is_dir() else []
    if foreign:
        raise InputError(
            f"{out} holds {foreign[0]}, which is not from this report; name a new or empty folder"
        )
    above = next(p for p in out.absolute().parents if p.exists())
    if not above.is_dir():
        raise InputError(f"{out}: {above} is a file")


def run(request: Request, report: Report) -> dict[str, Any]:
    """Compute and write; the figures. InputError for a recording or machine that is none."""
    check(request)
    report("repeating the recording")
    found = read(request.recording, request.bundle, request.source, report)
    near, pieces = closeness.compare(found, request.load, request.machine, report)
    figures = {
        "recording": str(request.recording),
        "controller": found.metadata.get("controller"),
        "label": found.metadata.get("label"),
        "operator": found.source,
        "ticks": len(found),
        "seconds": float(found.time[-1]),
        "notes": found.notes,
        "modes": agreement.modes(found),
        "commands": agreement.commands(found),
        "gate": agreement.gate(found),
        "faults": agreement.faults(found),
        "ranges": ranges.compare(found, request.bundle),
        "pendulum": ranges.pendulum(found),
        "closeness": near,
    }
    recording, told = request.out / handover.FILE, request.out / FIGURES
    figures["next"] = handover.next_commands(recording, request.out, told)
    report("writing the report")
    _write(request, found, figures, pieces)
    return figures


def _write(request: Request, found: Shadowed, figures: dict[str, Any], pieces: list[Piece]) -> None:
    """All files or none: they are made beside the folder first."""
    try:
        request.out.absolute().parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".shadow-", dir=request.out.absolute().parent) as scratch:
            part = Path(scratch)
            handover.write(found, request.recording, figures["closeness"]["load_kg"], part)
            written.write(part / FIGURES, figures)
            plain = json.loads((part / FIGURES).read_text())
            (part / PAGE).write_text(page(found, plain, pieces), encoding="utf-8")
            request.out.mkdir(exist_ok=True)
            for name in OURS:
                shutil.move(part / name, request.out / name)
    except OSError as error:
        raise RunError(f"cannot write {request.out}: {error.strerror or error}") from error
