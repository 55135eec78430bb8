"""The time a method takes to a given error: between its points, or beyond the last."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from isetcl.validation.work_precision.estimators import percentiles, slope

INTERPOLATED, EXTRAPOLATED = "interpolated", "extrapolated"
AT_MOST, NOT_REACHED, UNKNOWN = "at most", "not reached", "unknown"
_LARGEST_FACTOR = 1e4
_LEAST_SLOPE = -0.1
_LAST_POINTS = 3
_TINY = 1e-300


@dataclass(frozen=True)
class TimeTo:
    """Time to an error.

    Attributes
    ----------
    seconds, low, high
        With its interval of 95 %; infinite where the error is not reached.
    how
        "interpolated", "extrapolated", "at most" (the cheapest image is better), "not reached", or
        "unknown" where times that do not grow with the knob cannot be extrapolated; then NaN.
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
    draws, second_draws : ndarray, (resamples, points)
        The error and the time of resamples.
    floor
        Bias that more samples do not take away; 0 where none is certain.
    replicates
        Behind the resamples.
    """

    knob: np.ndarray
    seconds: np.ndarray
    error: np.ndarray
    draws: np.ndarray
    second_draws: np.ndarray
    floor: float
    replicates: int


def time_to(curve: Curve, target: float) -> tuple[TimeTo, np.ndarray]:
    """Time at which a method's error falls to a target, and the same of all resamples.

    Between points it is interpolated in log-log. Beyond the last, the error less the floor goes on
    as a power of the knob and the time as a straight line of it, as the last three points show,
    but for at most ten thousand times the last knob.
    """
    found = float(_crossings(curve, curve.seconds[None], curve.error[None], target)[0])
    times = _crossings(curve, curve.second_draws, curve.draws, target)
    if not math.isfinite(found):
        how = _why_not(curve, target)
        found = math.inf if how == NOT_REACHED else math.nan
        return TimeTo(found, found, found, how), times
    # Resamples that never get there are the far end of the interval.
    largest = math.log(np.finfo(np.float64).max)
    logs = np.minimum(np.log(times), largest)
    low, high = percentiles(logs, curve.replicates)
    far = math.inf if high > largest - 1.0 else math.exp(high)
    return TimeTo(found, math.exp(low), far, _how(curve, target)), times


def ratio_of_times(one: Curve, other: Curve, target: float) -> tuple[float, float, float]:
    """Time of one method to a target over that of another, with its interval of 95 %.

    Resamples are paired: those of both hold the same seeds. NaN where either is not known to get
    there.
    """
    (mine, my_draws), (theirs, their_draws) = (time_to(curve, target) for curve in (one, other))
    if not math.isfinite(mine.seconds) or not math.isfinite(theirs.seconds):
        return (math.nan,) * 3
    if one is other:
        return (1.0,) * 3
    with np.errstate(invalid="ignore"):
        ratios = my_draws / their_draws
    return (
        mine.seconds / theirs.seconds,
        *percentiles(ratios, max(one.replicates, other.replicates)),
    )


def error_after(curve: Curve, seconds: float) -> tuple[float, np.ndarray]:
    """Error of a method after a time between those of its points, and that of all resamples."""
    error = _between(curve.seconds[None], curve.error[None], seconds)
    return float(error[0]), _between(curve.second_draws, curve.draws, seconds)


def _how(curve: Curve, target: float) -> str:
    below = curve.error <= target
    if below[0]:
        return AT_MOST
    return INTERPOLATED if np.any(below) else EXTRAPOLATED


def _why_not(curve: Curve, target: float) -> str:
    """Whether more samples do not help, or only the times do not tell what they would cost."""
    last = slice(-_LAST_POINTS, None)
    if len(curve.knob) < 2 or np.polyfit(curve.knob[last], curve.seconds[last], 1)[0] > 0:
        return NOT_REACHED
    # With times that grow as the knob does, only the error can be in the way.
    reached = _beyond(curve, curve.knob[None].astype(float), curve.error[None], target)[0]
    return UNKNOWN if math.isfinite(reached) else NOT_REACHED


def _crossings(curve: Curve, seconds: np.ndarray, error: np.ndarray, target: float) -> np.ndarray:
    """First times at which errors (n, points) are no larger than the target; infinite if never."""
    e = np.maximum(error, _TINY)
    below = e <= target
    rows = np.arange(len(e))
    after = np.maximum(np.argmax(below, axis=1), 1 if e.shape[1] > 1 else 0)
    before = np.maximum(after - 1, 0)
    t0, t1 = np.log(seconds[rows, before]), np.log(seconds[rows, after])
    y0, y1 = np.log(e[rows, before]), np.log(e[rows, after])
    with np.errstate(all="ignore"):
        between = np.exp(t0 + (y0 - math.log(target)) / (y0 - y1) * (t1 - t0))
    reached = np.where(below[:, 0], seconds[:, 0], between)
    return np.where(below.any(axis=1), reached, _beyond(curve, seconds, e, target))


def _beyond(curve: Curve, seconds: np.ndarray, error: np.ndarray, target: float) -> np.ndarray:
    """Times beyond the last point; infinite where none is to be expected."""
    knob, last = curve.knob[-_LAST_POINTS:], seconds[:, -_LAST_POINTS:]
    never = np.full(len(error), math.inf)
    if target <= curve.floor or len(knob) < 2:
        return never
    excess = np.sqrt(np.maximum(error[:, -_LAST_POINTS:] ** 2 - curve.floor**2, 0.0))
    steep = slope(knob, excess)
    rate = np.polyfit(knob, last.T, 1)[0]
    wanted = math.sqrt(target**2 - curve.floor**2)
    with np.errstate(all="ignore"):
        factor = (wanted / excess[:, -1]) ** (1.0 / steep)
        found = last[:, -1] + rate * knob[-1] * (factor - 1.0)
    falls = np.all(excess > 0, axis=1) & (steep < _LEAST_SLOPE) & (rate > 0)
    return np.where(falls & (factor <= _LARGEST_FACTOR), found, never)


def _between(seconds: np.ndarray, error: np.ndarray, wanted: float) -> np.ndarray:
    """Errors after a time, interpolated in log-log; the ends go on as they are."""
    logs = np.log(np.maximum(error, _TINY))
    return np.exp(
        [
            np.interp(math.log(wanted), np.log(t), e)
            for t, e in zip(np.sort(seconds, axis=1), logs, strict=True)
        ]
    )
