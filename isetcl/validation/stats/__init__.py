"""Statistical tests of images: is one the other but for noise, and would a difference be seen?

Three tests run together. Blocks of pixels, with the level of each divided among them (Sidak), find
local defects; the sum of their squares finds diffuse ones; the mean of the whole image finds lost
or added energy. Each comes with the smallest bias that it finds four times in five: a test that
states no power proves nothing.

Blocks grow until each holds enough light in both images for a normal distribution. Samples that
were drawn independently are compared with the variance that both have if they are alike; that of
quasi-random samples is known from replicates only, so those are compared by Welch's t.

Kernels that give the same number every time get no statistics: they are compared with references.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_between,
    check_count,
    check_type,
)
from isetcl.validation.stats.arms import (
    LEAST_HITS,
    AnyArm,
    Pair,
    Replicates,
    Samples,
    check_alike,
    image_arm,
    mean_of_channels,
    pair_of,
    plan_blocks,
)
from isetcl.validation.stats.significance import (
    TestResult,
    chi_square_p,
    density_test,
    detectable_bias,
    found_non_centrality,
    power,
    sidak_level,
    sidak_p,
)

if TYPE_CHECKING:
    from isetcl.retina.image import RetinalImage

    Arm: TypeAlias = Samples | Replicates | RetinalImage

__all__ = [
    "LEAST_HITS",
    "ImageTest",
    "Replicates",
    "Samples",
    "TestResult",
    "chi_square_p",
    "density_test",
    "detectable_bias",
    "image_test",
    "power",
    "sidak_level",
    "sidak_p",
    "welch_p",
]

_SMALLEST_P = 1e-300


def welch_p(one: np.ndarray, other: np.ndarray) -> float:
    """The two-sided p-value of Welch's t for the means of two sets of replicates.

    Raises
    ------
    InvalidInputError
        If a set has fewer than two values.
    """
    arms = []
    for name, values in (("one", one), ("other", other)):
        array = check_array(name, values)
        if array.ndim != 1 or len(array) < 2:
            raise InvalidInputError(
                f"{name} must be at least two replicates, got shape {array.shape}"
            )
        arms.append(Replicates(array[:, None, None, None]))
    labels = np.zeros((1, 1), dtype=np.int64)
    return float(pair_of(arms[0], arms[1], labels, paired=False, rounding=0.0).p[0, 0])


@dataclass(frozen=True)
class ImageTest:
    """Whether two images are alike but for noise.

    Attributes
    ----------
    blocks, chi_square, mean
        The three tests, each at a third of the level.
    alpha
        Level of all together.
    bias, bias_error
        Difference of the means over that of the reference, and its standard error; of the channel
        where it is most significant.
    worst
        Largest difference of a block in standard errors.
    block_pixels
        Sides of the smallest and the largest block, pixels.
    notes
        What a reader should know, such as a reference noisier than the image it judges.
    """

    blocks: TestResult
    chi_square: TestResult
    mean: TestResult
    alpha: float
    bias: float
    bias_error: float
    worst: float
    block_pixels: tuple[int, int]
    notes: tuple[str, ...] = ()

    @property
    def tests(self) -> tuple[TestResult, TestResult, TestResult]:
        """The three tests."""
        return self.blocks, self.chi_square, self.mean

    @property
    def p(self) -> float:
        """The smallest p-value times three: at most the level, for one case in 1 / alpha."""
        return min(1.0, 3.0 * min(t.p for t in self.tests))

    @property
    def passed(self) -> bool:
        """Whether no difference was found."""
        return self.p > self.alpha

    def __str__(self) -> str:
        verdict = "agree" if self.passed else "differ"
        lines = [
            f"images {verdict}: p = {self.p:.2g}, level {self.alpha:g}",
            f"bias {self.bias:+.3g} +- {self.bias_error:.1g}, worst block {self.worst:.2f} errors",
        ]
        for t in self.tests:
            lines.append(
                f"{t.name}: p = {t.p:.2g} of {t.comparisons}; finds {t.detectable:.2g} in 4 of 5"
            )
        return "\n".join([*lines, *self.notes])


def image_test(
    test: Arm,
    reference: Arm,
    alpha: float = 1e-4,
    *,
    block: int = 8,
    paired: bool = False,
    rounding: float = 2e-6,
) -> ImageTest:
    """Whether two noisy images differ by more than their noise.

    Parameters
    ----------
    test, reference
        Two of a kind: `Samples`, `Replicates`, or retinal images on one grid.
    alpha
        Probability that images which are alike are said to differ.
    block
        Side of the smallest blocks, pixels.
    paired
        Replicates of both were made along the same rays: their differences are tested.
    rounding
        Relative difference that rounding may cause.

    Returns
    -------
    ImageTest
        p-values, the bias with its error, and the smallest biases that would have been found.

    Raises
    ------
    InvalidInputError
        If kinds, shapes or grids differ, or a pixel is no finite number.
    """
    check_between("alpha", alpha, 1e-300, 0.5)
    check_count("block", block)
    check_between("rounding", rounding, 0.0, 1.0)
    check_type("paired", paired, bool)
    one, other = image_arm("test", test), image_arm("reference", reference)
    check_alike(test, reference)
    labels, sizes = plan_blocks(one, other, block)
    level = alpha / 3.0
    pair = pair_of(one, other, labels, paired=paired, rounding=rounding)
    grey = mean_of_channels(one), mean_of_channels(other)
    joint = pair_of(*grey, labels, paired=paired, rounding=rounding)
    one_block = np.zeros_like(labels)
    whole = pair_of(one, other, one_block, paired=paired, rounding=rounding)
    energy = pair_of(*grey, one_block, paired=paired, rounding=rounding)
    k = int(np.argmin(whole.p[:, 0]))
    scale = float(whole.level[k, 0]) or 1.0
    return ImageTest(
        _block_test(pair, level),
        _chi_square_test(joint, level),
        _mean_test(whole, energy, level),
        alpha,
        float(whole.difference[k, 0]) / scale,
        float(whole.error[k, 0]) / scale,
        float(np.max(pair.score)),
        sizes,
        _notes(one, other),
    )


def _block_test(pair: Pair, alpha: float) -> TestResult:
    lit = pair.level > 0
    count = pair.p.size
    own = sidak_level(alpha, count)
    relative = np.median((pair.error / np.where(lit, pair.level, 1.0))[lit]) if lit.any() else 0.0
    freedom = float(np.median(pair.freedom))
    return TestResult(
        "blocks",
        sidak_p(float(np.min(pair.p)), count),
        count,
        detectable_bias(float(relative), alpha=own, freedom=freedom),
    )


def _chi_square_test(pair: Pair, alpha: float) -> TestResult:
    """The sum over blocks of squared scores, of t made normal; channels are taken together."""
    from scipy import stats

    z = stats.norm.isf(np.maximum(pair.p, _SMALLEST_P) / 2.0)
    total, count = float(np.sum(z * z)), pair.p.size
    with np.errstate(divide="ignore", invalid="ignore"):
        signal = np.where(pair.error > 0, pair.level / pair.error, 0.0)
    strength = math.sqrt(float(np.sum(signal**2)))
    found = math.sqrt(found_non_centrality(count, alpha)) / strength if strength > 0 else 0.0
    return TestResult("chi-square", float(stats.chi2.sf(total, count)), count, found)


def _mean_test(channels: Pair, energy: Pair, alpha: float) -> TestResult:
    """The mean of every channel, and of all together, whose detectable bias is told."""
    smallest = min(float(np.min(channels.p)), float(energy.p[0, 0]))
    count = channels.p.size + (channels.p.size > 1)
    own = sidak_level(alpha, count)
    error, freedom, level = (float(v[0, 0]) for v in (energy.error, energy.freedom, energy.level))
    found = detectable_bias(error, alpha=own, freedom=freedom) / level if level > 0 else 0.0
    return TestResult("mean", sidak_p(smallest, count), count, found)


def _notes(one: AnyArm, other: AnyArm) -> tuple[str, ...]:
    own, theirs = one.noise(), other.noise()
    if theirs > 1.1 * own:
        return (
            f"the reference is noisier than the image it judges: standard error {theirs:.2g} of "
            f"its mean, against {own:.2g}",
        )
    return ()
