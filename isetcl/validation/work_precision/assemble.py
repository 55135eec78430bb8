"""From errors and times of points to the labelled result."""

from __future__ import annotations

import math
import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from isetcl.validation.work_precision.estimators import (
    RESAMPLES,
    Errors,
    percentiles,
    resampled_mse,
    resampling,
    root,
    slope,
)
from isetcl.validation.work_precision.method import PART_NAMES, WorkMethod
from isetcl.validation.work_precision.result import WorkPrecision
from isetcl.validation.work_precision.targets import Curve, TimeTo, time_to
from isetcl.validation.work_precision.timing import LARGEST_SPREAD, ClockName, Times
from isetcl.version import __version__

if TYPE_CHECKING:
    import xarray

WITHHELD = "withheld"
_TIME_COLUMNS = (
    *("time_s", "wall_median_s", "wall_least_s", "cpu_median_s", "cpu_least_s"),
    *("first_s", "build_s", "transfer_s", "spread", "efficiency"),
)


@dataclass(frozen=True, eq=False)
class Pieces:
    """All that was measured; the lists have an entry for every point, method by method."""

    methods: tuple[WorkMethod, ...]
    errors: list[Errors]
    times: list[Times]
    parts: list[dict[str, float]]
    targets: tuple[float, ...]
    time: ClockName
    reference: str
    seed: int
    replicates: int

    def slices(self) -> list[slice]:
        """The points of each method."""
        ends = np.cumsum([len(m.knobs) for m in self.methods])
        sizes = [len(m.knobs) for m in self.methods]
        return [slice(int(end) - n, int(end)) for n, end in zip(sizes, ends, strict=True)]


def result(pieces: Pieces, notes: Sequence[str], *, has_times: bool) -> WorkPrecision:
    """The result; without times all that depends on them is NaN."""
    draws = _draws(pieces)
    columns = _error_columns(pieces, draws) | _time_columns(pieces, has_times)
    fits, goals, kept = _method_columns(pieces, draws, has_times)
    dataset = _dataset(pieces, columns, fits, goals)
    details = {
        "reference": pieces.reference,
        "time": pieces.time,
        "seed": pieces.seed,
        "replicates": pieces.replicates,
        "resamples": RESAMPLES,
        "version": __version__,
        "python": platform.python_version(),
        "processors": os.cpu_count(),
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else math.nan,
        "has_times": has_times,
    }
    return WorkPrecision(dataset, tuple(notes), details, kept)


def _draws(pieces: Pieces) -> list[np.ndarray]:
    """RMSE of every point in every resample; all points share resamples and reference."""
    noise = np.random.default_rng(pieces.seed + 1).standard_normal(RESAMPLES)
    by_count = {
        n: resampling(n, RESAMPLES, pieces.seed) for n in {len(e.gram) for e in pieces.errors}
    }
    return [root(resampled_mse(e, by_count[len(e.gram)], noise)) for e in pieces.errors]


def _error_columns(pieces: Pieces, draws: list[np.ndarray]) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = {name: [] for name in _ERROR_COLUMNS}
    for found, drawn in zip(pieces.errors, draws, strict=True):
        low, high = percentiles(drawn, len(found.gram))
        row = {
            "rmse": float(root(found.mse)),
            "rmse_low": low,
            "rmse_high": high,
            "monte_carlo": math.sqrt(found.variance),
            "bias": float(root(found.bias2)),
            "bias_low": float(root(found.bias2_low)),
            "bias_high": float(root(found.bias2_high)),
            "bias2": found.bias2,
            "mse": found.mse,
            "relative_mse": found.relative_mse,
            "worst": found.worst,
            "energy": found.energy,
            "energy_error": found.energy_error,
            "reference_error": math.sqrt(found.reference_variance),
            "is_limited": found.reference_variance > 0 and found.mse < found.reference_variance,
            "images": len(found.gram),
        }
        for name, value in row.items():
            columns[name].append(value)
    for name in PART_NAMES:
        columns[name] = [part.get(name, math.nan) for part in pieces.parts]
    return columns


_ERROR_COLUMNS = (
    *("rmse", "rmse_low", "rmse_high", "monte_carlo", "bias", "bias_low", "bias_high", "bias2"),
    *("mse", "relative_mse", "worst", "energy", "energy_error", "reference_error", "is_limited"),
    "images",
)


def _time_columns(pieces: Pieces, has_times: bool) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = {name: [] for name in _TIME_COLUMNS}
    for found, times in zip(pieces.errors, pieces.times, strict=True):
        median = times.median_s(pieces.time)
        wall = times.median_s("wall")
        moved = [] if not times.transfer_s else [float(np.median(times.transfer_s))]
        row = {
            "time_s": median,
            "wall_median_s": wall,
            "wall_least_s": min(times.wall_s),
            "cpu_median_s": times.median_s("cpu"),
            "cpu_least_s": min(times.cpu_s),
            "first_s": times.first_s,
            "build_s": max(times.first_s - wall, 0.0),
            "transfer_s": moved[0] if moved else math.nan,
            "spread": times.spread(pieces.time),
            "efficiency": 1.0 / (found.mse * median) if found.mse > 0 else math.nan,
        }
        for name, value in row.items():
            columns[name].append(value if has_times else math.nan)
    columns["is_noisy"] = [t.spread(pieces.time) > LARGEST_SPREAD for t in pieces.times]
    return columns


def _method_columns(
    pieces: Pieces, draws: list[np.ndarray], has_times: bool
) -> tuple[dict[str, list[Any]], dict[str, list[list[Any]]], dict[tuple[str, float], np.ndarray]]:
    """Slopes of each method, times to each target, and the latter in every resample."""
    fits: dict[str, list[Any]] = {
        f"{name}{end}": [] for name in _FITS for end in ("", "_low", "_high")
    }
    goals: dict[str, list[list[Any]]] = {name: [] for name in _GOALS}
    kept: dict[tuple[str, float], np.ndarray] = {}
    for method, part in zip(pieces.methods, pieces.slices(), strict=True):
        errors, times = pieces.errors[part], pieces.times[part]
        drawn = np.stack(draws[part], axis=1)
        rmse = np.array([float(root(e.mse)) for e in errors])
        noise = np.array([math.sqrt(e.variance) for e in errors])
        seconds = np.array([t.median_s(pieces.time) for t in times])
        count = len(errors[0].gram)
        shares = resampling(count, RESAMPLES, pieces.seed)
        noise_drawn = np.stack([_noise_draws(e, shares) for e in errors], axis=1)
        knobs = np.array(method.knobs)
        for name, x, y, many in (
            ("slope", knobs, rmse, drawn),
            ("noise_slope", knobs, noise, noise_drawn),
            ("time_slope", seconds, rmse, drawn),
        ):
            is_known = len(x) > 1 and (has_times or name != "time_slope")
            values = (math.nan,) * 3
            if is_known:
                values = (float(slope(x, y)), *percentiles(slope(x, many), count))
            for end, value in zip(("", "_low", "_high"), values, strict=True):
                fits[name + end].append(value)
        order = np.argsort(seconds)
        last = errors[int(order[-1])]
        floor = float(root(last.bias2)) if last.bias2_low > 0 else 0.0
        curve = Curve(knobs[order], seconds[order], rmse[order], drawn[:, order], floor, count)
        rows: list[TimeTo] = []
        for target in pieces.targets:
            found = TimeTo(math.nan, math.nan, math.nan, WITHHELD)
            if has_times:
                found, kept[method.name, target] = time_to(curve, target)
            rows.append(found)
        goals["time_to_s"].append([r.seconds for r in rows])
        goals["time_to_low_s"].append([r.low for r in rows])
        goals["time_to_high_s"].append([r.high for r in rows])
        goals["time_to_how"].append([r.how for r in rows])
        goals["efficiency_at"].append(
            [1.0 / (t**2 * r.seconds) for t, r in zip(pieces.targets, rows, strict=True)]
        )
    return fits, goals, kept


_FITS = ("slope", "noise_slope", "time_slope")
_GOALS = ("time_to_s", "time_to_low_s", "time_to_high_s", "time_to_how", "efficiency_at")


def _noise_draws(found: Errors, shares: np.ndarray) -> np.ndarray:
    """Standard deviation of the noise in every resample."""
    count = len(found.gram)
    if count == 1:
        return np.zeros(len(shares))
    square = shares @ np.diag(found.gram)
    centre = np.einsum("br,rs,bs->b", shares, found.gram, shares)
    return root((square - centre) * count / (count - 1))


_LONG = {
    "rmse": "root mean square error, less the reference's noise, relative to its mean",
    "monte_carlo": "noise: standard deviation over replicates",
    "bias": "root mean square of the mean image's error, less noise",
    "representation": "what rounding the inputs to single precision changes",
    "rounding": "what single-precision arithmetic changes, inputs rounded already",
    "discretisation": "what fewer bands, or coarser views and layers, change",
    "relative_mse": "mean of E^2 / (Ref^2 + 0.01 mean(Ref)^2)",
    "worst": "root mean square over the worst 1 % of the pixels, noise included",
    "energy": "mean of the image over that of the reference, less 1",
    "build_s": "first call less a call in the steady state",
    "transfer_s": "part of a call spent on copies to and from the device",
    "spread": "(median - least) / least",
    "efficiency": "1 / (MSE x time)",
    "slope": "of log rmse over log knob",
    "noise_slope": "of log monte_carlo over log knob",
    "time_slope": "of log rmse over log time",
}


def _dataset(
    pieces: Pieces,
    columns: dict[str, list[Any]],
    fits: dict[str, list[Any]],
    goals: dict[str, list[list[Any]]],
) -> xarray.Dataset:
    import xarray

    def attributes(name: str) -> dict[str, str]:
        known = {"long_name": _LONG[name]} if name in _LONG else {}
        return known | ({"units": "s"} if name.endswith("_s") else {})

    names = [m.name for m in pieces.methods]
    own = [(m.name, m.knob, value) for m in pieces.methods for value in m.knobs]
    variables: dict[str, Any] = {
        name: ("point", np.array(values), attributes(name)) for name, values in columns.items()
    }
    variables |= {
        name: ("curve", np.array(values), attributes(name)) for name, values in fits.items()
    }
    variables |= {
        name: (("curve", "target"), np.array(values).reshape(len(names), -1), attributes(name))
        for name, values in goals.items()
    }
    coordinates = {
        "curve": names,
        "target": list(pieces.targets),
        "method": ("point", [name for name, _, _ in own]),
        "knob": ("point", [knob for _, knob, _ in own]),
        "value": ("point", [value for _, _, value in own]),
    }
    return xarray.Dataset(variables, coords=coordinates)
