"""The score of an answer against a sealed truth, exactly as the contract says.

exact: the named set is T.  ambiguous_ok: T in D, D within E(T), two to four members.  wrong: some name that
is in every member of D is in no member of E(T).  abstained: the rest.  Outside the catalogue: right when the
answer is `unexplained` or a free-form term closes 80 % of the gap.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from specs.errors import InputError

Result = Literal["exact", "ambiguous_ok", "wrong", "abstained", "right"]
CLOSED = 0.8  # of the gap, by a free-form term
MOST_DECLARED = 4


@dataclass(frozen=True)
class Truth:
    """A sealed truth: T, E(T) and whether the case holds an effect that is not in the catalogue."""

    visible: frozenset[str]
    equivalents: tuple[frozenset[str], ...]
    outside: bool
    content: Mapping[str, Any]


@dataclass(frozen=True)
class Score:
    """What an answer is worth; `false_positive`: it names effects where none is visible."""

    result: Result
    named: tuple[tuple[str, ...], ...]
    false_positive: bool
    unambiguous: bool  # |E(T)| = 1


def read_truth(path: Path, expected_sha256: str | None = None) -> Truth:
    """The truth of a file; InputError when it is not what its hash says, or not readable."""
    try:
        text = path.read_bytes()
        content = json.loads(text)
        sets = tuple(frozenset(names) for names in content["equivalents"])
        visible = frozenset(content["visible"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} is no sealed truth: {error}") from None
    if expected_sha256 is not None and hashlib.sha256(text).hexdigest() != expected_sha256:
        raise InputError(f"{path} is not the truth that was sealed: its SHA-256 is another one")
    return Truth(visible, sets, bool(content["outside"]), content)


def declared(report: Mapping[str, Any]) -> list[frozenset[str]]:
    """D: the sets of names that a report declares, its own answer included; empty when it names nothing."""
    if report.get("verdict") not in ("named", "ambiguous"):
        return []
    effects = report.get("effects", [])
    own = frozenset(e["name"] for e in effects)
    others = [frozenset(names) for names in report.get("alternatives", [])]
    if report["verdict"] == "ambiguous" or any(e.get("verdict") == "ambiguous" for e in effects):
        return list(dict.fromkeys([own, *others] if own else others))
    return [own] if own else []


def score(truth: Truth, report: Mapping[str, Any]) -> Score:
    """Score a report (report.json as the contract has it)."""
    found = declared(report)
    named = tuple(tuple(sorted(names)) for names in found)
    result = _outside(report, found) if truth.outside else _inside(truth, found)
    return Score(result, named, not truth.visible and bool(found), len(truth.equivalents) == 1)


def _inside(truth: Truth, found: Sequence[frozenset[str]]) -> Result:
    if not truth.visible and not found:
        return "exact"
    if len(found) == 1 and found[0] == truth.visible:
        return "exact"
    within = set(found) <= set(truth.equivalents)
    if truth.visible in found and within and 2 <= len(found) <= MOST_DECLARED:
        return "ambiguous_ok"
    common = frozenset.intersection(*found) if found else frozenset()
    possible = frozenset().union(*truth.equivalents)
    return "wrong" if common - possible else "abstained"


def _outside(report: Mapping[str, Any], found: Sequence[frozenset[str]]) -> Result:
    closed = max((float(t.get("gap_closed", 0.0)) for t in report.get("free_form", [])), default=0.0)
    if report.get("verdict") == "unexplained" or closed >= CLOSED:
        return "right"
    return "wrong" if found else "abstained"
