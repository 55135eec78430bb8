"""What the statistics of images compare: two sets of samples, of replicates, or two images.

Every kind gives, for blocks of pixels, the difference of the means with its standard error and
degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_count
from isetcl.retina.image import RetinalImage
from isetcl.validation.grids import check_one_grid

LEAST_HITS = 25.0
"""Effective hits, (sum x)^2 / sum x^2, that a block needs in each image."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Moments of independent random samples.

    Attributes
    ----------
    total, squares : ndarray, (rows, columns) or (channels, rows, columns)
        Sums of the samples of every pixel, and of their squares.
    count
        Samples of every pixel.
    """

    total: np.ndarray
    squares: np.ndarray
    count: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "total", _film("total", self.total))
        object.__setattr__(self, "squares", _film("squares", self.squares))
        object.__setattr__(self, "count", check_count("count", self.count, 2))
        if self.total.shape != self.squares.shape:
            raise InvalidInputError(
                f"total and squares must have one shape, got {self.total.shape} and "
                f"{self.squares.shape}"
            )
        if np.any(self.total**2 > self.count * self.squares * (1.0 + 1e-6) + 1e-300):
            raise InvalidInputError(
                "squares must be the sums of the squares of what total sums (total^2 <= count "
                "squares), got smaller ones"
            )

    @classmethod
    def of(cls, values: np.ndarray) -> Samples:
        """The moments of samples (count, [channels,] rows, columns)."""
        array = check_array("values", values)
        return cls(array.sum(axis=0), np.square(array).sum(axis=0), len(array))

    @cached_property
    def mean(self) -> np.ndarray:
        """Mean of every pixel, (channels, rows, columns)."""
        return self.total / self.count

    @cached_property
    def variance(self) -> np.ndarray:
        """Variance of that mean."""
        return np.maximum(self.squares / self.count - self.mean**2, 0.0) / (self.count - 1)

    def noise(self) -> float:
        """Standard error of the mean of all pixels, relative to it."""
        return _relative_noise(self.mean, self.variance)


@dataclass(frozen=True, eq=False)
class Replicates:
    """Images of the same thing, each from its own independent samples.

    Attributes
    ----------
    films : ndarray, (replicates, rows, columns) or (replicates, channels, rows, columns)
        At least two.
    """

    films: np.ndarray

    def __post_init__(self) -> None:
        array = check_array("films", self.films)
        if array.ndim == 3:
            array = array[:, None]
        if array.ndim != 4 or array.size == 0 or len(array) < 2:
            raise InvalidInputError(
                "films must be at least two images, (replicates, rows, columns) or (replicates, "
                f"channels, rows, columns), got shape {array.shape}"
            )
        _check_numbers("films", array)
        object.__setattr__(self, "films", array)

    @cached_property
    def mean(self) -> np.ndarray:
        """Mean of every pixel, (channels, rows, columns)."""
        return self.films.mean(axis=0)

    @cached_property
    def variance(self) -> np.ndarray:
        """Variance of that mean."""
        return self.films.var(axis=0, ddof=1) / len(self.films)

    def noise(self) -> float:
        """Standard error of the mean of all pixels, relative to it."""
        whole = self.films.mean(axis=(1, 2, 3))
        level = abs(float(whole.mean()))
        return float(whole.std(ddof=1)) / np.sqrt(len(whole)) / level if level > 0 else 0.0


@dataclass(frozen=True, eq=False)
class Estimate:
    """A retinal image and its standard error, whose pixels err independently."""

    mean: np.ndarray
    variance: np.ndarray
    replicates: int
    illuminance: np.ndarray
    illuminance_variance: np.ndarray

    def noise(self) -> float:
        """Standard error of the mean of all pixels, relative to it."""
        return _relative_noise(self.illuminance, self.illuminance_variance)


AnyArm: TypeAlias = Samples | Replicates | Estimate


@dataclass(frozen=True)
class Pair:
    """Differences of two images over blocks of pixels, all (channels, blocks).

    Attributes
    ----------
    difference, error, freedom
        Of the means, its standard error, and the degrees of freedom of that.
    level
        Mean of the reference.
    """

    difference: np.ndarray
    error: np.ndarray
    freedom: np.ndarray
    level: np.ndarray

    @cached_property
    def score(self) -> np.ndarray:
        """Differences in standard errors: 0 where there is none, infinite where only noise is."""
        with np.errstate(divide="ignore", invalid="ignore"):
            score = np.abs(self.difference) / self.error
        return np.where(self.difference == 0, 0.0, score)

    @cached_property
    def p(self) -> np.ndarray:
        """Two-sided p-values."""
        from scipy import stats

        normal = np.isinf(self.freedom)
        freedom = np.where(normal, 1.0, self.freedom)
        p = np.where(normal, stats.norm.sf(self.score), stats.t.sf(self.score, freedom))
        return np.minimum(2.0 * p, 1.0)


def image_arm(name: str, image: object) -> AnyArm:
    """One side of a comparison; raises InvalidInputError for what is none."""
    if isinstance(image, RetinalImage):
        return _estimate(name, image)
    if isinstance(image, (Samples, Replicates)):
        return image
    raise InvalidInputError(
        f"{name} must be Samples, Replicates or a RetinalImage, got an object of type "
        f"{type(image).__name__}; a single array says nothing about its noise"
    )


def check_alike(one: object, other: object) -> None:
    """Raise InvalidInputError unless two retinal images lie on one grid."""
    if isinstance(one, RetinalImage) and isinstance(other, RetinalImage):
        check_one_grid(one, other)


def _estimate(name: str, image: RetinalImage) -> Estimate:
    data = image.dataset
    error = data["standard_error"].values.astype(np.float64)
    if not np.isfinite(error).all():
        raise InvalidInputError(
            f"{name} must have a standard error, got {int(np.sum(~np.isfinite(error)))} pixels "
            "without one; render with at least two replicates"
        )
    mean = data["irradiance"].values.astype(np.float64)
    _check_numbers(name, mean)
    # The illuminance, or the sum of what no cone of the standard observer sees.
    grey, grey_error = (np.asarray(v, dtype=np.float64)[None] for v in image.brightness())
    count = max(2, int(image.provenance.get("replicates", 2)))
    return Estimate(mean, error**2, count, grey, grey_error**2)


def mean_of_channels(arm: AnyArm) -> AnyArm:
    """One channel from all: the mean, or the illuminance of a retinal image.

    All wavelengths of a path meet the same surfaces, so that channels do not err independently.
    """
    if isinstance(arm, Replicates):
        return Replicates(arm.films.mean(axis=1))
    if isinstance(arm, Estimate):
        grey, variance = arm.illuminance, arm.illuminance_variance
        return Estimate(grey, variance, arm.replicates, grey, variance)
    if len(arm.total) == 1:
        return arm
    # The square of a sum is not known from those of the channels; this is the most it can be.
    weight = 1.0 / len(arm.total)
    return Samples(
        arm.total.sum(axis=0) * weight,
        np.square(np.sqrt(arm.squares).sum(axis=0) * weight),
        arm.count,
    )


def pair_of(
    one: AnyArm, other: AnyArm, labels: np.ndarray, *, paired: bool, rounding: float
) -> Pair:
    """The differences of two images over the blocks that `labels` (rows, columns) number."""
    if isinstance(one, Samples) and isinstance(other, Samples):
        pair = _of_samples(one, other, labels)
    elif isinstance(one, Replicates) and isinstance(other, Replicates):
        pair = _of_paired(one, other, labels) if paired else _of_replicates(one, other, labels)
    else:
        assert isinstance(one, Estimate)
        assert isinstance(other, Estimate)
        pair = _of_estimates(one, other, labels)
    floor = rounding * np.abs(pair.level)
    return Pair(pair.difference, np.hypot(pair.error, floor), pair.freedom, pair.level)


def _of_samples(one: Samples, other: Samples, labels: np.ndarray) -> Pair:
    """With the variance that both have if they are alike, pixel by pixel."""
    n = one.count + other.count
    common = (one.total + other.total) / n
    spread = np.maximum((one.squares + other.squares) / n - common**2, 0.0) * n / (n - 1)
    difference = block_means(one.mean - other.mean, labels)
    variance = block_means(spread * (1.0 / one.count + 1.0 / other.count), labels)
    error = np.sqrt(variance / np.bincount(labels.ravel()))
    level = np.abs(block_means(other.mean, labels))
    return Pair(difference, error, np.full_like(error, np.inf), level)


def _of_replicates(one: Replicates, other: Replicates, labels: np.ndarray) -> Pair:
    a, b = block_means(one.films, labels), block_means(other.films, labels)
    parts = [x.var(axis=0, ddof=1) / len(x) for x in (a, b)]
    freedom = _welch(
        parts, [np.full_like(p, len(x) - 1) for p, x in zip(parts, (a, b), strict=True)]
    )
    level = np.abs(b.mean(axis=0))
    return Pair(a.mean(axis=0) - b.mean(axis=0), np.sqrt(parts[0] + parts[1]), freedom, level)


def _of_paired(one: Replicates, other: Replicates, labels: np.ndarray) -> Pair:
    if len(one.films) != len(other.films):
        raise InvalidInputError(
            "paired replicates must be as many on both sides, got "
            f"{len(one.films)} and {len(other.films)}"
        )
    a, b = block_means(one.films, labels), block_means(other.films, labels)
    d = a - b
    error = d.std(axis=0, ddof=1) / np.sqrt(len(d))
    freedom = np.full_like(error, len(d) - 1)
    return Pair(d.mean(axis=0), error, freedom, np.abs(b.mean(axis=0)))


def _of_estimates(one: Estimate, other: Estimate, labels: np.ndarray) -> Pair:
    """By the standard errors of the pixels; degrees of freedom after Satterthwaite."""
    counts = np.bincount(labels.ravel())
    parts, freedoms = [], []
    for arm in (one, other):
        nu = arm.replicates - 1
        total = block_means(arm.variance, labels) * counts
        # A mean of squares of estimates is 1 + 2 / nu too large.
        fourth = block_means(arm.variance**2, labels) * counts * nu / (nu + 2.0)
        parts.append(total / counts**2)
        with np.errstate(divide="ignore", invalid="ignore"):
            freedoms.append(np.where(fourth > 0, nu * total**2 / fourth, float(nu)))
    difference = block_means(one.mean - other.mean, labels)
    level = np.abs(block_means(other.mean, labels))
    error = np.sqrt(parts[0] + parts[1])
    return Pair(difference, error, _welch(parts, freedoms), level)


def _welch(parts: list[np.ndarray], freedoms: list[np.ndarray]) -> np.ndarray:
    """Degrees of freedom of a sum of two variances.  Source: Welch 1947, Biometrika 34:28."""
    total = parts[0] + parts[1]
    fourth = sum(p**2 / f for p, f in zip(parts, freedoms, strict=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(fourth > 0, total**2 / fourth, freedoms[0] + freedoms[1])


def block_means(films: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Means over blocks, (..., rows, columns) -> (..., blocks)."""
    number = labels.ravel()
    order = np.argsort(number, kind="stable")
    starts = np.flatnonzero(np.diff(number[order], prepend=-1))
    sums = np.add.reduceat(films.reshape(*films.shape[:-2], -1)[..., order], starts, axis=-1)
    return sums / np.bincount(number)


def plan_blocks(one: AnyArm, other: AnyArm, block: int) -> tuple[np.ndarray, tuple[int, int]]:
    """Numbers of blocks, (rows, columns), and the sides of the smallest and the largest one.

    A square is divided into four as long as every quarter holds enough light in both images, or
    none in either. What is left of the light of a quarter counts (sum x)^2 / sum x^2, or, which is
    the same for rare events, the square of its mean over its standard error.
    """
    if type(one) is not type(other):
        raise InvalidInputError(
            "test and reference must be of one kind, got "
            f"{type(one).__name__} and {type(other).__name__}"
        )
    if one.mean.shape != other.mean.shape:
        raise InvalidInputError(
            "test and reference must have one shape (channels, rows, columns), got "
            f"{one.mean.shape} and {other.mean.shape}"
        )
    rows, columns = one.mean.shape[-2:]
    side = block
    while side < max(rows, columns):
        side *= 2
    labels = np.zeros((rows, columns), dtype=np.int64)
    sides: list[int] = []
    _divide((one, other), labels, (0, 0), side, block, sides)
    return labels, (min(sides), max(sides))


def _divide(
    arms: tuple[AnyArm, AnyArm],
    labels: np.ndarray,
    corner: tuple[int, int],
    side: int,
    block: int,
    sides: list[int],
) -> None:
    y, x = corner
    half = side // 2
    quarters = [
        (v, u)
        for v in (y, y + half)
        for u in (x, x + half)
        if v < labels.shape[0] and u < labels.shape[1]
    ]
    if side > block and all(_suffices(arms, q, half) for q in quarters):
        for quarter in quarters:
            _divide(arms, labels, quarter, half, block, sides)
        return
    labels[y : y + side, x : x + side] = len(sides)
    sides.append(side)


def _suffices(arms: tuple[AnyArm, AnyArm], corner: tuple[int, int], side: int) -> bool:
    y, x = corner
    window = (slice(None), slice(y, y + side), slice(x, x + side))
    if all(not np.any(a.mean[window]) for a in arms):
        return True
    for arm in arms:
        total, variance = (v[window].sum(axis=(1, 2)) for v in (arm.mean, arm.variance))
        lit = (total != 0) | (variance > 0)
        if not np.all(total[lit] ** 2 >= LEAST_HITS * variance[lit]) or not np.any(lit):
            return False
    return True


def _relative_noise(mean: np.ndarray, variance: np.ndarray) -> float:
    level = abs(float(np.sum(mean)))
    return float(np.sqrt(np.sum(variance))) / level if level > 0 else 0.0


def _film(name: str, values: np.ndarray) -> np.ndarray:
    array = check_array(name, values)
    if array.ndim == 2:
        array = array[None]
    if array.ndim != 3 or array.size == 0:
        raise InvalidInputError(
            f"{name} must have shape (rows, columns) or (channels, rows, columns), got "
            f"{array.shape}"
        )
    _check_numbers(name, array)
    return array


def _check_numbers(name: str, array: np.ndarray) -> None:
    if not np.isfinite(array).all():
        raise InvalidInputError(
            f"{name} must be finite, got {int(np.sum(~np.isfinite(array)))} pixels that are not"
        )
