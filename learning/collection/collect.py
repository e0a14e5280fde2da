"""Runs a collection plan: makes the recordings that are not there yet, then writes the manifest.

    OUT/NNN_PART.parquet   one run record a recording: commands and sensors at 50 Hz
    OUT/controller.json    the closed loop's controller, where the plan does not state one
    OUT/coverage.html      what was visited, against what a model is used on
    OUT/collection.json    the manifest, written last

A recording is kept if its digest is the one that the plan, the machine and, in the closed loop, the
controller give; so a collection that was interrupted goes on where it stopped.  What was recorded from
another plan, seed or machine is never written over.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from learning.collection import excitation
from learning.collection.command import Pilot, Replay
from learning.collection.controller import FILE as CONTROLLER, find, known
from learning.collection.coverage import measure
from learning.collection.coverage_page import write_page
from learning.collection.machine import STEP_S, LockStep, Machine
from learning.collection.manifest import NAME as MANIFEST
from learning.collection.operator_model import Operator
from learning.collection.plan import SPLITS, Plan, Recording
from learning.collection.recorder import record
from learning.collection.slew_control import Gains, SlewControl
from records.record import Record, read
from specs.errors import InputError, nearest
from specs.progress import Report

PAGE = "coverage.html"


def collect(
    plan: Plan, out: Path, machine: str = "nominal", parts: Sequence[str] = (), report: Report | None = None
) -> dict[str, Any]:
    """Make the recordings of `plan` (only `parts`, if any are named) in the folder `out`.

    Returns the manifest.  Raises InputError for an unknown part or machine, or a folder that cannot be;
    RunError when the machine or the disk fails: what is recorded stays.
    """
    for part in parts:
        if part not in plan.parts:
            raise InputError(f"the plan has no part '{part}'; {nearest(part, plan.parts)}")
    where = LockStep(machine)
    _make_folder(out)
    chosen = [r for r in plan.recordings if not parts or r.part in parts]
    _check_owner(plan, chosen, where, out)
    chosen.sort(key=lambda r: r.kind == "closed_loop")  # it is tuned on what the others recorded
    controller: dict[str, Any] = {}
    for done, recording in enumerate(chosen):
        if recording.kind == "closed_loop" and not controller:
            controller = find(plan, out, report)
        if report:
            report(recording.part, done, len(chosen))
        _make(plan, recording, where, out, controller)
    manifest = _manifest(plan, machine, where, out)
    if report:
        report("coverage", len(chosen), len(chosen))
    coverage = measure(out, manifest["recordings"])
    manifest["coverage"] = coverage.figures
    write_page(out / PAGE, manifest, coverage)
    _write(out / MANIFEST, manifest)
    return manifest


def _check_owner(plan: Plan, chosen: Sequence[Recording], machine: Machine, out: Path) -> None:
    """Raise InputError where a file of the same name holds a recording of something else."""
    mine = {"collection": plan.name, "seed": plan.seed, "machine": machine.identity["machine"]}
    for recording in chosen:
        path = out / f"{recording.name}.parquet"
        if path.is_file():
            meta = _meta(path)
            theirs = {key: meta.get(key) for key in mine}
            if theirs != mine:
                said = ", ".join(f"{key} {value}" for key, value in theirs.items())
                raise InputError(f"{path} is a recording of {said}; choose another folder")


def _meta(path: Path) -> Mapping[str, Any]:
    try:
        return read(path).meta
    except InputError as error:
        raise InputError(f"{str(error).rstrip('.')}; remove it, and it is recorded again") from None


def _digest(plan: Plan, recording: Recording, machine: Machine, gains: Mapping[str, float] | None) -> str:
    used = gains if recording.kind == "closed_loop" else None
    return plan.digest(recording, {**machine.identity, "gains": used})


def _make(
    plan: Plan, recording: Recording, machine: Machine, out: Path, controller: Mapping[str, Any]
) -> None:
    path = out / f"{recording.name}.parquet"
    gains = controller["gains"] if recording.kind == "closed_loop" else None
    digest = _digest(plan, recording, machine, gains)
    if (found := _there(path, digest)) is not None and found.complete:
        return
    meta = {
        "origin": machine.label,
        "collection": plan.name,
        "digest": digest,
        "seed": plan.seed,
        "load_told_kg": recording.load_kg,
        **{key: value for key, value in asdict(recording).items() if key not in ("load_kg", "number")},
        **({"gains": gains} if gains else {}),
        **machine.identity,
    }
    record(machine, recording, pilot(plan, recording, gains), plan.limits, plan.seed, path, meta)


def pilot(plan: Plan, recording: Recording, gains: Mapping[str, float] | None = None) -> Pilot:
    """What moves the machine in a recording; `gains` are the closed loop's."""
    part = plan.parts[recording.part]
    if recording.kind == "driving":
        start = (0.0, recording.q_boom, recording.q_stick)
        return Operator(recording.draws(plan.seed, "operator"), plan.limits, start)
    if recording.kind == "closed_loop":
        return SlewControl(Gains.of(gains or {}), recording, plan.seed)
    if recording.kind == "replay":
        return Replay(excitation.stated(part, recording))
    return Replay(excitation.wanted(part, recording, plan.limits, plan.seed))


def _there(path: Path, digest: str) -> Record | None:
    """The recording with this digest, if it is there, complete or aborted."""
    try:
        found = read(path)
    except InputError:
        return None
    return found if found.meta.get("digest") == digest else None


def _manifest(plan: Plan, machine: str, where: Machine, out: Path) -> dict[str, Any]:
    controller = _controller(plan, out)
    gains = controller["gains"] if controller else None
    paths = [(r, out / f"{r.name}.parquet", _digest(plan, r, where, gains)) for r in plan.recordings]
    there = [(r, found) for r, path, digest in paths if (found := _there(path, digest)) is not None]
    entries = [_entry(r, found) for r, found in there]
    return {
        "collection": plan.name,
        "description": plan.description,
        "origin": where.label,
        "seed": plan.seed,
        "machine": machine,
        "minutes": {s: _minutes(entries, s) for s in SPLITS},
        "controller": controller,
        "aborted": [e["file"] for e in entries if e["aborted"]],
        "recordings": entries,
    }


def _controller(plan: Plan, out: Path) -> dict[str, Any] | None:
    """What controlled the closed loop, if the plan has one and it was found."""
    if not any(r.kind == "closed_loop" for r in plan.recordings):
        return None
    return find(plan, out) if plan.gains else known(out / CONTROLLER) or None


def _minutes(entries: Sequence[dict[str, Any]], split: str) -> float:
    return round(sum(e["seconds"] for e in entries if e["split"] == split) / 60.0, 6)


def _entry(recording: Recording, found: Record) -> dict[str, Any]:
    return {
        "file": f"{recording.name}.parquet",
        "part": recording.part,
        "kind": recording.kind,
        "split": recording.split,
        "seconds": round(len(found) * STEP_S, 3),
        "q_boom": recording.q_boom,
        "q_stick": recording.q_stick,
        "load_told": recording.load_kg,
        "clipped": found.meta.get("clipped", {}),
        "aborted": found.reason,
        "run_hash": found.run_hash,
    }


def _write(path: Path, content: dict[str, Any]) -> None:
    part = path.with_name(f".{path.name}.part")
    part.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    part.replace(path)


def _make_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"folder {path} cannot be made: {error.strerror}") from None
