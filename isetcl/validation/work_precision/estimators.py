"""Mean square error, bias and noise from replicates and a reference that is itself noisy.

With E_r = I_r - Ref over R replicates of n pixels, <.> the mean over pixels and V_ref that of the
reference's variance,

    MSE    = mean_r <E_r^2> - V_ref,
    V      = mean over pixels of the sample variance of the replicates,
    bias^2 = <(mean_r E_r)^2> - V / R - V_ref,

which are unbiased; bias^2 may come out negative. All of them follow from the Gram matrix
<E_r E_s>, so that a resampling of replicates costs a product of small matrices.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

RESAMPLES = 2000
LEVEL = 0.95
_WORST_SHARE = 0.01
_FLOOR = 0.01  # of the squared mean, in the denominator of relMSE


@dataclass(frozen=True, eq=False)
class Squares:
    """A mean square error, and what its resampling asks for.

    Attributes
    ----------
    gram : ndarray, (replicates, replicates)
        <E_r E_s>.
    reference_variance
        V_ref.
    reference_spread
        Standard deviation, from the reference's noise, of `mse`.
    mse
        As above.
    """

    gram: np.ndarray
    reference_variance: float
    reference_spread: float
    mse: float


@dataclass(frozen=True, eq=False)
class Errors(Squares):
    """Errors of one method at one knob, in units of the reference's mean.

    Attributes
    ----------
    variance, bias2
        As above.
    bias2_low, bias2_high
        Interval of 95 %.
    relative_mse
        Mean of E^2 / (Ref^2 + 0.01 mean(Ref)^2), less what the reference's noise adds.
    worst
        Root mean square over the worst 1 % of the pixels, noise included.
    largest
        Of all pixels, noise included; the mean over replicates.
    energy, energy_error
        Mean of the image over that of the reference, less 1, and its standard error.
    """

    variance: float
    bias2: float
    bias2_low: float
    bias2_high: float
    relative_mse: float
    worst: float
    largest: float
    energy: float
    energy_error: float


def errors_of(images: np.ndarray, reference: np.ndarray, variance: np.ndarray) -> Errors:
    """Errors of replicates against a reference.

    Parameters
    ----------
    images : ndarray, (replicates, pixels)
    reference, variance : ndarray, (pixels,)
        The reference and its squared standard error.
    """
    level = abs(float(np.mean(reference)))
    truth, noise = reference / level, variance / level**2
    off = images / level - truth
    count, n = off.shape
    squares = squares_of(off, noise)
    v_ref = squares.reference_variance
    square = float(np.mean(np.diag(squares.gram)))
    centre = float(np.mean(squares.gram))
    v = max(square - centre, 0.0) * count / (count - 1) if count > 1 else 0.0
    bias2 = centre - v / count - v_ref
    low, high = _bias_interval(squares.gram, bias2, noise, off.mean(axis=0), v)
    denominator = truth**2 + _FLOOR * float(np.mean(truth)) ** 2
    worst = max(1, math.ceil(_WORST_SHARE * n))
    largest = np.partition(np.abs(off), n - worst, axis=1)[:, n - worst :]
    energies = off.mean(axis=1)
    spread = float(np.std(energies, ddof=1)) if count > 1 else 0.0
    return Errors(
        squares.gram,
        v_ref,
        squares.reference_spread,
        squares.mse,
        v,
        bias2,
        low,
        high,
        float(np.mean((off * off - noise) / denominator)),
        float(np.sqrt(np.mean(largest**2))),
        float(np.mean(largest.max(axis=1))),
        float(np.mean(energies)),
        math.hypot(spread / math.sqrt(count), math.sqrt(v_ref / n)),
    )


def squares_of(off: np.ndarray, noise: np.ndarray) -> Squares:
    """The mean square of errors (replicates, pixels), less that of the reference's variances."""
    gram = off @ off.T / off.shape[1]
    v_ref = float(np.mean(noise))
    spread = math.sqrt(_reference_spread2(noise, off.mean(axis=0)))
    return Squares(gram, v_ref, spread, float(np.mean(np.diag(gram))) - v_ref)


def _reference_spread2(noise: np.ndarray, off: np.ndarray) -> float:
    """Variance that independent normal noise of the reference gives to <(d - noise)^2>.

    2 sum s^4 / n^2 + 4 sum s^2 d^2 / n^2; the d^2 that is seen holds s^2 itself once.
    """
    n = len(noise)
    excess = np.maximum(np.mean(noise * (off * off - noise)), 0.0)
    return float(2.0 * np.mean(noise**2) / n + 4.0 * excess / n)


def _bias_interval(
    gram: np.ndarray, bias2: float, noise: np.ndarray, off: np.ndarray, variance: float
) -> tuple[float, float]:
    """Interval of bias^2 from the variance of a quadratic form, with Student's quantile.

    var = 4 b'Sb / (R n^2) + 2 tr(S^2) / (R (R - 1) n^2) + that of the reference. A bootstrap would
    not do: a resample holds some replicates twice, which looks like bias.
    """
    from scipy.stats import t

    count = len(gram)
    total = _reference_spread2(noise, off)
    quantile = 1.96
    if count > 1:
        middle = np.eye(count) - 1.0 / count
        centred = middle @ gram @ middle
        others = centred[~np.eye(count, dtype=bool)]
        # Centring leaves covariances -S / R between replicates, which are taken out.
        trace = max(float(np.mean((others + variance / count) ** 2)), 0.0)
        along = middle @ gram.mean(axis=1)
        linear = max(float(np.sum(along**2)) / (count - 1) - trace / count, 0.0)
        total += 4.0 * linear / count + 2.0 * trace / (count * (count - 1))
        quantile = float(t.ppf(0.5 + LEVEL / 2.0, count - 1))
    half = quantile * math.sqrt(total)
    return bias2 - half, bias2 + half


@functools.lru_cache(maxsize=8)
def resampling(count: int, draws: int, seed: int) -> np.ndarray:
    """Shares of each replicate in `draws` resamples, (draws, count), not to be changed."""
    if count == 1:
        shares = np.ones((draws, 1))
    else:
        rng = np.random.default_rng(seed)
        shares = rng.multinomial(count, np.full(count, 1.0 / count), size=draws) / count
    shares.setflags(write=False)
    return shares


def resampled_medians(values: list[float], shares: np.ndarray) -> np.ndarray:
    """Median of every resample, (draws,), of values that occur in it by their shares."""
    ordered = np.sort(values)
    counts = np.rint(shares[:, np.argsort(values)] * len(values))
    seen = np.cumsum(counts, axis=1)
    middle = (len(values) + 1) // 2, len(values) // 2 + 1
    low, high = (ordered[np.argmax(seen >= m, axis=1)] for m in middle)
    return np.asarray(0.5 * (low + high))


def resampled_mse(found: Squares, shares: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """MSE of every resample, (draws,); `noise` are normal numbers for the reference's share."""
    mse = shares @ np.diag(found.gram) - found.reference_variance
    return np.asarray(mse + found.reference_spread * noise)


def percentiles(values: np.ndarray, count: int) -> tuple[float, float]:
    """Interval of 95 % from resamples of `count` replicates, NaN left out.

    Percentiles are taken so much farther out as Student's quantile and R - 1 ask for: of few
    replicates the plain ones are too narrow.

    Source: T. Hesterberg (2015), The American Statistician 69:371, "expanded percentile interval".
    """
    from scipy.stats import norm, t

    known = values[~np.isnan(values)]
    if known.size == 0:
        return math.nan, math.nan
    share = 0.5 - LEVEL / 2.0
    if count > 1:
        wide = math.sqrt(count / (count - 1)) * float(t.ppf(share, count - 1))
        share = float(norm.cdf(wide))
    low, high = np.quantile(known, [share, 1.0 - share])
    return float(low), float(high)


def root(values: np.ndarray | float) -> np.ndarray:
    """Square root of estimates that may be negative: those are 0."""
    return np.sqrt(np.maximum(values, 0.0))


def slope(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Slopes of straight lines through log y over log x, each (..., points); NaN unless y > 0."""
    dx = np.log(x) - np.mean(np.log(x), axis=-1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(y)
        found = np.sum(dx * logs, axis=-1) / np.sum(dx * dx, axis=-1)
    return np.asarray(np.where(np.isfinite(found), found, np.nan))
