"""What commissioning measured, in one file: `calibration.json` in the session's folder.

It is never applied by itself: `slewright bundle … --commissioning FILE` builds a bundle with it.
"""

import json
from typing import Any

from deployment.commissioning.session import Session
from specs.version import VERSION

FILE = "calibration.json"
FORMAT = 1
FILES = {"arm_tables": "arm-tables.toml", "load_calibration": "load-calibration.json"}
DRIVE = ("dead_band", "gain", "delay_s", "gain margin", "delay margin")  # of step margins
STEP_OF = {"arm_tables": "tables", "load_calibration": "tare"}


def write(session: Session) -> None:
    """Write what the steps that passed have found so far."""
    found = session.findings()
    content: dict[str, Any] = {
        "commissioning": FORMAT,
        "slewright": VERSION,
        **session.identity,
        "steps": {step: session.passed(step) for step in session.steps},
        "zeros": _named(found.get("rest", {}), "zero "),
        "breakaway": {axis: _named(found.get(axis, {}), "breakaway ") for axis in ("slew", "boom", "stick")},
        "dead_bands": _named(found.get("tables", {}), "dead band of the "),
        "tool": found.get("sway", {}),
        "drive": {name: v for name, v in found.get("margins", {}).items() if name in DRIVE},
        "motion": _motion(session, found.get("margins", {})),
        "geometry": found.get("touch", {}),
        "files": {kind: name for kind, name in FILES.items() if session.passed(STEP_OF[kind])},
    }
    session.put(FILE, json.dumps(content, indent=2) + "\n")


def _motion(session: Session, found: dict[str, Any]) -> dict[str, Any]:
    """The trace in which the drive was measured, and where its sines are: first row and rows by frequency."""
    return {"file": session.path("margins", ".parquet").name, "sines": found["sines"]} if found else {}


def _named(found: dict[str, Any], start: str) -> dict[str, Any]:
    return {n.removeprefix(start): v for n, v in found.items() if n.startswith(start)}
