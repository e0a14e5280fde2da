"""What `slewright calibrate lut` prints: tables with intervals, what is to be known of them, tracking."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from baselines.arm_velocity.lut import GRID, Table
from baselines.arm_velocity.session import Outcome

Shown = tuple[str, Sequence[str], Sequence[Sequence[str]], Sequence[str]]


def tables(outcome: Outcome, figures: Mapping[str, Any]) -> Iterator[Shown]:
    """Title, columns, rows and notes: each joint's table, then the tracking errors."""
    for table in outcome.tables.values():
        columns = (GRID, table.command, table.low, table.high, table.error)
        rows = [
            (f"{v:+.4f}", f"{command:+.4f}", f"{low:+.4f} … {high:+.4f}", f"{error:.4f}")
            for v, command, low, high, error in zip(*columns, strict=True)
        ]
        title = f"{table.joint}: {len(table.segments)} steady segments, {table.unsteady} unsteady left out"
        yield title, ["velocity rad/s", "joystick", "95 %", "standard error"], rows, list(_notes(table))
    rows = [
        (joint, name, f"{entry[name]['rms_ff']:.4f}", f"{entry[name]['rms_ff_pi']:.4f}")
        for joint, entry in figures["joints"].items()
        for name in ("before", "after")
        if name in entry
    ]
    if rows:
        title = f"RMS error at steady speed, rad/s: {outcome.origin}"
        yield title, ["joint", "tables", "feed-forward alone", "with PI"], rows, ()


def _notes(table: Table) -> Iterator[str]:
    for way, band in table.dead_band.items():
        yield (
            f"{table.joint} {way}: dead band {band.value:.3f} ({band.low:.3f} … {band.high:.3f}); "
            f"pose and load move the speed by {table.spread[way]:.1%}"
        )
    for point in table.lacking:
        yield f"{table.joint} {point.velocity:+.4f} rad/s lacks data, {point.why}: {point.drive}"
    for speed in table.out_of_reach:
        yield f"{table.joint} {speed:+.4f} rad/s is not reached at full joystick"
    yield from table.notes
