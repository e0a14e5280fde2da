"""The fit of the slew drive judged: scores on traces that were not used, and what the traces leave open."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from fmus.models.slew import evidence, features, score, traces
from fmus.models.slew.fit import fit, scores, simulate
from fmus.models.slew.traces import Trace
from specs.progress import Report

LIMITS = {"velocity_mae_deg_s": 2.0, "angle_mae_deg": 8.0}
LEAST_PRESSURE_SIGN = 0.95


def run(report: Report | None = None) -> dict[str, Any]:
    """Fit, score with the fitted values, and say what the traces themselves leave open.

    Returns the figures of `slewright fit slew`: means over the held-out traces, every trace, those at 700
    t m2 apart, the steps' features, the traces' own mirror difference, and the parameters with how far the
    traces identify each.
    """
    known = traces.load()
    result = fit(report=report)
    figures = assess(known, result.values)
    if report is not None:
        report("scoring")
    return figures | {
        "parameters": evidence.parameters(result),
        "evaluations": result.evaluations,
        "fitted_on": [t.name for t in traces.fit_set(known)],
    }


def assess(known: Mapping[str, Trace], values: Mapping[str, float] | None = None) -> dict[str, Any]:
    """Scores of parameters `values` (default: the shipped ones) on all traces, held against the limits."""
    groups = {"fit": traces.fit_set(dict(known)), "held_out": traces.held_out(dict(known))}
    each = {name: scores(group, values) for name, group in groups.items()}
    far = scores(traces.unphysical(dict(known)), values)
    held_out = score.mean(each["held_out"].values())
    return held_out | {
        "accepted": accepted(held_out),
        "traces": {name: asdict(s) for name, s in each["held_out"].items()},
        "fit": score.mean(each["fit"].values()),
        "I700": score.mean(far.values()) | {"traces": {name: asdict(s) for name, s in far.items()}},
        "mirror_difference": {
            "held_out": score.mirror_difference(known, groups["held_out"]),
            "all": score.mirror_difference(known, known.values()),
        },
        "steps": steps(known, values),
    }


def accepted(figures: Mapping[str, float]) -> bool:
    """Whether held-out means are within the limits."""
    small = all(figures[name] <= limit for name, limit in LIMITS.items())
    return small and figures["pressure_sign"] >= LEAST_PRESSURE_SIGN


def steps(known: Mapping[str, Trace], values: Mapping[str, float] | None = None) -> dict[str, Any]:
    """Features of every step, traces and model, both directions averaged; by the trace's name."""
    pairs = {
        t.name: [t, known[t.partner]] for t in known.values() if t.shape == "step" and t.partner > t.name
    }
    runs = simulate((t for pair in pairs.values() for t in pair), values)
    table = {}
    for name, pair in pairs.items():
        wanted = features.mean([features.of_trace(t) for t in pair])
        found = features.mean(
            [features.features(t.time[t.first :], runs[t.name].qd, runs[t.name].q) for t in pair]
        )
        table[name] = {
            "traces": asdict(wanted),
            "model": asdict(found),
            "misses": features.misses(found, wanted),
        }
    return table
