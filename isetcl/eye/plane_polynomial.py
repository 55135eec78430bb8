"""Polynomials of two variables over a rectangle, as the kernels evaluate them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from isetcl.eye.least_squares import least_squares

MAX_DEGREE = 14
"""Largest total degree: 120 coefficients."""

NODES = 18
"""Chebyshev points a side at which functions of a rectangle are sampled."""


@dataclass(frozen=True)
class Rectangle:
    """A rectangle in the plane of field angles: its middle and half its width and height."""

    middle: tuple[float, float]
    half: tuple[float, float]

    @classmethod
    def around(cls, at: np.ndarray) -> Rectangle:
        """The smallest rectangle about points, (n, 2)."""
        low, high = at.min(axis=0), at.max(axis=0)
        half = np.maximum((high - low) / 2.0, 1e-9)
        x, y = (low + high) / 2.0
        return cls((float(x), float(y)), (float(half[0]), float(half[1])))

    def unit(self, at: np.ndarray) -> np.ndarray:
        """Points, (n, 2), in units in which the rectangle is the square from -1 to 1."""
        return np.asarray((at - np.array(self.middle)) / np.array(self.half))

    def points(self, unit: np.ndarray) -> np.ndarray:
        """The inverse of `unit`."""
        return np.asarray(np.array(self.middle) + unit * np.array(self.half))

    def nodes(self, count: int = NODES) -> np.ndarray:
        """Chebyshev points, (count^2, 2)."""
        return self.points(_square(np.cos((np.arange(count) + 0.5) * np.pi / count)))

    def lattice(self, count: int) -> np.ndarray:
        """Even points with the corners, (count^2, 2)."""
        return self.points(_square(np.linspace(-1.0, 1.0, count)))


@dataclass(frozen=True, eq=False)
class PlanePolynomial:
    """k polynomials over a rectangle: Chebyshev products T_i(u) T_j(v) with i + j <= degree.

    Attributes
    ----------
    rectangle
        Where it was fitted.
    degree
        Total degree.
    coefficients : ndarray, (terms, k)
        In the order of `terms`.
    """

    rectangle: Rectangle
    degree: int
    coefficients: np.ndarray

    def __call__(self, at: np.ndarray) -> np.ndarray:
        """Values at points (n, 2), shape (n, k)."""
        return np.asarray(_products(self.rectangle.unit(at), self.degree) @ self.coefficients)

    def powers(self) -> np.ndarray:
        """Coefficients of u^i v^j, highest first, as nested Horner's rules take them, (terms, k).

        i from the degree down to 0 and, for each, j from degree - i down to 0.
        """
        n = self.degree
        square = np.zeros((n + 1, n + 1, self.coefficients.shape[1]))
        for (i, j), row in zip(terms(n), self.coefficients, strict=True):
            square[i, j] = row
        to_powers = np.zeros((n + 1, n + 1))
        for i in range(n + 1):
            to_powers[: i + 1, i] = chebyshev.cheb2poly(np.eye(i + 1)[i])
        square = np.einsum("ai,bj,ijk->abk", to_powers, to_powers, square)
        order = [(i, j) for i in range(n, -1, -1) for j in range(n - i, -1, -1)]
        return np.array([square[i, j] for i, j in order])


def terms(degree: int) -> list[tuple[int, int]]:
    """Pairs (i, j) with i + j <= degree, by total degree."""
    return [(i, n - i) for n in range(degree + 1) for i in range(n + 1)]


def fit(
    rectangle: Rectangle, at: np.ndarray, values: np.ndarray, tolerance: float
) -> PlanePolynomial:
    """The polynomials of least degree whose residuals all fall below a tolerance, or the best.

    Parameters
    ----------
    at
        Samples in the rectangle, (n, 2), as from `Rectangle.nodes`.
    values
        (n, k).
    tolerance
        Largest residual, in units of the values.
    """
    unit = rectangle.unit(at)
    best, smallest = None, np.inf
    for degree in range(min(MAX_DEGREE, math.isqrt(len(at)) - 2) + 1):
        basis = _products(unit, degree)
        coefficients = least_squares(basis, values)
        error = float(np.max(np.abs(basis @ coefficients - values)))
        if error < smallest:
            best, smallest = PlanePolynomial(rectangle, degree, coefficients), error
        if error <= tolerance:
            break
    assert best is not None
    return best


def sampled(
    function: Callable[[np.ndarray], np.ndarray], at: np.ndarray, tolerance: float, most: int = 1024
) -> np.ndarray:
    """A smooth function of the plane at many points, (n, 2) -> (n, k).

    Up to `most` points are computed one by one. For more, a polynomial is fitted over their
    rectangle and used if it is right to the tolerance where it was not fitted.
    """
    if len(at) <= most:
        return function(at)
    rectangle = Rectangle.around(at)
    nodes = rectangle.nodes()
    fitted = fit(rectangle, nodes, function(nodes), tolerance / 4.0)
    probe = at[:: max(1, len(at) // 64)]
    # A comparison that fails where either is not a number.
    if np.max(np.abs(fitted(probe) - function(probe))) <= tolerance:
        return fitted(at)
    return np.concatenate([function(part) for part in np.array_split(at, -(-len(at) // 65536))])


def _square(axis: np.ndarray) -> np.ndarray:
    return np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)


def _products(unit: np.ndarray, degree: int) -> np.ndarray:
    i, j = np.array(terms(degree)).T
    in_u = chebyshev.chebvander(unit[:, 0], degree)
    in_v = chebyshev.chebvander(unit[:, 1], degree)
    return np.asarray(in_u[:, i] * in_v[:, j])
