"""What the controller would have done against what the operator did, and where the gate stepped in."""

from typing import Any

import numpy as np

from deployment.shadow.recorded import Shadowed
from runtime.control import AXES, REASONS
from runtime.image import INPUT, TICK_S
from specs.signals import signal

AUTOMATIC = "automatic"
NEUTRAL = 0.05  # joystick: what is smaller has no sign worth comparing
ARM_STILL = 0.01  # rad/s, the same of arm speeds
SPEEDS = {"qd_boom_ref": "qd_boom", "qd_stick_ref": "qd_stick"}


def named(name: str) -> dict[int, str]:
    """Texts of a signal's numbers."""
    return {int(number): text for number, text in signal(name).values.items()}


def in_mode(found: Shadowed, text: str) -> np.ndarray:
    """Where the core was in a mode [n]."""
    return found.mode == {t: n for n, t in named("control_mode").items()}[text]


def commands(found: Shadowed) -> dict[str, dict[str, Any]]:
    """By signal, over the ticks in automatic operation: RMS, RMS of the difference, and agreement of sign."""
    automatic = in_mode(found, AUTOMATIC)
    pairs = {n: (found.passed[:, i], found.operator[:, i], "1", NEUTRAL) for i, n in enumerate(AXES)}
    for asked, driven in SPEEDS.items():
        pairs[asked] = (found.output(asked), found.input(driven), "rad/s", ARM_STILL)
    return {name: _compared(*pair, automatic) for name, pair in pairs.items()}


def _compared(ours: np.ndarray, theirs: np.ndarray, unit: str, least: float, where: np.ndarray):
    good = where & np.isfinite(ours) & np.isfinite(theirs)
    a, b = ours[good], theirs[good]
    both = (np.abs(a) > least) & (np.abs(b) > least)
    return {
        "unit": unit,
        "seconds": float(good.sum() * TICK_S),
        "rms_controller": _rms(a),
        "rms_operator": _rms(b),
        "rms_difference": _rms(a - b),
        "both_move_share": _share(both),
        "same_sign_share": _share(a[both] * b[both] > 0.0),
        "only_controller_share": _share((np.abs(a) > least) & (np.abs(b) <= least)),
        "only_operator_share": _share((np.abs(b) > least) & (np.abs(a) <= least)),
    }


def modes(found: Shadowed) -> dict[str, float]:
    """Seconds in each mode that was taken."""
    return {
        text: float(s) for n, text in named("control_mode").items() if (s := TICK_S * np.sum(found.mode == n))
    }


def faults(found: Shadowed) -> list[dict[str, Any]]:
    """What would have stopped the controller: code, signal, how often and how long."""
    code, about = found.output("fault_code"), found.output("fault_signal")
    known, by_vr = named("fault_code"), {s.vr: s.name for s in INPUT.signals}
    rows = []
    for c, vr in sorted({(int(c), int(v)) for c, v in zip(code, about, strict=True) if c == c and v == v}):
        if c:
            here = (code == c) & (about == vr)
            row = {"fault": known.get(c, str(c)), "signal": by_vr.get(vr, ""), "times": _times(here)}
            rows.append({**row, "seconds": float(TICK_S * here.sum())})
    return rows


def gate(found: Shadowed) -> dict[str, Any]:
    """How often the gate would have stepped in, by axis and reason; of what the controller wanted."""
    told = in_mode(found, AUTOMATIC) & (found.why[:, 0] >= 0)
    total = max(int(told.sum()), 1)
    axes = {}
    for axis, name in enumerate(AXES):
        changed = told & (found.why[:, axis] > 0)
        by_reason = {r: told & (found.why[:, axis] >> bit & 1 > 0) for bit, r in enumerate(REASONS)}
        taken = np.abs(found.wanted[:, axis] - found.passed[:, axis])[changed]
        axes[name] = {
            "share": float(changed.sum() / total),
            "times": _times(changed),
            "largest_change": float(taken.max()) if taken.size else 0.0,
            "reasons": {
                r: {"share": float(w.sum() / total), "seconds": float(TICK_S * w.sum()), "times": _times(w)}
                for r, w in by_reason.items()
                if w.any()
            },
        }
    some = told & (found.why > 0).any(axis=1)
    beyond_rate = told & ((found.why > 0) & (found.why != 1 << REASONS.index("rate"))).any(axis=1)
    return {
        "seconds": float(TICK_S * told.sum()),
        "share": float(some.sum() / total),
        "share_without_rate": float(beyond_rate.sum() / total),
        "axes": axes,
    }


def _times(where: np.ndarray) -> int:
    """How often it begins."""
    return int(np.sum(np.diff(np.concatenate([[0], where.astype(np.int8)])) > 0))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def _share(where: np.ndarray) -> float:
    return float(np.mean(where)) if where.size else float("nan")
