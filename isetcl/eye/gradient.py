"""Gradient-index media: lenses whose index changes from place to place.

z is measured from the vertex of the surface in front of the medium, along that surface's own axis,
and r from the axis, both in mm. A lens whose profile has a front and a rear half is two media
joined by a plane surface at the equator: its second derivative jumps there, and a step of an
integrator across the jump would be of second order only.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_finite,
    check_positive,
    check_type,
)
from isetcl.eye.media import Dispersion, Medium

MAX_Z_TERMS = 8
MAX_R_TERMS = 4


@dataclass(frozen=True)
class PolynomialGradient:
    """n = sum of c[i][j] z^i r^(2j) at one wavelength.

    Parameters
    ----------
    coefficients
        Rows are powers of z, columns powers of r^2; mm^-(i + 2j). Short rows are filled with
        zeros; up to 8 rows and 4 columns.

    Raises
    ------
    InvalidInputError
        If there are none or too many, or one is not finite.
    """

    coefficients: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        name = "polynomial gradient: coefficients"
        check_type(name, self.coefficients, (tuple, list), "pass rows of numbers")
        rows = [check_array(name, row).ravel() for row in self.coefficients]
        width = max((len(row) for row in rows), default=0)
        if not 1 <= len(rows) <= MAX_Z_TERMS or not 1 <= width <= MAX_R_TERMS:
            raise InvalidInputError(
                f"{name} must be 1 to {MAX_Z_TERMS} rows (powers of z) of 1 to {MAX_R_TERMS} "
                f"numbers (powers of r^2), got {len(rows)} rows of up to {width}"
            )
        for row in rows:
            for value in row:
                check_finite(name, float(value))
        filled = tuple(tuple(np.pad(row, (0, width - len(row))).tolist()) for row in rows)
        object.__setattr__(self, "coefficients", filled)

    @property
    def degree(self) -> int:
        """Largest i + 2 j of its z^i r^(2j), at least 2."""
        rows = enumerate(self.coefficients)
        return max([2, *(i + 2 * j for i, row in rows for j, c in enumerate(row) if c != 0.0)])

    def index(self, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Refractive index at points in mm, shape of the input."""
        return self._evaluate(np.square(x) + np.square(y), np.asarray(z))[0]

    def squared_and_half_gradient(
        self, x: np.ndarray, y: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """n^2, (...), and half the gradient of n^2, (..., 3), 1/mm, at points in mm."""
        n, by_z, by_s = self._evaluate(np.square(x) + np.square(y), np.asarray(z))
        across = 2.0 * n * by_s
        return n * n, np.stack([across * x, across * y, n * by_z], axis=-1)

    def axial(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """n0 and n1 of n = n0(z) + n1(z) r^2 + ... next to the axis, at z in mm."""
        n, _, by_s = self._evaluate(np.zeros_like(z), np.asarray(z))
        return n, by_s

    def _evaluate(self, s: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """n and its derivatives by z and by s = r^2."""
        n = by_z = by_s = np.zeros(np.broadcast(s, z).shape)
        for row in reversed(self.coefficients):
            value = slope = np.zeros_like(n)
            for c in reversed(row):
                slope = slope * s + value
                value = value * s + c
            by_z = by_z * z + n
            n = n * z + value
            by_s = by_s * z + slope
        return n, by_z, by_s


@dataclass(frozen=True)
class ShellGradient:
    """n = n_core - (n_core - n_edge) (zeta^2)^power at one wavelength.

    zeta^2 = ((z - centre_z) / semi_z)^2 + (r / semi_r)^2: the shells of equal index are ellipsoids,
    and `n_edge` is the index of the one with the given semi-axes.

    Parameters
    ----------
    n_core, n_edge
        Index at the centre and on the outermost shell.
    centre_z_mm
        Where the centre lies, mm behind the vertex of the surface in front.
    semi_z_mm, semi_r_mm
        Semi-axes of the outermost shell along and across the axis, mm.
    power
        Any number >= 1.

    Raises
    ------
    InvalidInputError
        If an index is below 1, a semi-axis is not positive or the power is below 1.
    """

    n_core: float
    n_edge: float
    centre_z_mm: float
    semi_z_mm: float
    semi_r_mm: float
    power: float

    def __post_init__(self) -> None:
        for name in ("n_core", "n_edge"):
            if check_finite(f"shell gradient: {name}", getattr(self, name)) < 1.0:
                raise InvalidInputError(
                    f"shell gradient: {name} must be >= 1 (refractive index), got "
                    f"{getattr(self, name):g}"
                )
        _check_shells("shell gradient", self)
        object.__setattr__(self, "power", float(self.power))

    def index(self, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Refractive index at points in mm, shape of the input."""
        q = self._shell(np.square(x) + np.square(y), z)
        return np.asarray(self.n_core - (self.n_core - self.n_edge) * q**self.power)

    def squared_and_half_gradient(
        self, x: np.ndarray, y: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """n^2, (...), and half the gradient of n^2, (..., 3), 1/mm, at points in mm."""
        q = self._shell(np.square(x) + np.square(y), z)
        less = (self.n_core - self.n_edge) * q ** (self.power - 1.0)
        n = self.n_core - less * q
        steep = -2.0 * self.power * n * less
        across = steep / self.semi_r_mm**2
        along = steep / self.semi_z_mm**2 * (z - self.centre_z_mm)
        return n * n, np.stack([across * x, across * y, along], axis=-1)

    def axial(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """n0 and n1 of n = n0(z) + n1(z) r^2 + ... next to the axis, at z in mm."""
        q = self._shell(np.zeros_like(z), z)
        less = (self.n_core - self.n_edge) * q ** (self.power - 1.0)
        return self.n_core - less * q, -self.power * less / self.semi_r_mm**2

    def _shell(self, s: np.ndarray, z: np.ndarray) -> np.ndarray:
        """zeta^2 at r^2 = s and z."""
        return np.asarray(
            np.square((z - self.centre_z_mm) / self.semi_z_mm) + s / self.semi_r_mm**2
        )


Gradient = PolynomialGradient | ShellGradient


@dataclass(frozen=True)
class GradientMedium(Medium):
    """A medium whose index changes from place to place: `PolynomialMedium` or `ShellMedium`.

    Its `index` is that at its origin, the vertex of the surface in front of it.
    """

    def gradient(self, wavelength_nm: float) -> Gradient:
        """The profile at a wavelength in nm.

        Raises
        ------
        InvalidInputError
            If the wavelength lies outside the range of the dispersion formula.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class PolynomialMedium(GradientMedium):
    """A polynomial gradient that dispersion shifts as a whole.

    n(lambda) = profile - profile at the origin + dispersion(lambda).

    Parameters
    ----------
    name, dispersion
        As of every medium; the dispersion is that of the index at the origin.
    profile
        The polynomial at any one wavelength.
    """

    profile: PolynomialGradient = PolynomialGradient(((1.0,),))

    def __post_init__(self) -> None:
        super().__post_init__()
        check_type(f"medium {self.name!r}: profile", self.profile, PolynomialGradient)

    def gradient(self, wavelength_nm: float) -> PolynomialGradient:
        """The profile at a wavelength in nm; see `GradientMedium`."""
        first, *others = self.profile.coefficients
        shifted = (float(self.index(wavelength_nm)), *first[1:])
        return PolynomialGradient((shifted, *others))


@dataclass(frozen=True)
class ShellMedium(GradientMedium):
    """Shells of equal index whose core and edge have dispersions of their own.

    Parameters
    ----------
    name
        For messages.
    dispersion
        That of the core.
    edge
        Dispersion of the outermost shell.
    centre_z_mm, semi_z_mm, semi_r_mm, power
        As of `ShellGradient`.
    """

    edge: Dispersion | None = None
    centre_z_mm: float = 0.0
    semi_z_mm: float = 1.0
    semi_r_mm: float = 1.0
    power: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        # The class of the edge is checked as that of any medium.
        Medium(f"{self.name}, edge", self.edge)  # type: ignore[arg-type]
        _check_shells(f"medium {self.name!r}", self)

    @property
    def range_nm(self) -> tuple[float, float]:
        """The wavelengths at which core and edge are both defined, nm."""
        assert self.edge is not None
        ranges = (self.dispersion.range_nm, self.edge.range_nm)
        return max(r[0] for r in ranges), min(r[1] for r in ranges)

    def index(self, wavelength_nm: np.ndarray | float) -> np.ndarray:
        """Refractive index at the origin; see `Medium.index`."""
        core, edge = self._core_and_edge(wavelength_nm)
        shell = (self.centre_z_mm / self.semi_z_mm) ** 2
        return np.asarray(core - (core - edge) * shell**self.power)

    def gradient(self, wavelength_nm: float) -> ShellGradient:
        """The profile at a wavelength in nm; see `GradientMedium`."""
        core, edge = (float(n) for n in self._core_and_edge(wavelength_nm))
        return ShellGradient(
            core, edge, self.centre_z_mm, self.semi_z_mm, self.semi_r_mm, self.power
        )

    def _core_and_edge(self, wavelength_nm: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        assert self.edge is not None
        return Medium.index(self, wavelength_nm), Medium(self.name, self.edge).index(wavelength_nm)

    def halves(
        self, rear_semi_z_mm: float, names: tuple[str, str]
    ) -> tuple[ShellMedium, ShellMedium]:
        """This front half, and the rear half behind the equator with its own axial semi-axis."""
        rear = dataclasses.replace(self, name=names[1], centre_z_mm=0.0, semi_z_mm=rear_semi_z_mm)
        return dataclasses.replace(self, name=names[0]), rear


def _check_shells(label: str, shells: ShellGradient | ShellMedium) -> None:
    check_finite(f"{label}: centre_z_mm", shells.centre_z_mm, "mm")
    check_positive(f"{label}: semi_z_mm", shells.semi_z_mm, "mm")
    check_positive(f"{label}: semi_r_mm", shells.semi_r_mm, "mm")
    if check_finite(f"{label}: power", shells.power) < 1.0:
        raise InvalidInputError(
            f"{label}: power must be >= 1, or the gradient is infinite at the centre, got "
            f"{shells.power:g}"
        )
