"""What an answer is given and how it is scored; files written whole."""

import functools
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import reconcile
from blindtest.score import Truth, score

FAILED = {"verdict": "failed", "effects": [], "alternatives": [], "gap": {}}


def model(told: str) -> str:
    """What --model is given: the folder beside the recordings, or the name of a model of the project."""
    return told if told == "model" else Path(told).stem


@functools.cache
def code() -> str:
    """What answers: the first digits of the SHA-256 of reconcile's sources."""
    root = Path(reconcile.__file__).parent
    files = sorted(p for p in root.rglob("*") if p.suffix in (".py", ".c"))
    whole = b"".join(p.relative_to(root).as_posix().encode() + p.read_bytes() for p in files)
    return hashlib.sha256(whole).hexdigest()[:12]


def scored(truth: Truth, report: Mapping[str, Any]) -> dict[str, Any]:
    """The contract's score of an answer; a workflow that failed abstains."""
    found = score(truth, report)
    return {
        "verdict": report["verdict"],
        "workflow_failed": report.get("failed", ""),
        "seconds": report["core_seconds"],
        "code": report.get("code", ""),
        "result": "abstained" if report["verdict"] == "failed" else found.result,
        "named": [list(names) for names in found.named],
        "false_positive": found.false_positive,
        "unambiguous": found.unambiguous,
    }


def write(path: Path, content: Mapping[str, Any]) -> None:
    """Write JSON whole or not at all."""
    part = path.with_name(path.name + ".part")
    part.parent.mkdir(parents=True, exist_ok=True)
    part.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    part.replace(path)
