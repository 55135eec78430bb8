"""Levels, powers and single tests: what `isetcl.validation.stats` is made of."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_between,
    check_count,
    check_positive,
)

POWER = 0.8
"""The share of cases in which a bias of the stated size is found."""

LEAST_EXPECTED = 5.0
"""Events that a cell of a chi-square test must expect."""


@dataclass(frozen=True)
class TestResult:
    """One test: `p`, its number of comparisons, and what it would have found.

    Attributes
    ----------
    name
        ``"blocks"``, ``"chi-square"``, ``"mean"`` or ``"density"``.
    p
        Probability of a difference at least as large between images that are alike.
    comparisons
        Blocks times channels, blocks, channels, or cells.
    detectable
        The bias, relative to the level, that is found with a probability of 0.8 at the level
        asked for: of a single block and channel for ``"blocks"``, otherwise of the mean of all
        channels (the illuminance of a retinal image) in all blocks.
    """

    # Not a test of pytest's, whatever it is called.
    __test__ = False

    name: str
    p: float
    comparisons: int
    detectable: float


def sidak_level(alpha: float, count: int) -> float:
    """The level of each of `count` independent tests that together have the level `alpha`.

    1 - (1 - alpha)^(1 / count).  Source: Sidak 1967, J Am Stat Assoc 62:626.
    """
    check_between("alpha", alpha, 0.0, 1.0)
    check_count("count", count)
    return -math.expm1(math.log1p(-alpha) / count) if alpha < 1.0 else 1.0


def sidak_p(smallest_p: float, count: int) -> float:
    """The p-value of the smallest of `count` independent p-values."""
    check_between("smallest_p", smallest_p, 0.0, 1.0)
    check_count("count", count)
    return -math.expm1(count * math.log1p(-smallest_p)) if smallest_p < 1.0 else 1.0


def power(bias: float, error: float, *, alpha: float, freedom: float = math.inf) -> float:
    """The probability that a two-sided test finds a bias.

    Parameters
    ----------
    bias
        True difference of the means.
    error
        Standard error of the difference.
    alpha
        Level of the test.
    freedom
        Degrees of freedom of the error; infinite for a normal test.
    """
    from scipy import stats

    check_positive("error", error)
    check_between("alpha", alpha, 0.0, 1.0)
    if math.isinf(freedom):
        limit = stats.norm.isf(alpha / 2)
        return float(stats.norm.sf(limit - bias / error) + stats.norm.sf(limit + bias / error))
    limit = stats.t.isf(alpha / 2, freedom)
    moved = stats.nct(freedom, bias / error)
    return float(moved.sf(limit) + moved.cdf(-limit))


def detectable_bias(
    error: float, *, alpha: float, freedom: float = math.inf, power: float = POWER
) -> float:
    """The bias that a two-sided test finds with a probability of `power`.

    (t_{1 - alpha/2} + t_{power}) error, with normal quantiles where `freedom` is infinite. For
    equal numbers N of samples of standard deviation s the error is s sqrt(2 / N).
    """
    from scipy import stats

    check_between("power", power, 0.0, 1.0)
    check_between("alpha", alpha, 0.0, 1.0)
    if not (0.0 < alpha < 1.0 and 0.0 < power < 1.0):
        raise InvalidInputError(
            f"alpha and power must be > 0 and < 1, got {alpha:g} and {power:g}: certainty needs an "
            "infinite bias"
        )
    if math.isinf(freedom):
        return float((stats.norm.isf(alpha / 2) + stats.norm.isf(1.0 - power)) * error)
    return float((stats.t.isf(alpha / 2, freedom) + stats.t.isf(1.0 - power, freedom)) * error)


def chi_square_p(
    observed: np.ndarray, expected: np.ndarray, *, fitted: int = 1, inexact: float = 0.0
) -> float:
    """The p-value of Pearson's chi-square for counts in cells, few-count cells taken together.

    Parameters
    ----------
    observed, expected
        Counts and their expectations, of one shape. Cells are pooled, in the order of their
        expectations, until each expects at least 5.
    fitted
        Constraints that the expectations satisfy: 1 if their sum is that of the counts.
    inexact
        Relative error of the expectations, such as that of a quadrature.

    Raises
    ------
    InvalidInputError
        If shapes differ, an expectation is negative, or fewer than two cells are left.
    """
    from scipy import stats

    counts, wanted = _pooled(check_array("observed", observed), check_array("expected", expected))
    cells = len(counts) - check_count("fitted", fitted, 0)
    if cells < 1:
        raise InvalidInputError(
            f"the cells must leave at least one degree of freedom, got {len(counts)} cells that "
            f"expect {LEAST_EXPECTED:g} counts or more; draw more samples"
        )
    variance = wanted + (check_between("inexact", inexact, 0.0, 1.0) * wanted) ** 2
    return float(stats.chi2.sf(np.sum((counts - wanted) ** 2 / variance), cells))


def _pooled(observed: np.ndarray, expected: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Counts and expectations with cells put together until each expects enough."""
    if observed.shape != expected.shape or observed.size == 0:
        raise InvalidInputError(
            "observed and expected must have the same cells, got shapes "
            f"{observed.shape} and {expected.shape}"
        )
    if not (np.isfinite(expected).all() and np.all(expected >= 0) and np.all(observed >= 0)):
        raise InvalidInputError(
            "observed and expected must be finite and >= 0, got a smallest value of "
            f"{min(float(np.min(observed)), float(np.min(expected))):g}"
        )
    order = np.argsort(expected, axis=None, kind="stable")
    counts, wanted = observed.ravel()[order], expected.ravel()[order]
    few = int(np.searchsorted(wanted, LEAST_EXPECTED))
    # Enough of the larger cells join those that expect little for these to expect enough.
    while 0 < few < len(wanted) and wanted[:few].sum() < LEAST_EXPECTED:
        few += 1
    if few == 0:
        return counts, wanted
    return (
        np.append(counts[few:], counts[:few].sum()),
        np.append(wanted[few:], wanted[:few].sum()),
    )


def density_test(
    samples: np.ndarray, density: np.ndarray, edges: tuple[np.ndarray, ...], alpha: float = 1e-4
) -> TestResult:
    """Whether a sampler draws its density: chi-square over the cells of a grid.

    Parameters
    ----------
    samples : ndarray, (n, dimensions)
        What was drawn.
    density : ndarray
        The probability of every cell of the grid; what is missing to 1 lies outside it.
    edges
        Borders of the cells, for every dimension.
    alpha
        Level of the test.

    Returns
    -------
    TestResult
        `detectable` is the relative error of the density, alike in size in all cells, that is
        found four times in five.
    """
    drawn, share = check_array("samples", samples), check_array("density", density)
    if drawn.ndim == 1:
        drawn = drawn[:, None]
    if share.shape != tuple(len(e) - 1 for e in edges) or drawn.shape[1] != len(edges):
        raise InvalidInputError(
            f"density must have a cell between each two edges, got shape {share.shape} for "
            f"{[len(e) for e in edges]} edges and samples of {drawn.shape[1]} dimensions"
        )
    counts, _ = np.histogramdd(drawn, bins=edges)
    n = len(drawn)
    observed = np.append(counts, n - counts.sum())
    expected = np.append(n * share, max(0.0, n - n * share.sum()))
    p = chi_square_p(observed, expected)
    cells = len(_pooled(observed, expected)[0]) - 1
    return TestResult("density", p, cells, math.sqrt(found_non_centrality(cells, alpha) / n))


def found_non_centrality(cells: int, alpha: float) -> float:
    """The non-centrality that a chi-square test of `cells` degrees of freedom finds, POWER."""
    from scipy import optimize, stats

    limit = stats.chi2.isf(alpha, cells)
    missing = lambda size: stats.ncx2.sf(limit, cells, size) - POWER  # noqa: E731
    return float(optimize.brentq(missing, 1e-6, 10.0 * (limit + 10.0)))
