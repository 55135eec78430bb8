"""Ocular media and their dispersion: refractive index against wavelength.

An index is relative to vacuum (air is taken as 1), wavelengths are in nm. Nothing is extrapolated:
a wavelength outside the range of a dispersion formula is an error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_between,
    check_choice,
    check_finite,
    check_positive,
    check_type,
)

AbbeInterpolation = Literal["shifted_cauchy", "cauchy", "linear"]

LINE_D_NM = 587.56
"""Helium d line, nm: the wavelength of n_d."""
LINE_F_NM = 486.13
"""Hydrogen F line, nm: the blue end of the Abbe number."""
LINE_C_NM = 656.27
"""Hydrogen C line, nm: the red end of the Abbe number."""


class Dispersion(Protocol):
    """What a medium needs: a formula and the range in which it holds."""

    @property
    def range_nm(self) -> tuple[float, float]:
        """Shortest and longest wavelength of the formula, nm."""

    def evaluate(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """Refractive index, without a range check."""


@dataclass(frozen=True)
class ConstantIndex:
    """The same index at every wavelength: an achromatic medium."""

    n: float

    def __post_init__(self) -> None:
        _check_index("n", self.n)

    @property
    def range_nm(self) -> tuple[float, float]:
        """Any wavelength a ray can have, nm."""
        return (200.0, 2000.0)

    def evaluate(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """Refractive index, shape of the input."""
        return np.full_like(wavelength_nm, self.n)


@dataclass(frozen=True)
class NavarroDispersion:
    """Dispersion from four measured indices by Herzberger's formula.

    n = a1 n_365 + a2 n_F + a3 n_C + a4 n_1014 with a_i = A + B l^2 + P L + R L^2,
    L = 1 / (l^2 - 0.1673^2), l in um.

    Source: Navarro, Santamaria & Bescos 1985, J Opt Soc Am A 2:1273, table 2 (coefficients as in
    Atchison & Smith 2005, J Opt Soc Am A 22:29).
    """

    n_365: float
    n_f: float
    n_c: float
    n_1014: float

    def __post_init__(self) -> None:
        for name in ("n_365", "n_f", "n_c", "n_1014"):
            _check_index(name, getattr(self, name))

    @property
    def range_nm(self) -> tuple[float, float]:
        """The span of the four measured wavelengths, nm."""
        return (365.0, 1014.0)

    def evaluate(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """Refractive index, shape of the input."""
        squared = (wavelength_nm / 1000.0) ** 2
        pole = 1.0 / (squared - _HERZBERGER_POLE_UM**2)
        powers = np.stack([np.ones_like(squared), squared, pole, pole**2], axis=-1)
        weights = powers @ _HERZBERGER_COEFFICIENTS.T
        return weights @ np.array([self.n_365, self.n_f, self.n_c, self.n_1014])

    def shifted(self, difference: float) -> NavarroDispersion:
        """The same medium with all four indices changed by `difference` (accommodation)."""
        return NavarroDispersion(
            self.n_365 + difference,
            self.n_f + difference,
            self.n_c + difference,
            self.n_1014 + difference,
        )


_HERZBERGER_POLE_UM = 0.1673
_HERZBERGER_COEFFICIENTS = np.array(
    [
        [0.66147196, -0.40352796, -0.28046790, 0.03385979],
        [-4.20146383, 2.73508956, 1.50543784, -0.11593235],
        [6.29834237, -4.69409935, -1.57508650, 0.10293038],
        [-1.75835059, 2.36253794, 0.35011657, -0.02085782],
    ]
)


@dataclass(frozen=True)
class CornuDispersion:
    """Cornu's hyperbola n = n_infinity + k_nm / (wavelength - pole_nm).

    Source: Le Grand's use of it with a pole at 130 nm, Atchison & Smith 2005, J Opt Soc Am A 22:29,
    table 1; Thibos et al. 1992, Appl Opt 31:3594, with a pole at 214.102 nm.
    """

    n_infinity: float
    k_nm: float
    pole_nm: float = 130.0

    def __post_init__(self) -> None:
        _check_index("n_infinity", self.n_infinity)
        check_finite("k_nm", self.k_nm, "nm")
        pole = check_finite("pole_nm", self.pole_nm, "nm")
        if not pole < self.range_nm[0]:
            raise InvalidInputError(
                f"pole_nm must be < {self.range_nm[0]:g} nm, where the formula's range begins, "
                f"got {pole:g}"
            )

    @property
    def range_nm(self) -> tuple[float, float]:
        """The visible range, nm; the source states no other."""
        return (380.0, 780.0)

    def evaluate(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """Refractive index, shape of the input."""
        return self.n_infinity + self.k_nm / (wavelength_nm - self.pole_nm)


@dataclass(frozen=True)
class AbbeDispersion:
    """Dispersion of a medium known only by n_d and its Abbe number V = (n_d - 1) / (n_F - n_C).

    Two numbers do not fix a curve, so the curve is chosen by name:

    * ``"shifted_cauchy"``: n = A + B / (l^2 - 0.014 um^2), half-way between Cauchy's pole at 0 and
      Herzberger's at 0.028 um^2. Steepest in the blue, nearest to measured eyes; the default.
    * ``"cauchy"``: n = A + B / l^2.
    * ``"linear"``: a straight line in l through (589.3 nm, n_d), as ISET3d has it. It removes the
      rise of dispersion at short wavelengths and with it a third of the eye's chromatic aberration.

    A and B (or the slope) follow from n_d and V, l in um.

    Source: pole of the shifted form as in the public ray tracer optrace (its Abbe model); straight
    line as in the ISET3d function arizonaRefractiveIndices.
    """

    n_d: float
    abbe_number: float
    interpolation: AbbeInterpolation = "shifted_cauchy"

    def __post_init__(self) -> None:
        _check_index("n_d", self.n_d)
        check_positive("abbe_number", self.abbe_number)
        check_choice("interpolation", self.interpolation, (*_CAUCHY_POLE_UM2, "linear"))

    @property
    def range_nm(self) -> tuple[float, float]:
        """The visible range, nm: beyond it two numbers say nothing."""
        return (380.0, 780.0)

    def evaluate(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """Refractive index, shape of the input."""
        dispersion = (self.n_d - 1.0) / self.abbe_number
        if self.interpolation == "linear":
            slope_per_nm = dispersion / (_ISET3D_F_NM - _ISET3D_C_NM)
            return self.n_d + slope_per_nm * (wavelength_nm - _ISET3D_D_NM)

        def shape(l_nm: np.ndarray | float) -> np.ndarray:
            return 1.0 / ((np.asarray(l_nm) / 1000.0) ** 2 - _CAUCHY_POLE_UM2[self.interpolation])

        b = dispersion / (shape(LINE_F_NM) - shape(LINE_C_NM))
        return self.n_d + b * (shape(wavelength_nm) - shape(LINE_D_NM))


_CAUCHY_POLE_UM2 = {"shifted_cauchy": 0.014, "cauchy": 0.0}
# The lines as ISET3d rounds them, for the straight line only.
_ISET3D_F_NM, _ISET3D_D_NM, _ISET3D_C_NM = 486.1, 589.3, 656.3


@dataclass(frozen=True)
class SellmeierDispersion:
    """Dispersion of glasses and clear liquids by Sellmeier's formula.

    n^2 = 1 + sum of b_i l^2 / (l^2 - c_i), l in um.

    Parameters
    ----------
    b
        Strengths of the resonances.
    c_um2
        Squared wavelengths of the resonances, um^2, as many.
    low_nm, high_nm
        Shortest and longest wavelength of the formula, nm.

    Raises
    ------
    InvalidInputError
        If the lists differ in length, or there is a resonance, or no index >= 1, in the range.

    Source: the three-term form is that of glass catalogues (Schott, TIE-29).
    """

    b: tuple[float, ...]
    c_um2: tuple[float, ...]
    low_nm: float = 360.0
    high_nm: float = 1100.0

    def __post_init__(self) -> None:
        for name in ("b", "c_um2"):
            values = check_array(f"sellmeier: {name}", getattr(self, name))
            if values.ndim != 1 or values.size == 0 or not np.all(np.isfinite(values)):
                raise InvalidInputError(
                    f"sellmeier: {name} must be a list of finite numbers, got {values.tolist()}"
                )
            object.__setattr__(self, name, tuple(values.tolist()))
        if len(self.b) != len(self.c_um2):
            raise InvalidInputError(
                f"sellmeier: b and c_um2 must be of one length, got {len(self.b)} and "
                f"{len(self.c_um2)}"
            )
        low = check_positive("sellmeier: low_nm", self.low_nm, "nm")
        high = check_positive("sellmeier: high_nm", self.high_nm, "nm")
        if not low < high:
            raise InvalidInputError(
                f"sellmeier: low_nm must be < high_nm, got {low:g} and {high:g} nm"
            )
        inside = [c for c in self.c_um2 if (low / 1000.0) ** 2 <= c <= (high / 1000.0) ** 2]
        if inside or not np.all(self._squared(np.linspace(low, high, 1001)) >= 1.0):
            what = f"a resonance at {1e3 * inside[0] ** 0.5:g} nm" if inside else "an index below 1"
            raise InvalidInputError(
                f"sellmeier: the index must be >= 1 between {low:g} and {high:g} nm, got {what}; "
                "narrow the range, and check that c_um2 are squares in um^2"
            )

    @property
    def range_nm(self) -> tuple[float, float]:
        """Where the formula holds, nm."""
        return (self.low_nm, self.high_nm)

    def evaluate(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """Refractive index, shape of the input."""
        return np.sqrt(self._squared(wavelength_nm))

    def _squared(self, wavelength_nm: np.ndarray) -> np.ndarray:
        squared = (np.asarray(wavelength_nm, dtype=np.float64) / 1000.0) ** 2
        terms = (b * squared / (squared - c) for b, c in zip(self.b, self.c_um2, strict=True))
        return np.asarray(1.0 + sum(terms))


@dataclass(frozen=True)
class PowerDispersion:
    """Dispersion as a sum of powers, n = sum of c_i l^(p_i), l in nm.

    Parameters
    ----------
    coefficients
        c_i, in nm^(-p_i).
    exponents
        p_i, as many, -12 to 12: (0, -2, -4, -6) is Cauchy's series, (0, 1, 2) a parabola.

    Raises
    ------
    InvalidInputError
        If the lists differ in length, or an index between 380 and 780 nm is below 1.
    """

    coefficients: tuple[float, ...]
    exponents: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("coefficients", "exponents"):
            values = check_array(f"power dispersion: {name}", getattr(self, name))
            if values.ndim != 1 or values.size == 0 or not np.all(np.isfinite(values)):
                raise InvalidInputError(
                    f"power dispersion: {name} must be a list of finite numbers, got "
                    f"{values.tolist()}"
                )
            object.__setattr__(self, name, tuple(values.tolist()))
        if len(self.coefficients) != len(self.exponents):
            raise InvalidInputError(
                "power dispersion: coefficients and exponents must be of one length, got "
                f"{len(self.coefficients)} and {len(self.exponents)}"
            )
        for exponent in self.exponents:
            check_between("power dispersion: exponents", exponent, -12.0, 12.0)
        for coefficient in self.coefficients:
            check_between("power dispersion: coefficients", coefficient, -1e40, 1e40)
        lowest = float(np.min(self.evaluate(np.linspace(*self.range_nm, 401))))
        if not lowest >= 1.0:
            raise InvalidInputError(
                f"power dispersion: the index must be >= 1 from 380 to 780 nm, got {lowest:g}; "
                "check the units: nm"
            )

    @property
    def range_nm(self) -> tuple[float, float]:
        """The visible range, nm."""
        return (380.0, 780.0)

    def evaluate(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """Refractive index, shape of the input."""
        wavelength = np.asarray(wavelength_nm, dtype=np.float64)
        terms = (c * wavelength**p for c, p in zip(self.coefficients, self.exponents, strict=True))
        return np.asarray(sum(terms))


@dataclass(frozen=True)
class TabulatedDispersion:
    """Dispersion given by a table, with straight lines between its rows.

    Parameters
    ----------
    wavelengths_nm
        Increasing, nm, at least two.
    indices
        Refractive indices there.

    Raises
    ------
    InvalidInputError
        If the table is no increasing list of indices >= 1.
    """

    wavelengths_nm: tuple[float, ...]
    indices: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("wavelengths_nm", "indices"):
            values = check_array(f"dispersion table: {name}", getattr(self, name))
            if values.ndim != 1 or values.size < 2 or not np.all(np.isfinite(values)):
                raise InvalidInputError(
                    f"dispersion table: {name} must be at least two finite numbers, got "
                    f"{values.size}"
                )
            object.__setattr__(self, name, tuple(values.tolist()))
        if len(self.wavelengths_nm) != len(self.indices):
            raise InvalidInputError(
                "dispersion table: wavelengths_nm and indices must be of one length, got "
                f"{len(self.wavelengths_nm)} and {len(self.indices)}"
            )
        steps = np.diff(self.wavelengths_nm)
        if not (np.all(steps > 0) and self.wavelengths_nm[0] > 0):
            raise InvalidInputError(
                "dispersion table: wavelengths_nm must be > 0 and increase; sort the table"
            )
        if min(self.indices) < 1.0:
            raise InvalidInputError(
                f"dispersion table: indices must be >= 1, got {min(self.indices):g}"
            )

    @property
    def range_nm(self) -> tuple[float, float]:
        """First and last wavelength of the table, nm."""
        return (self.wavelengths_nm[0], self.wavelengths_nm[-1])

    def evaluate(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """Refractive index, shape of the input."""
        return np.asarray(np.interp(wavelength_nm, self.wavelengths_nm, self.indices))


@dataclass(frozen=True)
class Medium:
    """An ocular medium: a name and a dispersion; homogeneous, unless it is a `GradientMedium`."""

    name: str
    dispersion: Dispersion

    def __post_init__(self) -> None:
        check_type("medium: name", self.name, str)
        if not hasattr(self.dispersion, "evaluate"):
            raise InvalidInputError(
                f"medium {self.name!r}: dispersion must be a dispersion formula, got "
                f"{type(self.dispersion).__name__}; a single index is ConstantIndex(n)"
            )

    @property
    def range_nm(self) -> tuple[float, float]:
        """The wavelengths at which the medium is defined, nm."""
        return self.dispersion.range_nm

    def index(self, wavelength_nm: np.ndarray | float) -> np.ndarray:
        """Refractive index at vacuum wavelengths in nm, shape of the input, float64.

        Raises
        ------
        InvalidInputError
            If a wavelength lies outside the range of the dispersion formula.
        """
        wavelength = check_array("wavelength_nm", wavelength_nm)
        low, high = self.range_nm
        if not np.all((wavelength >= low) & (wavelength <= high)):
            raise InvalidInputError(
                f"medium {self.name!r}: wavelength must lie between {low:g} and {high:g} nm, "
                f"the range of its dispersion formula, got {_outside(wavelength, low, high):g} nm"
            )
        return self.dispersion.evaluate(wavelength)


def _outside(values: np.ndarray, low: float, high: float) -> float:
    return float(values[~((values >= low) & (values <= high))].flat[0])


def _check_index(name: str, value: float) -> None:
    if check_finite(name, value) < 1.0:
        raise InvalidInputError(f"{name} must be >= 1 (refractive index), got {value:g}")


AIR = Medium("air", ConstantIndex(1.0))
