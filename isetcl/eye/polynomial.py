"""Polynomials that stand for smooth functions in the kernels."""

from __future__ import annotations

import numpy as np

MAX_TERMS = 12
"""Largest number of coefficients a fit may use; the kernels allot this many."""


def unit_nodes(count: int) -> np.ndarray:
    """Chebyshev points on [0, 1], ascending, (count,): where to sample what is to be fitted."""
    return (1.0 - np.cos((np.arange(count) + 0.5) * np.pi / count)) / 2.0


def fit(
    nodes: np.ndarray, values: np.ndarray, tolerance: float, weights: np.ndarray | None = None
) -> np.ndarray:
    """Power-basis coefficients of the shortest polynomial through samples on [0, 1].

    Least squares; terms are added until the largest residual falls below `tolerance`, or to
    `MAX_TERMS`. Residuals count times their weights.

    Returns
    -------
    ndarray, (terms,), lowest power first
    """
    best = np.zeros(1)
    smallest = np.inf
    for terms in range(1, min(MAX_TERMS, len(nodes)) + 1):
        series = np.polynomial.Chebyshev.fit(nodes, values, terms - 1, domain=[0.0, 1.0], w=weights)
        coefficients = series.convert(kind=np.polynomial.Polynomial).coef
        residual = evaluate(coefficients, nodes) - values
        error = float(np.max(np.abs(residual if weights is None else weights * residual)))
        if error < smallest:
            best, smallest = coefficients, error
        if error <= tolerance:
            break
    return best


def evaluate(coefficients: np.ndarray, s: np.ndarray) -> np.ndarray:
    """The polynomial at `s`, by Horner's rule as in the kernels."""
    return np.polynomial.polynomial.polyval(s, coefficients)
