"""The work-precision diagram: error against time in log-log."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from isetcl.errors import InvalidInputError, check_choice
from isetcl.validation.log_axis import plain_ticks

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

    from isetcl.validation.work_precision.result import WorkPrecision

_MARKERS = "osD^vPX*hp<>"
_FEWEST_DECADES = 0.3
_CONE_NOISE = "cone_noise"
_CLEAR = 10.0


_LABELS = {
    "rmse": "root mean square error",
    "monte_carlo": "noise",
    "bias": "bias",
    "representation": "error of rounded inputs",
    "rounding": "error of single-precision arithmetic",
    "discretisation": "error of discretisation",
    "budget": "root of the sum of the squares of all kinds of error",
    "worst": "root mean square error of the worst 1 % of the pixels",
    "largest": "largest error",
}


def draw(result: WorkPrecision, ax: Axes | None = None, error: str = "rmse") -> Axes:
    """One curve for each method with its intervals; targets and the reference's noise as lines.

    Hollow markers are points the reference is noisier than, or whose times differed too much.
    """
    check_choice("error", error, (*_LABELS, _CONE_NOISE))
    if not np.any(result.dataset[error].values > 0):
        what = "in units of cone noise" if error == _CONE_NOISE else f"of the kind {error!r}"
        raise InvalidInputError(f"this result has no errors {what} to draw; take another error")
    return _draw(result, ax, error)


def _draw(result: WorkPrecision, ax: Axes | None, error: str) -> Axes:
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    data = result.dataset
    has_times = bool(result.provenance.get("has_times", True))
    if ax is None:
        ax = Figure(figsize=(8.5, 5.2), layout="constrained").subplots()
    colours = colormaps["tab10"].colors  # type: ignore[attr-defined]
    scale = 1.0 if error == _CONE_NOISE else 100.0
    for m, name in enumerate(data["curve"].values):
        own = result.of(str(name))
        own = own.isel(point=np.flatnonzero(own[error].values > 0))
        if not own.sizes["point"]:
            continue
        x = own["time_s"].values if has_times else own["value"].values
        y = scale * own[error].values
        bars = _bars(own, error, scale)
        # In the order of the knob: times that hardly differ would be crossed at random.
        order = np.argsort(own["value"].values)
        colour, marker = colours[m % 10], _MARKERS[m % len(_MARKERS)]
        ax.errorbar(
            *(x[order], y[order]), bars[:, order], color=colour, lw=1.3, capsize=2, alpha=0.85
        )
        hollow = own["is_limited"].values | own["is_noisy"].values
        ax.plot(x[~hollow], y[~hollow], marker, color=colour, label=None, ms=6)
        ax.plot(x[hollow], y[hollow], marker, color=colour, mfc="white", ms=6)
        ax.plot([], [], marker=marker, color=colour, label=str(name))
    _draw_lines(result, ax, error)
    if np.any(data["is_limited"].values | data["is_noisy"].values):
        text = "hollow: uneven times, or below\nthe noise of the reference"
        ax.plot([], [], "o", color="0.35", mfc="white", ms=6, label=text)
    ax.set_xscale("log")
    ax.set_yscale("log")
    _widen(ax)
    if error == "rmse":
        _shade(result, ax)
    for axis in (ax.xaxis, ax.yaxis):
        plain_ticks(axis)
    clock = {"wall": "time of an image (s)", "cpu": "processor time of an image (s)"}
    ax.set_xlabel(clock[result.provenance["time"]] if has_times else "knob (times were too noisy)")
    ax.set_ylabel(_ylabel(error))
    ax.grid(which="major", alpha=0.3)
    ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=9, frameon=False)
    return ax


def _ylabel(error: str) -> str:
    if error == _CONE_NOISE:
        return "root mean square error / Poisson noise of a cone"
    return f"{_LABELS[error]} (% of the mean)"


def _bars(own: xarray.Dataset, error: str, scale: float) -> np.ndarray:
    """Lengths of the intervals to both sides, (2, points); 0 where none are known."""
    y = scale * own[error].values
    if f"{error}_low" not in own:
        return np.zeros((2, len(y)))
    ends = [scale * own[f"{error}_{end}"].values for end in ("low", "high")]
    bars = np.maximum([y - ends[0], ends[1] - y], 0.0)
    # A bar down to 0 has no place on a log axis.
    bars[0] = np.minimum(bars[0], 0.9 * y)
    return bars


def _draw_lines(result: WorkPrecision, ax: Axes, error: str) -> None:
    data = result.dataset
    if error == _CONE_NOISE:
        ratio = float(result.provenance["cone_noise"]["ratio"])
        ax.axhline(ratio, color="0.35", ls="--", lw=1.0, label="target")
        return
    if error != "rmse":
        return
    for i, target in enumerate(data["target"].values):
        label = "targets" if i == 0 else None
        ax.axhline(100.0 * float(target), color="0.35", ls="--", lw=1.0, label=label)
    noise = 100.0 * float(data["reference_error"].max())
    if noise > 0:
        ax.axhline(noise, color="0.55", ls=":", lw=1.2, label="noise of the reference")
    rounding = data["rounding"].values
    known = rounding[np.isfinite(rounding) & (rounding > 0)]
    if known.size:
        label = "rounding, single precision"
        ax.axhline(100.0 * float(np.median(known)), color="0.55", ls="-.", lw=1.0, label=label)


def _shade(result: WorkPrecision, ax: Axes) -> None:
    """Grey where errors are what is left of much larger noise of the reference."""
    low, high = ax.get_ylim()
    limit = 100.0 * _CLEAR * float(result.dataset["reference_error"].max())
    if limit > low:
        label = "below ten times the noise\nof the reference"
        ax.axhspan(low, min(limit, high), color="0.94", lw=0, zorder=0, label=label)
        ax.set_ylim(low, high)


def _widen(ax: Axes) -> None:
    """At least a part of a decade around the points, so that axes have labels."""
    for get, set_ in ((ax.get_xlim, ax.set_xlim), (ax.get_ylim, ax.set_ylim)):
        low, high = np.log10(get())
        lack = max(0.0, 1.0 + _FEWEST_DECADES - (high - low)) / 2.0
        set_(10 ** (low - lack), 10 ** (high + lack))
