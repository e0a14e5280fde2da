"""What keeps the machine from its next mode, in words: STANDBY, ARMED, AUTOMATIC, what each lacks.

The core itself says which of its conditions hold (`slr_ladder` in runtime/core/mode.c): nothing of the state
machine is stated here again.
"""

from dataclasses import dataclass
from typing import Any

from runtime.hmi.alarms import BY_VR, FAULT_TEXTS, FAULTS, MODE_TEXTS
from runtime.hmi.cells import LADDER

ORDER = {
    "off": 0,
    "standby": 1,
    "fault": 1,
    "stopping": 1,
    "armed": 2,
    "manual": 2,
    "automatic": 3,
    "hold": 3,
}
ANEW = "let go of the enabling switch, then press it anew"


@dataclass(frozen=True)
class Conditions:
    """What the core said (cells.LADDER)."""

    found: dict[str, int]

    def cause(self, of: str) -> list[str]:
        """Why `stops` or `bars` (automatic operation) is there; nothing if it is not."""
        code, vr = self.found[of], self.found[f"{of}_signal"]
        if not code:
            return []
        name = FAULT_TEXTS.get(code, str(code))
        about = BY_VR.get(vr)
        return [FAULTS.get(name, name) + (f" ({about.name})" if about else "")]


def ladder(told: Any, mode: int) -> list[dict[str, Any]]:
    """The rungs, each with whether it is reached and what it lacks; empty where the core did not say."""
    found = {name: int(told[name]) for name in LADDER.names or ()}
    if not found["known"]:
        return []
    conditions, text = Conditions(found), MODE_TEXTS.get(mode, "")
    reached = ORDER.get(text, 0)
    lacks = [_standby(conditions, text), _armed(conditions, text), _automatic(conditions)]
    names = ("STANDBY", "ARMED", "AUTOMATIC")
    return [
        {"to": name, "reached": reached > i, "missing": [] if reached > i else missing}
        for i, (name, missing) in enumerate(zip(names, lacks, strict=True))
    ]


def _standby(of: Conditions, mode: str) -> list[str]:
    return of.cause("stops") if mode == "off" else []


def _armed(of: Conditions, mode: str) -> list[str]:
    missing = of.cause("stops")
    if mode == "stopping":
        return [*missing, "commands still on their way to neutral"]
    if mode == "fault":
        missing = ["a fault is latched: acknowledge it with the enabling switch", *missing]
        missing += ["joystick at rest"] * of.found["deflected"]
        missing += ["commands neutral"] * (not of.found["neutral"])
    return [*missing, ANEW if of.found["enabled"] else "press the enabling switch"]


def _automatic(of: Conditions) -> list[str]:
    missing = of.cause("bars")
    missing += ["joystick at rest"] * of.found["deflected"]
    missing += ["the machine allows automatic operation"] * (not of.found["allowed"])
    turn = (
        "turn the automatic switch off and on again" if of.found["asked"] else "turn the automatic switch on"
    )
    missing.append(turn)
    return missing + ["a target in reach (else HOLD)"] * (not of.found["target"])
