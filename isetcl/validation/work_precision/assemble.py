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
    Squares,
    percentiles,
    resampled_medians,
    resampled_mse,
    resampling,
    root,
    slope,
)
from isetcl.validation.work_precision.method import PART_NAMES, WorkMethod
from isetcl.validation.work_precision.result import WorkPrecision
from isetcl.validation.work_precision.targets import (
    UNKNOWN,
    Curve,
    TimeTo,
    ratio_of_times,
    time_to,
)
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
    cones: list[Squares | None]
    cone_target: float
    targets: tuple[float, ...]
    time: ClockName
    seed: int
    replicates: int
    details: dict[str, Any]

    def slices(self) -> list[slice]:
        """The points of each method."""
        ends = np.cumsum([len(m.knobs) for m in self.methods])
        sizes = [len(m.knobs) for m in self.methods]
        return [slice(int(end) - n, int(end)) for n, end in zip(sizes, ends, strict=True)]


def result(pieces: Pieces, notes: Sequence[str], *, has_times: bool) -> WorkPrecision:
    """The result; without times all that depends on them is NaN."""
    draws = _draws(pieces, pieces.errors)
    cone_draws = _draws(pieces, pieces.cones)
    columns = _error_columns(pieces, draws) | _cone_columns(pieces, cone_draws)
    columns |= _time_columns(pieces, has_times)
    fits = _fits(pieces, draws, has_times)
    curves = _curves(pieces, draws) if has_times else {}
    goals = _goals(pieces, curves)
    fits |= _cone_goals(pieces, cone_draws, has_times)
    dataset = _dataset(pieces, columns, fits, goals)
    details = pieces.details | {
        "time": pieces.time,
        "seed": pieces.seed,
        "replicates": pieces.replicates,
        "resamples": RESAMPLES,
        "version": __version__,
        "python": platform.python_version(),
        "processors": os.cpu_count(),
        "has_times": has_times,
    }
    return WorkPrecision(dataset, tuple(notes), details, curves)


def _draws(pieces: Pieces, errors: Sequence[Squares | None]) -> list[np.ndarray]:
    """Root mean square errors of every point in every resample; all share the reference's noise."""
    noise = np.random.default_rng(pieces.seed + 1).standard_normal(RESAMPLES)
    drawn = []
    for own in errors:
        if own is None:
            drawn.append(np.full(RESAMPLES, math.nan))
            continue
        drawn.append(root(resampled_mse(own, _shares(pieces, len(own.gram)), noise)))
    return drawn


def _shares(pieces: Pieces, count: int) -> np.ndarray:
    """The same resamples wherever there are so many replicates: methods are paired."""
    return resampling(count, RESAMPLES, pieces.seed)


def _error_columns(pieces: Pieces, draws: list[np.ndarray]) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = {name: [] for name in _ERROR_COLUMNS}
    for found, drawn, part in zip(pieces.errors, draws, pieces.parts, strict=True):
        low, high = percentiles(drawn, len(found.gram))
        known = [part[name] ** 2 for name in PART_NAMES if name in part]
        row = {
            "rmse": float(root(found.mse)),
            "rmse_low": low,
            "rmse_high": high,
            "monte_carlo": math.sqrt(found.variance),
            "budget": math.sqrt(found.variance + sum(known)) if known else math.nan,
            "bias": float(root(found.bias2)),
            "bias_low": float(root(found.bias2_low)),
            "bias_high": float(root(found.bias2_high)),
            "bias2": found.bias2,
            "mse": found.mse,
            "relative_mse": found.relative_mse,
            "worst": found.worst,
            "largest": found.largest,
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


def _cone_columns(pieces: Pieces, draws: list[np.ndarray]) -> dict[str, list[Any]]:
    """The error in units of cone noise, with its interval; NaN where no excitations are known."""
    columns: dict[str, list[Any]] = {"cone_noise": [], "cone_noise_low": [], "cone_noise_high": []}
    for own, drawn in zip(pieces.cones, draws, strict=True):
        values = (math.nan,) * 3
        if own is not None:
            values = (float(root(own.mse)), *percentiles(drawn, len(own.gram)))
        for name, value in zip(columns, values, strict=True):
            columns[name].append(value)
    return columns


_ERROR_COLUMNS = (
    *("rmse", "rmse_low", "rmse_high", "monte_carlo", "budget", "bias", "bias_low", "bias_high"),
    *(
        "bias2",
        "mse",
        "relative_mse",
        "worst",
        "largest",
        "energy",
        "energy_error",
        "reference_error",
        "is_limited",
    ),
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


def _fits(pieces: Pieces, draws: list[np.ndarray], has_times: bool) -> dict[str, list[Any]]:
    """Slopes of each method."""
    fits: dict[str, list[Any]] = {
        f"{name}{end}": [] for name in _FITS for end in ("", "_low", "_high")
    }
    for method, part in zip(pieces.methods, pieces.slices(), strict=True):
        errors, times = pieces.errors[part], pieces.times[part]
        drawn = np.stack(draws[part], axis=1)
        rmse = np.array([float(root(e.mse)) for e in errors])
        noise = np.array([math.sqrt(e.variance) for e in errors])
        measured = [t.of(pieces.time) for t in times]
        seconds = np.array([np.median(own) for own in measured])
        many_seconds = np.stack(
            [resampled_medians(own, _shares(pieces, len(own))) for own in measured], axis=1
        )
        count = len(errors[0].gram)
        noise_drawn = np.stack([_noise_draws(e, _shares(pieces, count)) for e in errors], axis=1)
        knobs = np.array(method.knobs)
        for name, x, y, many_x, many in (
            ("slope", knobs, rmse, knobs, drawn),
            ("noise_slope", knobs, noise, knobs, noise_drawn),
            ("time_slope", seconds, rmse, many_seconds, drawn),
        ):
            is_known = len(x) > 1 and (has_times or name != "time_slope")
            values = (math.nan,) * 3
            if is_known:
                values = (float(slope(x, y)), *percentiles(slope(many_x, many), count))
            for end, value in zip(("", "_low", "_high"), values, strict=True):
                fits[name + end].append(value)
    return fits


_FITS = ("slope", "noise_slope", "time_slope")


def _curves(pieces: Pieces, draws: list[np.ndarray]) -> dict[str, Curve]:
    """Error against time of each method, as `draws` of errors have it."""
    found = {}
    for method, part in zip(pieces.methods, pieces.slices(), strict=True):
        errors = pieces.errors[part]
        last = errors[int(np.argmax([t.median_s(pieces.time) for t in pieces.times[part]]))]
        floor = float(root(last.bias2)) if last.bias2_low > 0 else 0.0
        rmse = np.array([float(root(e.mse)) for e in errors])
        found[method.name] = _curve(pieces, method, part, rmse, draws, floor)
    return found


def _curve(
    pieces: Pieces,
    method: WorkMethod,
    part: slice,
    error: np.ndarray,
    draws: list[np.ndarray],
    floor: float,
) -> Curve:
    times = [t.of(pieces.time) for t in pieces.times[part]]
    seconds = np.array([np.median(own) for own in times])
    # A method's images and times of one seed stay together, and so do those of other methods.
    second_draws = [resampled_medians(own, _shares(pieces, len(own))) for own in times]
    order = np.argsort(seconds)
    return Curve(
        np.array(method.knobs)[order],
        seconds[order],
        error[order],
        np.stack(draws[part], axis=1)[:, order],
        np.stack(second_draws, axis=1)[:, order],
        floor,
        len(times[0]),
    )


def _goals(pieces: Pieces, curves: dict[str, Curve]) -> dict[str, list[list[Any]]]:
    """Times to each target, efficiencies there, and how many times the first method's time."""
    goals: dict[str, list[list[Any]]] = {name: [] for name in _GOALS}
    first = pieces.methods[0].name
    for method in pieces.methods:
        rows: list[tuple[Any, ...]] = []
        for target in pieces.targets:
            if not curves:
                rows.append((*(math.nan,) * 3, WITHHELD, *(math.nan,) * 4))
                continue
            own, _ = time_to(curves[method.name], target)
            least = 1.0 / (target**2 * own.seconds)
            ratio = ratio_of_times(curves[method.name], curves[first], target)
            rows.append((own.seconds, own.low, own.high, own.how, least, *ratio))
        for i, name in enumerate(_GOALS):
            goals[name].append([row[i] for row in rows])
    return goals


_GOALS = (
    *("time_to_s", "time_to_low_s", "time_to_high_s", "time_to_how", "efficiency_at"),
    *("times_first", "times_first_low", "times_first_high"),
)


def _cone_goals(pieces: Pieces, draws: list[np.ndarray], has_times: bool) -> dict[str, list[Any]]:
    """Times to the part of the cones' noise that is wanted."""
    goals: dict[str, list[Any]] = {name: [] for name in _CONE_GOALS}
    for method, part in zip(pieces.methods, pieces.slices(), strict=True):
        own, row = pieces.cones[part], TimeTo(math.nan, math.nan, math.nan, WITHHELD)
        known = [e for e in own if e is not None]
        if len(known) < len(own):
            row = TimeTo(math.nan, math.nan, math.nan, UNKNOWN)
        elif has_times:
            error = np.array([float(root(e.mse)) for e in known])
            floor = _cone_floor(pieces.errors[part], known, pieces.times[part], pieces.time)
            curve = _curve(pieces, method, part, error, draws, floor)
            row, _ = time_to(curve, pieces.cone_target)
        for name, value in zip(_CONE_GOALS, (row.seconds, row.low, row.high, row.how), strict=True):
            goals[name].append(value)
    return goals


def _cone_floor(
    errors: list[Errors], cones: list[Squares], times: list[Times], clock: ClockName
) -> float:
    """Bias of the dearest point in units of cone noise, where that of its brightness is certain."""
    last = int(np.argmax([t.median_s(clock) for t in times]))
    if not errors[last].bias2_low > 0:
        return 0.0
    own = cones[last]
    count, centre = len(own.gram), float(np.mean(own.gram))
    apart = float(np.mean(np.diag(own.gram))) - centre
    mean_noise = apart / (count - 1) if count > 1 else 0.0
    return float(root(centre - mean_noise - own.reference_variance))


_CONE_GOALS = ("cone_time_s", "cone_time_low_s", "cone_time_high_s", "cone_time_how")


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
    "budget": "root of the sum of squares of monte_carlo and the known parts",
    "worst": "root mean square over the worst 1 % of the pixels, noise included",
    "largest": "largest error of all pixels, noise included, mean over replicates",
    "cone_noise": "root mean square error in units of the Poisson noise of a cone",
    "cone_time_s": "time to the wanted part of the cones' noise",
    "times_first": "time to the target over that of the first method",
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
