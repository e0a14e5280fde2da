"""A report of every verdict in the contract's form, written by hand."""

from typing import Any

GAP = {
    "unit": "m",
    "horizon_s": 2.4,
    "floor": 1e-3,
    "floor_source": "high-pass estimate",
    "nominal": 0.1,
    "reestimated": 0.05,
    "after": 1e-3,
    "run": "holdout",
}
FRICTION = {
    "name": "coulomb_friction",
    "place": "force",
    "subsystem": "rig",
    "port": "v",
    "verdict": "named",
    "equation": "F = −Fc sgn(v)",
    "parameters": {"Fc": {"value": 1.0, "unit": "N", "ci95": [0.9, 1.1]}},
    "gain_fit": 500.0,
    "gain_confirm": 0.9,
}
MOVED = {"mass": {"old": 2.0, "new": 2.4, "unit": "kg", "ci95": [2.3, 2.5]}}


def _report(verdict: str, **more: Any) -> dict[str, Any]:
    return {
        "verdict": verdict,
        "sentence": f"Made up: {verdict}.",
        "effects": [],
        "residual_status": "at_floor",
        "alternatives": [],
        "reestimated": {},
        "nuisances": {},
        "where": [],
        "gap": {"position": GAP},
        "iso18571": {"before": 0.5, "after": 0.9},
        "next_experiment": None,
        "seed": 0,
        "versions": {"slewright": "0"},
        "elapsed_s": 1.0,
    } | more


REPORT = {
    "agrees": _report("agrees"),
    "reestimated": _report("reestimated", reestimated=MOVED),
    "unexplained": _report("unexplained", residual_status="unexplained"),
    "insufficient_excitation": _report("insufficient_excitation"),
    "named": _report("named", effects=[FRICTION], alternatives=[["coulomb_friction"]]),
    "ambiguous": _report(
        "ambiguous",
        effects=[FRICTION | {"verdict": "ambiguous"}],
        alternatives=[["coulomb_friction"], ["input_dead_zone"]],
    ),
}
