"""How well predictions agree with what was measured: RMSE, FIT in % and the rating of ISO/TS 18571."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from records.iso18571 import mean_rating

Pairs = Sequence[tuple[np.ndarray, np.ndarray]]  # measured and predicted, stretch by stretch
FIRST, LAST = "nominal", "after"


def scores(stages: Mapping[str, Pairs], unit: str) -> dict[str, Any]:
    """The figures of one signal by stage; NaN where there is no prediction."""
    return {
        "unit": unit,
        "rmse": {s: rms(p) for s, p in stages.items()},
        "fit_percent": {s: fit_percent(p) for s, p in stages.items()},
        "iso18571": {s: mean_rating(p) for s, p in stages.items()},
    }


def overall(found: Mapping[str, Mapping[str, Any]]) -> dict[str, float]:
    """Mean rating over the signals of `scores`, of the model as it came and with what was found."""
    rated = {"before": FIRST, "after": LAST}
    by_stage = {k: [s["iso18571"][stage] for s in found.values()] for k, stage in rated.items()}
    return {k: float(np.mean(v)) if v else float("nan") for k, v in by_stage.items()}


def rms(pairs: Pairs) -> float:
    """Root mean square of measured minus predicted; NaN without a sample."""
    if not any(len(a) for a, _ in pairs):
        return float("nan")
    return float(np.sqrt(np.mean(np.concatenate([a - b for a, b in pairs]) ** 2)))


def fit_percent(pairs: Pairs) -> float:
    """100 (1 − |measured − predicted| / |measured − its mean|), in %; NaN without a sample."""
    if not any(len(a) for a, _ in pairs):
        return float("nan")
    measured = np.concatenate([a for a, _ in pairs])
    left = float(np.linalg.norm(measured - np.concatenate([b for _, b in pairs])))
    spread = float(np.linalg.norm(measured - np.mean(measured)))
    return 100.0 * (1.0 - left / spread) if spread > 0.0 else float("nan")
