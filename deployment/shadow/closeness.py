"""How close the reference machine is to the recorded one: the operator's commands on the reference.

The recording is cut where the machine stands still with the joysticks at rest.  In each piece the reference
machine starts in the recorded pose, tool hanging, and is given the operator's commands and nothing else: no
estimate corrects it.  Its sensors are compared with the recorded ones.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from deployment.hil.machine import COMMANDS, Machine
from deployment.shadow.agreement import NEUTRAL
from deployment.shadow.recorded import Report, Shadowed
from deployment.shadow.sway import still
from records.scores import scores
from runtime.image import TICK_S
from specs import draws
from specs.errors import InputError
from specs.signals import signal

REST_S = 0.5  # of stillness before a piece
SHORTEST_S, LONGEST_S = 3.0, 30.0  # of a piece; what goes on is cut there
SEED = 1009  # of the reference machine's sensor noise: no recording has it
TOOL_STILL_RAD_S = 0.15  # the reference's tool hangs at the start: signals of one that swings are left out
JOINTS = tuple(f"{kind}_{joint}" for joint in ("slew", "boom", "stick") for kind in ("q", "qd"))
PRESSURES = tuple(f"p_{joint}_{side}" for joint in ("slew", "boom", "stick") for side in "ab")
TOOL = ("imu_tool_roll", "imu_tool_pitch", "imu_tool_rate_x", "imu_tool_rate_y")
SIGNALS = (*JOINTS, *PRESSURES, "p_pump", "imu_cabin_rate_z", *TOOL)
MOVES = tuple(f"qd_{joint}" for joint in ("slew", "boom", "stick"))
STAGE = "reference"


@dataclass(frozen=True)
class Pose:
    """How the reference machine starts: what a scenario would say of it."""

    slew: float
    boom: float
    stick: float
    load: float

    def parameters(self, seed: int) -> dict[str, float]:
        """Start pose [rad] and load [kg]."""
        start = {"start_q_slew": self.slew, "start_q_boom": self.boom, "start_q_stick": self.stick}
        return {**start, "load_mass": self.load}


@dataclass(frozen=True)
class Piece:
    """Rows of the recording, and what the reference machine's sensors show in them [n] by name."""

    rows: slice
    predicted: dict[str, np.ndarray]
    tool: bool  # its tool hung still at the start


def compare(
    found: Shadowed, load: float | None = None, which: str = draws.NOMINAL, report: Report = lambda *_: None
) -> tuple[dict[str, Any], list[Piece]]:
    """Figures by signal, and the pieces; `load` [kg] in the grab (default: as estimated, else as told)."""
    kg = _load(found) if load is None else load
    pieces = []
    for number, rows in enumerate(spans := _spans(found)):
        report("the reference machine, piece", number, len(spans))
        pieces.append(_driven(found, rows, kg, which))
    by_signal = {name: _scored(found, pieces, name) for name in SIGNALS}
    by_signal = {name: s for name, s in by_signal.items() if s is not None}
    seconds = sum(p.rows.stop - p.rows.start for p in pieces) * TICK_S
    fits = [by_signal[n]["fit_percent"] for n in MOVES if n in by_signal]
    figures = {
        "machine": which,
        "load_kg": kg,
        "pieces": len(pieces),
        "seconds": float(seconds),
        "fit_percent": float(np.mean(fits)) if fits else float("nan"),
        "signals": by_signal,
    }
    return figures, pieces


def _load(found: Shadowed) -> float:
    for values in (found.output("load_estimate"), found.input("load_told")):
        if np.isfinite(values).any():
            return float(np.nanmedian(values))
    return 0.0


def _spans(found: Shadowed) -> list[slice]:
    """From one rest to the next, with motion in between; no gap inside."""
    calm = np.all(np.abs(found.operator) <= NEUTRAL, axis=1)  # not so where it is not known
    starts = [rest.stop - 1 for rest in still(found, REST_S, calm)]
    spans = []
    for first, end in zip(starts, [*starts[1:], len(found)], strict=True):
        last = min(end, first + round(LONGEST_S / TICK_S))
        gaps = np.flatnonzero(np.diff(found.tick[first:last]) != 1)
        last = first + int(gaps[0]) if gaps.size else last
        operator = found.operator[first:last]
        driven = np.isfinite(operator).all() and np.abs(operator).max(initial=0.0) > NEUTRAL
        if driven and _posed(found, first) and (last - first) * TICK_S >= SHORTEST_S:
            spans.append(slice(first, last))
    return spans


def _posed(found: Shadowed, row: int) -> bool:
    return bool(np.isfinite([found.input(f"q_{j}")[row] for j in ("slew", "boom", "stick")]).all())


def _driven(found: Shadowed, rows: slice, load: float, which: str) -> Piece:
    q = [float(found.input(f"q_{j}")[rows.start]) for j in ("slew", "boom", "stick")]
    shown = []
    with Machine(Pose(q[0], q[1], q[2], load), SEED, which) as machine:
        for commands in found.operator[rows]:
            shown.append(machine.values)
            machine.advance(dict(zip(COMMANDS, np.clip(commands, -1.0, 1.0).tolist(), strict=True)))
        table = np.array(shown)
        predicted = {n: table[:, machine.names.index(n)] for n in SIGNALS if n in machine.names}
    begin = slice(max(rows.start - round(REST_S / TICK_S), 0), rows.start + 1)
    swing = [np.abs(found.input(f"imu_tool_rate_{a}")[begin]).max() for a in "xy"]
    return Piece(rows, predicted, bool(max(swing) < TOOL_STILL_RAD_S))


def _scored(found: Shadowed, pieces: list[Piece], name: str) -> dict[str, Any] | None:
    """RMSE, FIT and rating of a signal; None where it was not recorded."""
    pairs: list[tuple[np.ndarray, np.ndarray]] = []
    for piece in pieces:
        measured = found.input(name)[piece.rows]
        good = np.isfinite(measured)
        if good.any() and (piece.tool or name not in TOOL):
            pairs.append((measured[good], piece.predicted[name][good]))
    if not pairs:
        return None
    told = scores({STAGE: pairs}, signal(name).unit)
    moved = max(float(np.ptp(measured)) for measured, _ in pairs)
    figures = {k: told[k][STAGE] for k in ("rmse", "fit_percent", "iso18571")}
    return {"unit": told["unit"], **figures, "moved": moved}


def check_machine(which: str) -> None:
    """InputError for a machine that there is not."""
    try:
        draws.named(which)
    except InputError as error:
        raise InputError(f"--machine: {error}") from None
