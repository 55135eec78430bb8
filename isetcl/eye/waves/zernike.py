"""Zernike polynomials: both usual orders, values, and least-squares fits to wavefronts.

Orthonormal on the unit disc: the mean of Z_i Z_j is 1 for i = j and 0 otherwise, so that the
variance of a wavefront is the sum of its squared coefficients (Thibos et al. 2002, J Refract Surg
18:S652; ANSI Z80.28). Z(n, m) is N R(n, |m|)(rho) cos(m phi) for m >= 0 and
N R(n, |m|)(rho) sin(|m| phi) for m < 0, with N = sqrt((2 - delta(m, 0)) (n + 1)).

Sense: x and y of the pupil are those of the eye that looks out of it, +x to its right and +y up.
The standard draws the pupil as an examiner sees it, with x the other way round:
`ZernikeFit.mirrored`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_choice,
    check_count,
    check_positive,
)
from isetcl.eye.least_squares import least_squares

ZernikeOrder = Literal["osa", "noll"]

MAX_ORDER = 24
"""Largest radial order; above it float64 loses digits in the radial polynomials."""


def term_count(order: int) -> int:
    """Number of polynomials up to radial order `order`: (order + 1)(order + 2) / 2."""
    order = check_count("order", order, 0, MAX_ORDER)
    return (order + 1) * (order + 2) // 2


def osa_index(n: int, m: int) -> int:
    """OSA/ANSI index j = (n (n + 2) + m) / 2, from 0, of radial order n and frequency m."""
    n, m = _check_nm(n, m)
    return (n * (n + 2) + m) // 2


def osa_nm(j: int) -> tuple[int, int]:
    """Radial order n and angular frequency m of OSA/ANSI index j >= 0."""
    j = check_count("OSA index", j, 0)
    n = (math.isqrt(8 * j + 1) - 1) // 2
    return n, 2 * j - n * (n + 2)


def noll_index(n: int, m: int) -> int:
    """Noll's index, from 1, of radial order n and frequency m (Noll 1976, J Opt Soc Am 66:207).

    Even indices are the cosines.
    """
    n, m = _check_nm(n, m)
    start = n * (n + 1) // 2 + abs(m)
    low = n % 4 in (0, 1)
    return start + (0 if (m > 0 and low) or (m < 0 and not low) else 1)


def noll_nm(j: int) -> tuple[int, int]:
    """Radial order n and angular frequency m of Noll's index j >= 1."""
    j = check_count("Noll index", j, 1)
    n = (math.isqrt(8 * (j - 1) + 1) - 1) // 2
    for m in range(-n, n + 1, 2):
        if noll_index(n, m) == j:
            return n, m
    raise AssertionError(f"no Zernike polynomial has Noll index {j}")


def radial_coefficients(n: int, m: int) -> np.ndarray:
    """Coefficients of R(n, |m|) by ascending powers of rho, (n + 1,); R(1) = 1."""
    n, m = _check_nm(n, m)
    m = abs(m)
    coefficients = np.zeros(n + 1)
    for k in range((n - m) // 2 + 1):
        number = math.factorial(n - k) // (
            math.factorial(k) * math.factorial((n + m) // 2 - k) * math.factorial((n - m) // 2 - k)
        )
        coefficients[n - 2 * k] = (-1) ** k * number
    return coefficients


def norm(n: int, m: int) -> float:
    """The factor N = sqrt((2 - delta(m, 0)) (n + 1)) that makes Z(n, m) orthonormal."""
    n, m = _check_nm(n, m)
    return math.sqrt((1 if m == 0 else 2) * (n + 1))


def polynomials(order: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """All polynomials up to a radial order, OSA order, at points of the unit disc.

    Radial parts by the three-term recurrence of the Jacobi polynomials, which is stable.

    Parameters
    ----------
    order
        Largest radial order, 0 to 24.
    x, y
        Relative pupil coordinates, any shape; beyond the unit circle the polynomials go on.

    Returns
    -------
    ndarray, (terms, *shape)
    """
    terms = term_count(order)
    x, y = np.broadcast_arrays(check_array("x", x), check_array("y", y))
    squared = x * x + y * y
    result = np.empty((terms, *x.shape))
    turned = np.ones(x.shape, dtype=complex)
    for m in range(order + 1):
        for n, radial in zip(range(m, order + 1, 2), _radial_parts(m, order, squared), strict=True):
            factor = norm(n, m)
            result[osa_index(n, m)] = factor * radial * turned.real
            if m > 0:
                result[osa_index(n, -m)] = factor * radial * turned.imag
        turned = turned * (x + 1j * y)
    return result


def _radial_parts(m: int, order: int, squared: np.ndarray) -> list[np.ndarray]:
    """R(n, m) / rho^m for n = m, m + 2 ... order, from rho^2: Jacobi P_k^(0, m)(2 rho^2 - 1)."""
    t = 2.0 * squared - 1.0
    parts = [np.ones_like(squared)]
    if order >= m + 2:
        parts.append(((m + 2.0) * t - m) / 2.0)
    for k in range(2, (order - m) // 2 + 1):
        # Abramowitz & Stegun 1964, 22.7.1, alpha = 0, beta = m.
        s = 2.0 * k + m
        first = 2.0 * k * (k + m) * (s - 2.0)
        second = (s - 1.0) * (s * (s - 2.0) * t - m * m)
        third = 2.0 * (k - 1.0) * (k + m - 1.0) * s
        parts.append((second * parts[-1] - third * parts[-2]) / first)
    return parts


@dataclass(frozen=True, eq=False)
class ZernikeFit:
    """A wavefront as a sum of Zernike polynomials over a circle of the entrance pupil.

    Attributes
    ----------
    coefficients_um : ndarray, (terms,)
        Coefficients in OSA/ANSI order, um.
    radius_mm
        Radius of the circle on which the polynomials are orthonormal, mm.
    wavelength_nm
        Wavelength of the wavefront, nm.
    residual_um
        Root-mean-square of what the polynomials leave, um.
    """

    coefficients_um: np.ndarray
    radius_mm: float
    wavelength_nm: float
    residual_um: float = 0.0

    def __post_init__(self) -> None:
        values = check_array("coefficients_um", self.coefficients_um)
        if values.ndim != 1 or not np.all(np.isfinite(values)):
            raise InvalidInputError(
                f"coefficients_um must be a list of finite numbers, got shape {values.shape}"
            )
        n = osa_nm(len(values) - 1)[0] if len(values) else 0
        if len(values) != (n + 1) * (n + 2) // 2:
            raise InvalidInputError(
                "coefficients_um must hold all polynomials up to a radial order (1, 3, 6, 10, 15 "
                f"...), got {len(values)}; pad with zeros"
            )
        check_positive("radius_mm", self.radius_mm, "mm")
        check_positive("wavelength_nm", self.wavelength_nm, "nm")
        object.__setattr__(self, "coefficients_um", values)

    @property
    def order(self) -> int:
        """Largest radial order."""
        return osa_nm(len(self.coefficients_um) - 1)[0]

    @property
    def coefficients_waves(self) -> np.ndarray:
        """Coefficients in OSA/ANSI order in wavelengths (in vacuum), (terms,)."""
        return self.coefficients_um * 1000.0 / self.wavelength_nm

    def in_order(self, order: ZernikeOrder) -> np.ndarray:
        """Coefficients in um in ``"osa"`` order (from 0) or in ``"noll"`` order (from 1), (terms,).

        Both orders hold the same polynomials where the last radial order is complete.
        """
        if check_choice("order of Zernike polynomials", order, ("osa", "noll")) == "osa":
            return self.coefficients_um.copy()
        pairs = [noll_nm(j + 1) for j in range(len(self.coefficients_um))]
        return self.coefficients_um[[osa_index(n, m) for n, m in pairs]]

    def coefficient_um(self, n: int, m: int) -> float:
        """The coefficient of Z(n, m), um; 0 above the order of the fit."""
        j = osa_index(n, m)
        return float(self.coefficients_um[j]) if j < len(self.coefficients_um) else 0.0

    def rms_um(self, lowest_order: int = 2) -> float:
        """Root sum of squares of the coefficients from a radial order on, um.

        2 leaves out piston and tilt; 3 is the higher-order aberration of the eye clinic.
        """
        start = check_count("lowest_order", lowest_order, 0) * (lowest_order + 1) // 2
        return float(np.sqrt(np.sum(self.coefficients_um[start:] ** 2)))

    def opd_um(self, x_mm: np.ndarray, y_mm: np.ndarray) -> np.ndarray:
        """The wavefront at points of the entrance pupil in mm from its centre, um."""
        x, y = np.asarray(x_mm) / self.radius_mm, np.asarray(y_mm) / self.radius_mm
        return np.tensordot(self.coefficients_um, polynomials(self.order, x, y), axes=1)

    def mirrored(self) -> ZernikeFit:
        """The same wavefront with x the other way round: the pupil as an examiner sees it."""
        pairs = [osa_nm(j) for j in range(len(self.coefficients_um))]
        # x -> -x turns phi into pi - phi: cosines change sign for odd m, sines for even m.
        odd = [(m % 2 == 1) if m >= 0 else (m % 2 == 0) for _, m in pairs]
        signs = np.where(odd, -1.0, 1.0)
        return dataclasses.replace(self, coefficients_um=signs * self.coefficients_um)


def fit(
    values_um: np.ndarray,
    x_mm: np.ndarray,
    y_mm: np.ndarray,
    *,
    radius_mm: float,
    order: int,
    wavelength_nm: float,
    weights: np.ndarray | None = None,
) -> ZernikeFit:
    """The least-squares Zernike fit to samples of a wavefront.

    Parameters
    ----------
    values_um
        Samples, (n,), um.
    x_mm, y_mm
        Where in the pupil, mm from its centre, (n,).
    radius_mm
        Radius of the unit circle, mm; samples must lie in it.
    order
        Largest radial order.
    wavelength_nm
        Wavelength, nm.
    weights
        Area that each sample stands for, (n,); None counts all alike.

    Raises
    ------
    InvalidInputError
        If the samples do not determine the coefficients.
    """
    x, y = check_array("x_mm", x_mm) / radius_mm, check_array("y_mm", y_mm) / radius_mm
    basis = polynomials(order, x, y)
    values = check_array("values_um", values_um)
    if len(values) < 2 * len(basis):
        raise InvalidInputError(
            f"a Zernike fit of order {order} has {len(basis)} coefficients and needs at least "
            f"{2 * len(basis)} samples, got {len(values)}; use more samples or a lower order"
        )
    share = np.ones_like(values) if weights is None else check_array("weights", weights)
    share = share / share.sum()
    found = least_squares(basis.T, values, share)
    left = values - found @ basis
    return ZernikeFit(found, radius_mm, wavelength_nm, float(np.sqrt(np.sum(share * left**2))))


def from_sparse(
    terms: dict[tuple[int, int], float], radius_mm: float, wavelength_nm: float
) -> ZernikeFit:
    """A wavefront from a few coefficients, {(n, m): um}.

    Raises
    ------
    InvalidInputError
        If a pair (n, m) names no polynomial.
    """
    order = max((n for n, _ in terms), default=0)
    values = np.zeros(term_count(order))
    for (n, m), value in terms.items():
        values[osa_index(n, m)] = value
    return ZernikeFit(values, radius_mm, wavelength_nm)


def _check_nm(n: int, m: int) -> tuple[int, int]:
    if not (n >= 0 and abs(m) <= n and (n - m) % 2 == 0):
        raise InvalidInputError(
            f"Zernike polynomials need n >= 0 and m = -n, -n + 2, ... n, got n = {n}, m = {m}"
        )
    return int(n), int(m)


def labels(count: int) -> Sequence[str]:
    """Names "Z(n, m)" of the first `count` polynomials in OSA order."""
    return [f"Z({n}, {m})" for n, m in map(osa_nm, range(count))]
