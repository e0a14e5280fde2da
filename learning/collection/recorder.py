"""Makes one recording: pilot, supervisor, machine, in this order, every 0.1 s."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from learning.collection.command import NEUTRAL, Pilot
from learning.collection.machine import RECORDED, STEP_S, Machine
from learning.collection.plan import PERIOD_S, Limits, Recording
from learning.collection.supervisor import State, supervise
from records.recording import RecordWriter

SETTLE_S = 5.0  # that an aborted recording goes on in neutral: the machine comes to rest
COLUMNS = ("time", *RECORDED, "load_told")
FIRST = 1  # column of the first of RECORDED


@dataclass(frozen=True)
class Made:
    """What came of a recording: `clipped` counts periods by reason, `aborted` is empty if it went well."""

    clipped: Mapping[str, int]
    aborted: str
    seconds: float


def record(
    machine: Machine, recording: Recording, pilot: Pilot, limits: Limits, seed: int, path: Path, meta: Any
) -> Made:
    """Run `recording` and write it to `path`; interrupted or failed it stays there, marked incomplete.

    An aborted one is marked incomplete too, with the reason; it ends SETTLE_S later.
    """
    noise = recording.draws(seed, "noise").seed()
    state, clipped = State(), Counter[str]()
    writer = RecordWriter(path, COLUMNS, meta)
    with (
        writer,
        machine.at(recording.q_boom, recording.q_stick, recording.load_kg, noise) as run,
    ):
        seen: dict[str, float] = {}
        end = recording.periods
        for period in range(recording.periods):
            command = NEUTRAL  # until something has been seen
            if seen:
                command, state = supervise(pilot(period, seen), seen, 0.0, state, limits)
            clipped.update(state.clipped)
            if state.aborted:
                end = min(end, period + round(SETTLE_S / PERIOD_S))
            rows = run.advance(command)
            writer.append(np.column_stack([rows, np.full(len(rows), recording.load_kg)]))
            seen = dict(zip(RECORDED, rows[-1, FIRST:].tolist(), strict=True))
            if period >= end:
                break
        more = {"clipped": dict(sorted(clipped.items()))}
        reason = f"aborted: {state.aborted}" if state.aborted else ""
        writer.close(not state.aborted, reason, more)
    return Made(dict(clipped), state.aborted, writer.rows * STEP_S)
