"""How far an edge is spread: the width of the blur that explains its profile best."""

from __future__ import annotations

import math
from typing import Any

import numpy as np


def edge_spread_arcmin(distance: np.ndarray, profile: np.ndarray) -> float:
    """Width of the disc whose edge spread function fits a profile best, arcmin."""
    from scipy.optimize import curve_fit

    def spread(x: np.ndarray, middle: float, log_width: float, low: float, high: float) -> Any:
        t = np.clip(2.0 * (x - middle) / np.exp(log_width), -1.0, 1.0)
        return low + (high - low) * (0.5 + (t * np.sqrt(1.0 - t * t) + np.arcsin(t)) / np.pi)

    start = (0.0, math.log(10.0), 0.0, 1.0)
    found, _ = curve_fit(spread, distance, profile, p0=start, maxfev=4000)
    return float(np.exp(found[1]))
