"""Zernike sag: a conic and orthonormal Zernike polynomials, as corneal topographers fit them."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_positive
from isetcl.eye.shapes.shape import Departure
from isetcl.eye.waves import zernike

MAX_ORDER = 10
"""Largest radial order: 66 polynomials."""


@dataclass(frozen=True)
class ZernikeSag(Departure):
    """The conic plus sum c_j Z_j(x / R, y / R).

    Parameters
    ----------
    coefficients_mm
        c_j in OSA/ANSI order from j = 0, mm, for orthonormal polynomials; any number up to 66. The
        polynomials go on beyond R.
    radius_mm
        R, the normalisation radius, mm.
    """

    coefficients_mm: Sequence[float]
    radius_mm: float

    def __post_init__(self) -> None:
        most = zernike.term_count(MAX_ORDER)
        values = check_array("zernike sag: coefficients_mm", self.coefficients_mm)
        if values.ndim != 1 or not 1 <= values.size <= most or not np.all(np.isfinite(values)):
            raise InvalidInputError(
                f"zernike sag: coefficients_mm must be 1 to {most} finite numbers in OSA order, "
                f"mm, got an array of shape {values.shape}"
            )
        object.__setattr__(self, "coefficients_mm", tuple(values.tolist()))
        radius = check_positive("zernike sag: radius_mm", self.radius_mm, "mm")
        object.__setattr__(self, "radius_mm", radius)

    @property
    def is_rotational(self) -> bool:
        """Whether only polynomials without angle have coefficients."""
        return all(
            c == 0.0 or zernike.osa_nm(j)[1] == 0 for j, c in enumerate(self.coefficients_mm)
        )

    @property
    def order(self) -> int:
        """Largest radial order."""
        return zernike.osa_nm(len(self.coefficients_mm) - 1)[0]

    @functools.cached_property
    def powers(self) -> np.ndarray:
        """Coefficients p[i, j] of u^i v^j, u = x / R, v = y / R, mm, (order + 1, order + 1)."""
        total = np.zeros((self.order + 1, self.order + 1))
        for j, coefficient in enumerate(self.coefficients_mm):
            if coefficient != 0.0:
                part = _monomials(*zernike.osa_nm(j))
                total[: part.shape[0], : part.shape[1]] += coefficient * part
        return total

    def departure(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The sum of polynomials and its slopes."""
        from numpy.polynomial.polynomial import polyder, polyval2d

        u, v = x / self.radius_mm, y / self.radius_mm
        p = self.powers
        if len(p) == 1:
            return np.full_like(u, p[0, 0]), np.zeros_like(u), np.zeros_like(u)
        return (
            np.asarray(polyval2d(u, v, p)),
            np.asarray(polyval2d(u, v, polyder(p, axis=0)) / self.radius_mm),
            np.asarray(polyval2d(u, v, polyder(p, axis=1)) / self.radius_mm),
        )

    def vertex_curvatures(self, curvature: float) -> tuple[float, float, float]:
        """Those of the conic plus those of the polynomials."""
        p = np.zeros((3, 3))
        own = self.powers[:3, :3]
        p[: own.shape[0], : own.shape[1]] = own
        scale = 1.0 / self.radius_mm**2
        return (
            curvature + 2.0 * scale * float(p[2, 0]),
            scale * float(p[1, 1]),
            curvature + 2.0 * scale * float(p[0, 2]),
        )


def _monomials(n: int, m: int) -> np.ndarray:
    """Z(n, m) by powers of u and v, (n + 1, n + 1)."""
    result = np.zeros((n + 1, n + 1))
    angular = np.zeros((abs(m) + 1, abs(m) + 1))
    # The real part of (u + i v)^m is rho^m cos(m phi), the imaginary part its sine.
    for k in range(abs(m) + 1):
        part = math.comb(abs(m), k) * 1j**k
        angular[abs(m) - k, k] = part.real if m >= 0 else part.imag
    radial = zernike.norm(n, m) * zernike.radial_coefficients(n, m)
    for power in range(abs(m), n + 1, 2):
        half = (power - abs(m)) // 2
        for k in range(half + 1):
            shifted = radial[power] * math.comb(half, k) * angular
            i, j = 2 * (half - k), 2 * k
            result[i : i + abs(m) + 1, j : j + abs(m) + 1] += shifted
    return result
