"""The form of report.json, checked: fields, units, intervals, and what the verdicts promise about them.

Keys beyond these may be there.  A number that could not be measured (the model runs away) is null.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

Verdict = Literal["named", "ambiguous", "agrees", "reestimated", "insufficient_excitation", "unexplained"]
Place = Literal["input", "hydraulic", "force", "inertia", "coupling", "output"]
MOST_DECLARED = 4


class _Form(BaseModel):
    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False)


Number = float | int | None
Probability = Annotated[float | int, Field(ge=0.0, le=1.0)]


class Value(_Form):
    """A fitted parameter with its 95 % interval."""

    value: float | int
    unit: str
    ci95: list[Number] = Field(min_length=2, max_length=2)


class Effect(_Form):
    """An effect that was found."""

    name: str
    place: Place
    subsystem: str
    port: str
    verdict: Literal["named", "ambiguous"]
    equation: str = Field(min_length=1)
    probability: float | int = Field(default=1.0, ge=0.0, le=1.0)
    parameters: dict[str, Value]
    gain_fit: Number
    gain_confirm: Number


class Moved(_Form):
    """A parameter of the model with another value."""

    old: float | int
    new: float | int
    unit: str
    ci95: list[Number] = Field(min_length=2, max_length=2)


class Where(_Form):
    """A regime in which the disagreement gathers."""

    signal: str
    subsystem: str
    regime: str = Field(min_length=1)
    share: float | int = Field(ge=0.0, le=1.0)


class Gap(_Form):
    """Error above the floor of one signal on the held-out part."""

    unit: str
    horizon_s: float | int = Field(ge=0.0)
    floor: float | int = Field(ge=0.0)
    floor_source: str = Field(min_length=1)
    nominal: Number
    reestimated: Number
    after: Number
    run: Literal["holdout"]


class Rating(_Form):
    """ISO/TS 18571, mean over the signals."""

    before: Number
    after: Number


class Report(_Form):
    """report.json."""

    verdict: Verdict
    sentence: str = Field(min_length=1)
    effects: list[Effect]
    residual_status: Literal["at_floor", "unexplained"]
    alternatives: list[list[str]]
    probability: dict[str, Probability] = Field(default_factory=dict)  # by effect; of a model folder
    kinds: dict[str, Probability] = Field(default_factory=dict)
    tolerances: dict[str, Any] = Field(default_factory=dict)
    search: dict[str, bool | int] = Field(default_factory=dict)
    reestimated: dict[str, Moved]
    nuisances: dict[str, dict[str, Any]]
    where: list[Where]
    gap: dict[str, Gap] = Field(min_length=1)
    iso18571: Rating
    next_experiment: dict[str, Any] | None
    seed: int
    versions: dict[str, str]
    elapsed_s: float | int = Field(ge=0.0)


def check(report: Mapping[str, Any]) -> list[str]:
    """What of a report is not in the contract's form, one line each; nothing if all is.

    `report` is the content of report.json as `json` reads it.
    """
    try:
        Report.model_validate(dict(report))
    except ValidationError as error:
        return [f"{'.'.join(map(str, e['loc'])) or 'report'}: {e['msg']}" for e in error.errors()]
    return [*_verdict(report), *_alternatives(report), *_intervals(report), *_gaps(report)]


def _verdict(report: Mapping[str, Any]) -> list[str]:
    verdict, effects = report["verdict"], report["effects"]
    found = []
    if verdict in ("named", "ambiguous") and not effects:
        found.append(f"verdict: {verdict} without an effect")
    if verdict not in ("named", "ambiguous") and effects:
        found.append(f"verdict: {verdict} with effects")
    simulated = any(g["nominal"] is not None for g in report["gap"].values())
    if verdict == "reestimated" and simulated and not report["reestimated"]:
        found.append("reestimated: empty, but that is the verdict")
    if verdict == "unexplained" and report["residual_status"] != "unexplained":
        found.append("residual_status: the verdict is unexplained")
    return found


def _alternatives(report: Mapping[str, Any]) -> list[str]:
    declared, names = report["alternatives"], sorted(e["name"] for e in report["effects"])
    found = []
    if names and names not in [sorted(s) for s in declared]:
        found.append("alternatives: the answer itself is not among them")
    if report["verdict"] == "ambiguous" and not 2 <= len(declared) <= MOST_DECLARED:
        found.append(f"alternatives: {len(declared)} sets; ambiguous needs 2 to {MOST_DECLARED}")
    if len({tuple(sorted(s)) for s in declared}) < len(declared):
        found.append("alternatives: a set is there twice")
    for e in report["effects"]:
        common = all(e["name"] in s for s in declared)
        # of a system's sets only some are declared, and another part may have an effect of the same name
        doubted = e["verdict"] == "ambiguous" and (not common or "parts" in report)
        if not doubted and not (common and e["verdict"] == "named"):
            found.append(f"effects.{e['name']}: {e['verdict']}, but the alternatives say otherwise")
    return found


def _intervals(report: Mapping[str, Any]) -> list[str]:
    values = {f"effects.{e['name']}.{n}": v for e in report["effects"] for n, v in e["parameters"].items()}
    moved = {f"reestimated.{n}": v | {"value": v["new"]} for n, v in report["reestimated"].items()}
    return [
        f"{name}: {v['value']:g} is not in its interval {v['ci95']}"
        for name, v in (values | moved).items()
        if None not in v["ci95"] and not v["ci95"][0] <= v["value"] <= v["ci95"][1]
    ]


def _gaps(report: Mapping[str, Any]) -> list[str]:
    found = [f"where: {w['signal']} has no gap" for w in report["where"] if w["signal"] not in report["gap"]]
    for name, g in report["gap"].items():
        known = [g[k] for k in ("nominal", "reestimated", "after") if g[k] is not None]
        if any(v < 0.0 or not math.isfinite(v) for v in known):
            found.append(f"gap.{name}: negative or infinite")
    return found
