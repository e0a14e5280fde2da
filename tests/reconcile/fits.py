"""Fits made up for tests of the search: what they leave, and the parameters that they pay for."""

from types import SimpleNamespace
from typing import Any

import numpy as np


def parameters(count: int) -> dict[str, Any]:
    """So many free parameters of no prior."""
    return {"free": tuple(SimpleNamespace(prior=None) for _ in range(count)), "covariance": np.eye(count)}
