"""The time a method takes to a given error: between its points, or beyond the last."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from isetcl.validation.work_precision.estimators import percentiles, slope

INTERPOLATED, EXTRAPOLATED = "interpolated", "extrapolated"
AT_MOST, NOT_REACHED = "at most", "not reached"
_LARGEST_FACTOR = 1e4
_LEAST_SLOPE = -0.1
_LAST_POINTS = 3


@dataclass(frozen=True)
class TimeTo:
    """Time to an error.

    Attributes
    ----------
    seconds, low, high
        With its interval of 95 %; infinite where the error is not reached.
    how
        "interpolated", "extrapolated", "at most" (the cheapest image is better) or "not reached".
    """

    seconds: float
    low: float
    high: float
    how: str


@dataclass(frozen=True, eq=False)
class Curve:
    """Points of a method in the order of their times.

    Attributes
    ----------
    knob, seconds, error : ndarray, (points,)
    draws : ndarray, (resamples, points)
        The error of resamples.
    floor
        Bias that more samples do not take away; 0 where none is certain.
    replicates
        Behind the resamples.
    """

    knob: np.ndarray
    seconds: np.ndarray
    error: np.ndarray
    draws: np.ndarray
    floor: float
    replicates: int


def time_to(curve: Curve, target: float) -> tuple[TimeTo, np.ndarray]:
    """Time at which a method's error falls to a target, and the same of all resamples.

    Between points it is interpolated in log-log. Beyond the last, the error less the floor goes on
    as a power of the knob and the time as a straight line of it, as the last three points show,
    but for at most ten thousand times the last knob.
    """
    found, how = _crossing(curve, curve.error, target)
    times = np.array([_crossing(curve, row, target)[0] for row in curve.draws])
    if not math.isfinite(found):
        return TimeTo(found, found, found, how), times
    # Resamples that never get there are the far end of the interval.
    largest = math.log(np.finfo(np.float64).max)
    logs = np.minimum(np.log(times), largest)
    low, high = percentiles(logs, curve.replicates)
    far = math.inf if high > largest - 1.0 else math.exp(high)
    return TimeTo(found, math.exp(low), far, how), times


def _crossing(curve: Curve, error: np.ndarray, target: float) -> tuple[float, str]:
    """First time at which the error is no larger than the target, and how it is known."""
    seconds, e = curve.seconds, np.maximum(error, 1e-300)
    below = np.flatnonzero(e <= target)
    if len(below) == 0:
        return _beyond(curve, e, target)
    i = int(below[0])
    if i == 0:
        return float(seconds[0]), AT_MOST
    t, y = np.log(seconds[i - 1 : i + 1]), np.log(e[i - 1 : i + 1])
    share = (y[0] - math.log(target)) / (y[0] - y[1])
    return math.exp(t[0] + share * (t[1] - t[0])), INTERPOLATED


def _beyond(curve: Curve, error: np.ndarray, target: float) -> tuple[float, str]:
    last = slice(-_LAST_POINTS, None)
    knob, seconds = curve.knob[last], curve.seconds[last]
    excess = np.sqrt(np.maximum(error[last] ** 2 - curve.floor**2, 0.0))
    if target <= curve.floor or len(knob) < 2 or not np.all(excess > 0):
        return math.inf, NOT_REACHED
    steep = float(slope(knob, excess))
    rate = float(np.polyfit(knob, seconds, 1)[0])
    if not steep < _LEAST_SLOPE or not rate > 0:
        return math.inf, NOT_REACHED
    wanted = math.sqrt(target**2 - curve.floor**2)
    factor = (wanted / float(excess[-1])) ** (1.0 / steep)
    if factor > _LARGEST_FACTOR:
        return math.inf, NOT_REACHED
    return float(seconds[-1] + rate * knob[-1] * (factor - 1.0)), EXTRAPOLATED
