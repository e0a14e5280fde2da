"""Declared sets that E(T) lists only if its search tried them: fitted by the generator, before the score."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from blindtest.case import Case
from blindtest.equivalents import EQUIVALENT
from blindtest.membership import least
from blindtest.score import MOST_DECLARED, Truth, declared, score

CHECKED = "declared.json"  # names -> lambda, beside the truth


def completed(truth: Truth, report: Mapping[str, Any], sealed: Path, drawn: Callable[[], Case]) -> Truth:
    """The truth with those declared sets in E(T) that are found to be; `drawn` draws the case again.

    Only sets that the score hangs on are fitted.  A case that is not drawn as it was sealed (by a generator
    that was changed since) stays as it is.
    """
    path = sealed / CHECKED
    known: dict[str, float] = json.loads(path.read_text()) if path.is_file() else {}
    asked = _asked(truth, report)
    new = [names for names in asked if _key(names) not in known]
    if new:
        case = drawn()
        if not _is_drawn(case, truth):
            return truth
        known |= {_key(names): min(least(case, names), 1e9) for names in new}
        path.write_text(json.dumps(known, indent=1) + "\n")
    more = tuple(names for names in asked if known[_key(names)] < EQUIVALENT)
    return replace(truth, equivalents=(*truth.equivalents, *more))


def _asked(truth: Truth, report: Mapping[str, Any]) -> list[frozenset[str]]:
    """Declared sets outside the known E(T), where one of them could change the score."""
    found = declared(report)
    if truth.outside or not truth.visible or not found:
        return []
    open_ = truth.visible in found and 2 <= len(found) <= MOST_DECLARED
    if not open_ and score(truth, report).result != "wrong":
        return []
    return [names for names in found if names not in truth.equivalents]


def _is_drawn(case: Case, truth: Truth) -> bool:
    drawn = {p.effect.name: p.parameters(case.scale) for p in case.placed}
    sealed = {p["name"]: p["parameters"] for p in truth.content["placed"]}
    return drawn.keys() == sealed.keys() and all(
        math.isclose(drawn[n][k], v, rel_tol=1e-6) for n, values in sealed.items() for k, v in values.items()
    )


def _key(names: frozenset[str]) -> str:
    return " + ".join(sorted(names))
