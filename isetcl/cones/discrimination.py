"""What cones tell apart: contrasts, and an ideal observer of their Poisson noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from isetcl.cones.excitations import Excitations
from isetcl.cones.receptors import ReceptorType
from isetcl.errors import (
    InvalidInputError,
    check_between,
    check_choice,
    check_count,
    check_finite,
    check_positive,
    check_type,
)

if TYPE_CHECKING:
    import xarray

_LEVELS = 60


def contrast(excitations: Excitations, background: Excitations | None = None) -> xarray.DataArray:
    """Contrast of every receptor, (e - b) / b, (frame, receptor).

    Parameters
    ----------
    excitations
        What is seen.
    background
        The same receptors before a background, one frame or as many; None takes for b the mean over
        frames and receptors of each type.

    Raises
    ------
    InvalidInputError
        If the receptors differ, or a background is zero.
    """
    check_type("excitations", excitations, Excitations)
    seen = excitations.mean.values.astype(np.float64)
    if background is None:
        base = np.zeros(seen.shape[1])
        for kind in np.unique(excitations.types):
            own = excitations.types == kind
            base[own] = seen[:, own].mean()
    else:
        _check_alike(excitations, background, "background")
        base = background.mean.values.astype(np.float64)
        if len(base) not in (1, len(seen)):
            raise InvalidInputError(
                f"background must have one frame or {len(seen)}, got {len(base)} frames"
            )
    if not np.all(base > 0):
        raise InvalidInputError(
            f"background must excite every receptor; {np.count_nonzero(~(base > 0))} values are 0; "
            "choose a brighter one or a dark_rate_hz"
        )
    return excitations.mean.copy(data=(seen - base) / base).assign_attrs(
        units="1", long_name="contrast"
    )


def contrast_image(
    values: xarray.DataArray, kind: str, resolution: int = 128, frame: int = 0
) -> xarray.DataArray:
    """An image of what the receptors of one type see, (y, x), interpolated linearly between them.

    Parameters
    ----------
    values
        From `contrast`, or excitations, (frame, receptor).
    kind
        ``"L"``, ``"M"``, ``"S"`` or ``"ROD"``.
    resolution
        Pixels along the longer side.
    frame
        Which frame.

    Returns
    -------
    xarray.DataArray
        Pixels outside the outermost receptors are NaN. Rows go from top to bottom.

    Raises
    ------
    InvalidInputError
        If there are fewer than three receptors of the type, or all lie on one line.
    """
    import xarray
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import QhullError

    check_type("values", values, xarray.DataArray)
    if values.dims != ("frame", "receptor") or "type" not in values.coords:
        raise InvalidInputError(
            "values must have dimensions (frame, receptor) and types, as those of `contrast`, got "
            f"dimensions {values.dims}"
        )
    check_choice("kind", kind, [each.name for each in ReceptorType])
    side = check_count("resolution", resolution, 2, 8192)
    frame = check_count("frame", frame, 0, len(values) - 1)
    own = np.flatnonzero(values["type"].values == ReceptorType[kind])
    if len(own) < 3:
        raise InvalidInputError(
            f"an image of {kind} needs three receptors or more, got {len(own)}; take a larger "
            "mosaic or another type"
        )
    places = np.stack([values[name].values[own] for name in ("x_deg", "y_deg")], axis=1)
    low, high = places.min(axis=0), places.max(axis=0)
    size = high - low
    columns, rows = np.maximum(2, np.rint(side * size / size.max())).astype(int)
    x = low[0] + size[0] * (np.arange(columns) + 0.5) / columns
    y = high[1] - size[1] * (np.arange(rows) + 0.5) / rows
    try:
        interpolator = LinearNDInterpolator(places, values.values[frame, own])
    except QhullError:
        raise InvalidInputError(
            f"the {len(own)} receptors of type {kind} lie on one line and make no image"
        ) from None
    return xarray.DataArray(
        interpolator(*np.meshgrid(x, y)),
        dims=("y", "x"),
        coords={"y": ("y", y, {"units": "deg"}), "x": ("x", x, {"units": "deg"})},
        attrs=dict(values.attrs),
    )


@dataclass(frozen=True)
class Discrimination:
    """How well an ideal observer of the excitations tells two stimuli apart.

    Attributes
    ----------
    d_prime : float
        Difference of the mean log-likelihood ratios over their standard deviation.
    percent_correct : float
        In choosing which of two intervals held the second stimulus, 50 to 100.
    by_type : dict
        d' from the receptors of each type alone; their squares nearly add up.
    """

    d_prime: float
    percent_correct: float
    by_type: dict[str, float] = field(default_factory=dict)


def discriminate(
    first: Excitations | Sequence[Excitations], second: Excitations | Sequence[Excitations]
) -> Discrimination:
    """d' of an ideal observer who knows both means and sees one Poisson instance of each.

    With means a and b, all frames and receptors counting as independent,

        d' = sum (b - a) ln(b / a) / sqrt(sum (a + b) ln^2(b / a) / 2)

    The observer has the log-likelihood ratio normally distributed, which needs many receptors or
    many excitations. Source: Geisler 1984, J Opt Soc Am A 1:775; two intervals: Phi(d' / sqrt(2)).

    The noise of renders counts as a difference between stimuli: two images of one scene, each with
    an error of r times the cones' noise (``target_error="cone_noise:r"``), have d' = r sqrt(2 n) in
    n receptors and frames whose errors are independent: 14 for 0.1 and 10 000. Several independent
    renders of each stimulus take this out: of products of differences, only those of different
    renders are summed, whose noise has a mean of zero. What is left of the noise makes d'^2
    uncertain by 2 r^2 sqrt(n / (k (k - 1) / 2)) for k renders of each; a sum below zero counts as
    0.

    Parameters
    ----------
    first, second
        Excitations by the stimuli, of the same receptors and frames; or, of each, those of as many
        renders with seeds of their own.

    Raises
    ------
    InvalidInputError
        If receptors, frames or integration times differ, or one stimulus leaves a receptor quite
        dark and the other does not.
    """
    for name, each in (("first", first), ("second", second)):
        check_type(name, each, (Excitations, list, tuple))
    renders = [[each] if isinstance(each, Excitations) else list(each) for each in (first, second)]
    if not renders[0] or len(renders[0]) != len(renders[1]):
        raise InvalidInputError(
            "both stimuli must have one render or more, and as many, got "
            f"{len(renders[0])} and {len(renders[1])}"
        )
    check_type("first", renders[0][0], Excitations)
    for each in renders[0][1:]:
        _check_comparable(renders[0][0], each, "first")
    for each in renders[1]:
        _check_comparable(renders[0][0], each, "second")
    a, b = (np.stack([each.mean.values.astype(np.float64) for each in kind]) for kind in renders)
    odd = int(np.count_nonzero(np.any(a > 0, axis=0) != np.any(b > 0, axis=0)))
    if odd or np.any((a > 0) != (a[:1] > 0)) or np.any((b > 0) != (b[:1] > 0)):
        raise InvalidInputError(
            "some means are 0 for one stimulus or one render only, where a single excitation would "
            "settle it; give all a dark_rate_hz"
        )
    types = renders[0][0].types
    d_prime = _d_prime(a, b)
    kinds = {kind.name: types == kind for kind in ReceptorType}
    by_type = {name: _d_prime(a[..., own], b[..., own]) for name, own in kinds.items() if own.any()}
    return Discrimination(d_prime, percent_correct(d_prime), by_type)


def _check_comparable(first: Excitations, other: Excitations, name: str) -> None:
    _check_alike(first, other, name)
    if first.mean.shape != other.mean.shape:
        raise InvalidInputError(
            f"{name} must have as many frames, got {len(first.mean)} and {len(other.mean)}"
        )
    times = first.integration_time_s, other.integration_time_s
    if not np.isclose(*times, rtol=1e-9, atol=0.0):
        raise InvalidInputError(
            f"{name} must have one integration time, got {times[0]:g} and {times[1]:g} s"
        )


def percent_correct(d_prime: float) -> float:
    """Percentage of right choices between two intervals, 100 Phi(d' / sqrt(2))."""
    from scipy.special import ndtr

    return float(100.0 * ndtr(check_finite("d_prime", d_prime) / np.sqrt(2.0)))


def d_prime_of(percent: float) -> float:
    """The d' with which so many per cent of choices between two intervals are right."""
    from scipy.special import ndtri

    check_between("percent", percent, 50.0, 100.0 - 1e-9)
    return float(np.sqrt(2.0) * ndtri(percent / 100.0))


def discrimination_threshold(
    stimulus: Callable[[float], Excitations | Sequence[Excitations]],
    low: float,
    high: float,
    *,
    percent: float = 75.0,
    reference: Excitations | Sequence[Excitations] | None = None,
    tolerance: float = 1e-3,
) -> float:
    """The level at which an ideal observer is right in so many per cent of two-interval choices.

    Levels are halved on a logarithmic scale, so d' should grow with the level. Each takes one call
    of `stimulus`, which may render; see `discriminate` about the noise of renders.

    Parameters
    ----------
    stimulus
        Excitations at a level, such as a contrast; or those of several renders.
    low, high
        Levels that enclose the threshold, both > 0.
    percent
        Between 50 and 100.
    reference
        What the stimulus is told from; None is the stimulus at level 0.
    tolerance
        Relative width of the last interval.

    Raises
    ------
    InvalidInputError
        If the threshold does not lie between `low` and `high`.
    """
    if not callable(stimulus):
        raise InvalidInputError(
            f"stimulus must be a function of a level, got {type(stimulus).__name__}"
        )
    low, high = check_positive("low", low), check_positive("high", high)
    tolerance = check_positive("tolerance", tolerance)
    if not high > low:
        raise InvalidInputError(f"high must be > low, got low={low:g} and high={high:g}")
    wanted = d_prime_of(percent)
    nothing = stimulus(0.0) if reference is None else reference

    def excess(level: float) -> float:
        return discriminate(nothing, stimulus(level)).d_prime - wanted

    ends = excess(low), excess(high)
    if ends[0] > 0 or ends[1] < 0:
        raise InvalidInputError(
            f"the threshold must lie between low and high; d' is {ends[0] + wanted:.3g} at "
            f"{low:g} and {ends[1] + wanted:.3g} at {high:g}, and {wanted:.3g} is wanted"
        )
    bounds = np.log([low, high])
    for _ in range(_LEVELS):
        if bounds[1] - bounds[0] <= np.log1p(tolerance):
            break
        middle = bounds.mean()
        bounds[1 if excess(float(np.exp(middle))) > 0 else 0] = middle
    return float(np.exp(bounds.mean()))


def _d_prime(a: np.ndarray, b: np.ndarray) -> float:
    """d' from means by render, (renders, frames, receptors)."""
    seen = a[0] > 0
    a, b = a[:, seen], b[:, seen]
    ratio = np.log(b / a)
    signal = _product(b - a, ratio)
    variance = _product(0.5 * (a + b).mean(axis=0) * ratio, ratio)
    return float(signal / np.sqrt(variance)) if signal > 0 and variance > 0 else 0.0


def _product(u: np.ndarray, v: np.ndarray) -> float:
    """The sum of u v over receptors; of several renders, the mean over pairs of different ones."""
    n = len(u)
    if n == 1:
        return float(np.sum(u * v))
    return float((np.sum(u.sum(axis=0) * v.sum(axis=0)) - np.sum(u * v)) / (n * (n - 1)))


def _check_alike(first: Excitations, other: Excitations, name: str) -> None:
    check_type(name, other, Excitations)
    same = np.array_equal(first.types, other.types)
    for axis in ("x_deg", "y_deg"):
        same = same and np.array_equal(first.dataset[axis].values, other.dataset[axis].values)
    if not same:
        raise InvalidInputError(
            f"{name} must be of the same receptors, got {len(first.types)} and {len(other.types)} "
            "receptors of different places or types; use one mosaic for both"
        )
