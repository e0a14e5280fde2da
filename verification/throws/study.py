"""Throws over distances and machines: landing errors, cycle times, and which limits they miss."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from baselines.throwing.plan import inside, reach, span
from specs.errors import InputError
from specs.progress import Report
from verification.throws.practice import practised
from verification.throws.run import Case, run

Row = dict[str, Any]
MEDIAN_M, P95_M = 0.5, 1.0  # limits of the landing error


def check(beyond: Sequence[float]) -> None:
    """Raise InputError for a distance to which no throw goes."""
    low, high = (end - reach() for end in span())
    for distance in beyond:
        if not low <= distance <= high:
            raise InputError(
                f"no throw lands {distance:g} m beyond reach ({reach():.2f} m); "
                f"valid: {inside((low, high))} m"
            )


def study(
    beyond: Sequence[float],
    machines: Mapping[str, Mapping[str, float]],
    seed: int,
    report: Report,
    practice: int = 0,
) -> dict[str, Any]:
    """The figures of each distance, every row, and `failures`: sentences about the limits that are missed.

    After an interrupt those of the throws that were done, and `interrupted`.  `practice`: throws of each
    machine before, whose landings tell the delay of its grab; their rows are `practised`.
    """
    cases = [Case(distance, name, drawn, seed) for name, drawn in machines.items() for distance in beyond]
    rows, before = _done(cases, report, practice)
    thrown = {f"{d:g}": [row for row in rows if row["beyond"] == d] for d in beyond}
    by_distance = {distance: summary(of) for distance, of in thrown.items() if of}
    return {
        "reach": reach(), "by_distance_m": by_distance, "failures": failures(by_distance),
        "interrupted": len(rows) < len(cases), "rows": rows, "practice": practice, "practised": before,
    }  # fmt: skip


def _done(cases: Sequence[Case], report: Report, practice: int) -> tuple[list[Row], list[Row]]:
    """Rows of the throws, and of those for practice before."""
    rows: list[Row] = []
    before: dict[str, dict[str, Any]] = {}
    try:
        for number, case in enumerate(cases, 1):
            if practice and case.machine not in before:
                before[case.machine] = practised(case.machine, case.drawn, case.seed, practice)
            told = {"told_s": before[case.machine]["told_s"]} if practice else {}
            rows.append(run(replace(case, **told)))
            report(f"throw {case.beyond:g} m beyond reach by {case.machine}", number, len(cases))
    except KeyboardInterrupt:
        if not rows:
            raise
    return rows, [row for machine in before.values() for row in machine["rows"]]


def summary(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The figures of throws over one distance."""
    landed = [row for row in rows if row["released"]]
    found: dict[str, Any] = {"throws": len(rows), "landed": len(landed)}
    if not landed:
        return found
    known = {name: np.array([row[name] for row in landed]) for name in landed[0] if name != "machine"}
    return {
        **found,
        "error_median": float(np.median(known["error"])),
        "error_p95": float(np.quantile(known["error"], 0.95)),
        "error_max": float(known["error"].max()),
        "error_delay_known_median": float(np.median(known["error_delay_known"])),
        "error_delay_known_p95": float(np.quantile(known["error_delay_known"], 0.95)),
        **{f"{name}_mean": float(known[name].mean()) for name in ("out", "aside", "speed", "cycle")},
    }


def failures(by_distance: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """What is missed."""
    missed = []
    for distance, f in by_distance.items():
        where = f"{distance} m beyond reach"
        if f["landed"] < f["throws"]:
            missed.append(f"{where}: {f['throws'] - f['landed']} of {f['throws']} loads were never let go")
        for name, limit in (("median", MEDIAN_M), ("p95", P95_M)):
            found = f.get(f"error_{name}", 0.0)
            if found > limit:
                missed.append(f"{where}: landing error {found:.2f} m ({name}), limit {limit:g} m")
    return missed
