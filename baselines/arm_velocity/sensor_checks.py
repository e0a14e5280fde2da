"""What recordings must show before a table is made: channels, motion, sensors inside their range."""

from collections.abc import Sequence

import numpy as np

from records.measurement import Channel, Measurement
from specs.errors import InputError

RAIL_S = 0.5  # that a channel stands on its highest or lowest value to the last digit
SAME = 1e-6  # joystick: less than this is no change at all
MOST = 1.02  # joystick: beyond it is no share of the full joystick


def channels(recordings: Sequence[Measurement], joints: Sequence[str]) -> dict[str, list[Measurement]]:
    """For each of `joints` the recordings that have its joystick and angle.

    Raises InputError when there is none for a joint, naming what is missing and what can be calibrated.
    """
    usable = {j: [r for r in recordings if not r.missing(needed(j))] for j in joints}
    for joint, having in usable.items():
        if having:
            continue
        absent = "; ".join(
            f"{r.source} has no {' and no '.join(r.missing(needed(joint)))}" for r in recordings
        )
        others = [j for j, some in usable.items() if some]
        can = f"the {others[0]} can: --joint {others[0]}" if others else "no joint can"
        raise InputError(f"the {joint} cannot be calibrated, {can}; {absent}")
    return usable


def needed(joint: str) -> list[str]:
    """Channels without which nothing can be said of a joint."""
    return [f"u_{joint}", f"q_{joint}"]


def excitation(recordings: Sequence[Measurement], joint: str) -> None:
    """InputError for a joystick of one value throughout or beyond ±1, and for sensors that are cut off."""
    values = np.concatenate([r[f"u_{joint}"].values for r in recordings])
    if np.ptp(values) <= SAME:
        names = ", ".join(r.source for r in recordings)
        raise InputError(
            f"{names}: u_{joint} is {values[0]:.3g} throughout, constant excitation; "
            "hold several levels, both ways (docs/how-to/calibration.md)"
        )
    for recording in recordings:
        _share(recording, recording[f"u_{joint}"])
        for name in (f"q_{joint}", f"p_{joint}_a", f"p_{joint}_b"):
            if name in recording:
                _inside(recording, recording[name], recording[f"u_{joint}"])


def motion(
    recordings: Sequence[Measurement], joint: str, command: np.ndarray, speed: np.ndarray, still: float
) -> None:
    """InputError when no segment is long enough, or none moves: commands [n], speeds [n] in rad/s."""
    names = ", ".join(r.source for r in recordings)
    if not len(command):
        raise InputError(
            f"{names}: u_{joint} is never held long enough with q_{joint} steady; hold each level for 3 s"
        )
    if not np.any(np.abs(speed) > still):
        raise InputError(
            f"{names}: the joystick never leaves the dead band: u_{joint} is held at {command.min():.3g} … "
            f"{command.max():.3g}, q_{joint} never goes faster than {np.abs(speed).max():.2g} rad/s; "
            "hold larger levels"
        )


def _share(recording: Measurement, joystick: Channel) -> None:
    """InputError when a joystick goes beyond -1 … 1."""
    at = int(np.argmax(np.abs(joystick.values)))
    if abs(joystick.values[at]) > MOST:
        raise InputError(
            f"{recording.source}: {joystick.name} is {joystick.values[at]:.3g} at {joystick.time[at]:.2f} s; "
            "valid is -1 … 1. If it is in %, say so: slewright convert --map (docs/reference/recordings.md)"
        )


def _inside(recording: Measurement, channel: Channel, joystick: Channel) -> None:
    """InputError when a channel stands at the end of its range while the joystick is out of neutral."""
    for place, rail in _rails(channel):
        at = np.abs(channel.values - rail) <= 1e-9 * max(1.0, abs(rail))
        held = np.searchsorted(joystick.time, channel.time, side="right") - 1
        driven = np.abs(joystick.values[np.maximum(held, 0)]) > 0.3
        run = _longest(at & driven)
        if run and channel.time[run.stop - 1] - channel.time[run.start] >= RAIL_S:
            first, last = channel.time[run.start], channel.time[run.stop - 1]
            raise InputError(
                f"{recording.source}: {channel.name} stands at its {place} {rail:.6g} {channel.unit} "
                f"from {first:.2f} to {last:.2f} s while {joystick.name} drives: a saturated sensor, "
                "or a joint at its stop; cut this out or record again"
            )


def _rails(channel: Channel) -> list[tuple[str, float]]:
    """Values at which a channel may have been cut off: its highest and lowest."""
    own = [("highest value", float(channel.values.max())), ("lowest value", float(channel.values.min()))]
    return own[: 1 if channel.name.startswith("p_") else 2]  # pressures rest at the tank's


def _longest(good: np.ndarray) -> slice | None:
    """The longest stretch in which `good` holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(np.int8), [0]]))).reshape(-1, 2)
    if not len(edges):
        return None
    begin, end = edges[np.argmax(edges[:, 1] - edges[:, 0])]
    return slice(int(begin), int(end))
