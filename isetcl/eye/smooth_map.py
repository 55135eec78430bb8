"""Smooth functions of two variables, fitted to scattered samples."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev

from isetcl.eye.least_squares import least_squares


class SmoothMap:
    """A least-squares polynomial through samples of a vector function on a disc-like region.

    Chebyshev products T_i(s) T_j(t) with i + j <= degree, where (s, t) is the argument scaled to
    the box of the samples.

    Parameters
    ----------
    at
        Sample positions, (n, 2).
    values
        Samples, (n, k).
    degree
        Total degree.
    """

    def __init__(self, at: np.ndarray, values: np.ndarray, degree: int) -> None:
        low, high = at.min(axis=0), at.max(axis=0)
        self._middle, self._half = (low + high) / 2.0, (high - low) / 2.0
        self._degree = degree
        self._i, self._j = (
            np.array(powers)
            for powers in zip(
                *((i, n - i) for n in range(degree + 1) for i in range(n + 1)), strict=True
            )
        )
        s, t = self._scaled(at)
        self._coefficients = least_squares(self._products(s, t), values)

    def __call__(self, at: np.ndarray) -> np.ndarray:
        """Values at points (m, 2), shape (m, k)."""
        return self._products(*self._scaled(at)) @ self._coefficients

    def gradient(self, at: np.ndarray) -> np.ndarray:
        """Derivatives at points (m, 2), shape (m, k, 2), in the last axis by each argument."""
        s, t = self._scaled(at)
        along_s = (_slopes(s, self._degree)[:, self._i] * _vander(t, self._degree)[:, self._j]) @ (
            self._coefficients
        )
        along_t = (_vander(s, self._degree)[:, self._i] * _slopes(t, self._degree)[:, self._j]) @ (
            self._coefficients
        )
        return np.stack([along_s / self._half[0], along_t / self._half[1]], axis=-1)

    def _scaled(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        scaled = (at - self._middle) / self._half
        return scaled[:, 0], scaled[:, 1]

    def _products(self, s: np.ndarray, t: np.ndarray) -> np.ndarray:
        return np.asarray(
            _vander(s, self._degree)[:, self._i] * _vander(t, self._degree)[:, self._j]
        )


def _vander(x: np.ndarray, degree: int) -> np.ndarray:
    return np.asarray(chebyshev.chebvander(x, degree))


def _slopes(x: np.ndarray, degree: int) -> np.ndarray:
    """Derivatives of T_0 ... T_degree at x, (n, degree + 1)."""
    derivative = chebyshev.chebder(np.eye(degree + 1), axis=0)
    return np.asarray(chebyshev.chebvander(x, degree - 1) @ derivative)
