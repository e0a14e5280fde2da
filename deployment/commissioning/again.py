"""Another controller on the motion of a commissioned machine: what commissioning would have said of it.

`calibration.json` names the trace in which the slew drive was measured.  A bundle that is built with it may
have another controller than the one that was commissioned; it is given the same sensors.
"""

import json
from pathlib import Path

import numpy as np

from baselines.margins.drive import Drive
from baselines.margins.experiment import experiment
from deployment.commissioning import answers, covered
from deployment.commissioning.rig import Trace
from records.record import Record, read
from runtime.bundle import Bundle
from runtime.image import INPUT, OUTPUT, Status
from specs.errors import InputError


def failures(bundle: Bundle, calibration: Path) -> list[str]:
    """A sentence for each limit that the bundle's controller does not keep on the machine of `calibration`.

    None where that machine's drive was not measured.  InputError for a file that is not what it should be.
    """
    data = json.loads(calibration.read_text(encoding="utf-8"))
    if not data.get("motion"):
        return []
    try:
        drive = Drive(*(float(data["drive"][name]) for name in ("dead_band", "gain", "delay_s")))
        sines = {float(hz): (int(first), int(rows)) for hz, (first, rows) in data["motion"]["sines"].items()}
        path = calibration.parent / str(data["motion"]["file"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{calibration}: drive and motion: {error}; commission the machine again") from None
    traces = _traces(read(path), sines)
    loops = answers.loops(bundle, traces, experiment().settle_s)
    return [
        f"machine of {calibration}: {limit}; {covered.look(bundle)}"
        for limit in covered.limits(bundle, loops, drive)
        if not limit.kept
    ]


def _traces(record: Record, sines: dict[float, tuple[int, int]]) -> dict[float, Trace]:
    inputs = np.column_stack([record.column(s.name) for s in INPUT.signals])
    outputs = np.column_stack([record.column(s.name) for s in OUTPUT.signals])
    status = np.where(np.isfinite(inputs), Status.OK, Status.ERROR).astype(np.uint8)
    whole = Trace(inputs, status, outputs)
    found = {hz: whole.part(first, first + rows) for hz, (first, rows) in sines.items()}
    if any(len(found[hz]) != rows for hz, (_, rows) in sines.items()) or not found:
        raise InputError(
            "the trace of the commissioning is shorter than its sines; commission the machine again"
        )
    return found
