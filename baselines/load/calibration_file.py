"""The calibration of one machine's load estimate as a JSON file."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from baselines.load.balance import JOINTS, unknowns
from baselines.load.calibration import Calibration
from specs.errors import InputError

FORMAT = 1
KINDS = ("still", "moving")


def as_dict(calibration: Calibration) -> dict[str, Any]:
    """A calibration in JSON's own types."""
    names, sd = [u.name for u in unknowns()], np.sqrt(np.diag(calibration.covariance))
    residual = [dict(zip(KINDS, row, strict=True)) for row in calibration.residual.tolist()]
    return {
        "load_calibration": FORMAT,
        "recordings": [dict(r) for r in calibration.recordings],
        "unknowns": dict(zip(names, calibration.values.tolist(), strict=True)),
        "sd": dict(zip(names, sd.tolist(), strict=True)),
        "residual_n_m": dict(zip(JOINTS, residual, strict=True)),
        "freedom": dict(zip(KINDS, calibration.freedom.tolist(), strict=True)),
        "covariance": calibration.covariance.tolist(),
    }


def read(path: Path) -> Calibration:
    """Read a calibration file; InputError naming it and what is wrong."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: cannot be read as a load calibration ({error})") from None
    if not isinstance(data, dict) or data.get("load_calibration") != FORMAT:
        raise InputError(f"{path}: not a load calibration (format {FORMAT}) of slewright estimate calibrate")
    try:
        found = _parsed(data)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: damaged load calibration: {error}; calibrate again") from None
    return found


def _parsed(data: dict[str, Any]) -> Calibration:
    names = [u.name for u in unknowns()]
    if set(data["unknowns"]) != set(names):
        raise ValueError("it has other unknowns than this version")
    values = np.array([float(data["unknowns"][n]) for n in names])
    covariance = np.array(data["covariance"], dtype=float)
    residual = np.array([[float(data["residual_n_m"][j][k]) for k in KINDS] for j in JOINTS])
    freedom = np.array([float(data["freedom"][k]) for k in KINDS])
    if covariance.shape != (len(names), len(names)):
        raise ValueError(f"covariance is not {len(names)} by {len(names)}")
    if not all(np.all(np.isfinite(a)) for a in (values, covariance, residual, freedom)):
        raise ValueError("a number is not finite")
    if np.any(residual <= 0.0) or np.any(freedom < 1.0) or not _positive(covariance):
        raise ValueError("variances must be positive")
    return Calibration(values, covariance, residual, freedom, tuple(data.get("recordings", ())))


def _positive(covariance: np.ndarray) -> bool:
    """Whether a covariance is positive definite; asked of its correlations, as Pa² would drown rad²."""
    variances = np.diag(covariance)
    if np.any(variances <= 0.0):
        return False
    sd = np.sqrt(variances)
    return bool(np.linalg.eigvalsh(covariance / np.outer(sd, sd))[0] > 0.0)
