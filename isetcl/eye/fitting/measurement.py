"""Measured wavefronts of an eye at field positions, and what an eye model would measure there.

An aberrometer samples the wavefront over a circle in the entrance pupil, at right angles to the
chief ray, and reports Zernike coefficients. The model's coefficients are the means of wavefront
times polynomial over the same circle, by Gaussian quadrature: few rays, and no fit.
"""

from __future__ import annotations

import functools
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
    check_type,
)
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.object_point import ObjectPoint, check_field
from isetcl.eye.waves.wavefront_trace import path_to_sphere, sphere_radius_mm
from isetcl.eye.waves.zernike import (
    MAX_ORDER,
    ZernikeFit,
    ZernikeOrder,
    noll_nm,
    norm,
    osa_index,
    osa_nm,
    polynomials,
)
from isetcl.units import UM_PER_MM, vergence_from_distance

Normalisation = Literal["orthonormal", "peak"]
Side = Literal["eye", "examiner"]

_EXTRA_RINGS = 4
_EXTRA_SPOKES = 9


@dataclass(frozen=True, eq=False)
class ZernikeMeasurement:
    """A wavefront measured at one field position.

    Parameters
    ----------
    field_deg
        Field angles (x, y) of the measuring beam, degrees; a single number is (0, y).
    zernike
        The wavefront, in um over a circle of the entrance pupil, in the sense of `Wavefront`:
        positive where the wave is ahead, +x to the right of the eye that looks out.
    object_distance_m
        Distance of the point source in front of the corneal vertex, m; infinity is an aberrometer
        that corrects nothing.

    Raises
    ------
    InvalidInputError
        If a value breaks its rule.
    """

    field_deg: tuple[float, float]
    zernike: ZernikeFit
    object_distance_m: float = math.inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "field_deg", check_field(self.field_deg))
        check_type("zernike of a measurement", self.zernike, ZernikeFit)
        vergence_from_distance(self.object_distance_m)

    @classmethod
    def from_coefficients(
        cls,
        field_deg: tuple[float, float] | float,
        coefficients: Sequence[float] | np.ndarray,
        *,
        radius_mm: float,
        wavelength_nm: float,
        order: ZernikeOrder = "osa",
        normalisation: Normalisation = "orthonormal",
        unit: Literal["um", "waves"] = "um",
        side: Side = "eye",
        object_distance_m: float = math.inf,
    ) -> ZernikeMeasurement:
        """A measurement from a list of coefficients in any of the usual conventions.

        Parameters
        ----------
        coefficients
            All polynomials up to a radial order, piston first.
        radius_mm
            Radius of the circle, mm.
        wavelength_nm
            Wavelength of the measuring light, nm.
        order
            ``"osa"`` or ``"noll"``.
        normalisation
            ``"orthonormal"`` (OSA/ANSI, Noll) or ``"peak"`` (Born & Wolf: polynomials whose radial
            part is 1 at the rim).
        unit
            ``"um"``, or ``"waves"`` of the measuring light.
        side
            ``"eye"``: +x to the right of the eye that looks out. ``"examiner"``: as the examiner
            who faces the eye sees it, the drawing of ANSI Z80.28.

        Raises
        ------
        InvalidInputError
            If the list does not hold full radial orders, or a convention is unknown.
        """
        values = check_array("coefficients", coefficients)
        check_choice("order of Zernike polynomials", order, ("osa", "noll"))
        check_choice("normalisation", normalisation, ("orthonormal", "peak"))
        check_choice("unit", unit, ("um", "waves"))
        check_choice("side", side, ("eye", "examiner"))
        if unit == "waves":
            values = values * check_positive("wavelength_nm", wavelength_nm, "nm") / 1000.0
        # The count and the numbers are checked here, before anything is moved.
        found = ZernikeFit(values, radius_mm, wavelength_nm)
        values = in_osa_order(found.coefficients_um, order, normalisation)
        found = ZernikeFit(values, radius_mm, wavelength_nm)
        if side == "examiner":
            found = found.mirrored()
        return cls(check_field(field_deg), found, object_distance_m)


def in_osa_order(
    values: np.ndarray, order: ZernikeOrder, normalisation: Normalisation
) -> np.ndarray:
    """Coefficients of full radial orders as orthonormal ones in OSA order, (terms,)."""
    pairs = [osa_nm(j) if order == "osa" else noll_nm(j + 1) for j in range(len(values))]
    result = np.zeros(len(values))
    for (n, m), value in zip(pairs, values, strict=True):
        result[osa_index(n, m)] = value / norm(n, m) if normalisation == "peak" else value
    return result


def measure(
    eye: Eye,
    field_deg: tuple[float, float] | float = (0.0, 0.0),
    *,
    radius_mm: float,
    order: int = 4,
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
    object_distance_m: float = math.inf,
) -> ZernikeMeasurement:
    """What an aberrometer would measure in a model eye: Zernike coefficients over a circle.

    The stop does not cut the circle: it may be larger than the eye's own pupil.

    Parameters
    ----------
    field_deg, wavelength_nm, object_distance_m
        As in `Eye.wavefront`.
    radius_mm
        Radius of the circle in the entrance pupil, mm.
    order
        Largest radial order.

    Raises
    ------
    InvalidInputError
        If a ray of the circle does not reach the retina, or an argument breaks its rule.
    """
    radius = check_positive("radius_mm", radius_mm, "mm")
    order = check_count("order", order, 0, MAX_ORDER)
    source = ObjectPoint(eye, field_deg, wavelength_nm, object_distance_m)
    points, weighted = _quadrature(order)
    rays = source.trace(radius * points)
    if not rays.passed.all():
        raise InvalidInputError(
            f"eye {eye.name!r}: {np.count_nonzero(~rays.passed)} of {len(points)} rays of a pupil "
            f"of radius {radius:g} mm from field {source.field_deg} deg do not reach the retina; "
            "use a smaller radius_mm or field angle"
        )
    chief = source.chief()
    centre = chief.point_mm[0]
    sphere = sphere_radius_mm(source, centre)
    paths = [path_to_sphere(r, centre, sphere, source.index_after)[0] for r in (chief, rays)]
    coefficients = weighted @ ((paths[0] - paths[1]) * UM_PER_MM)
    fitted = ZernikeFit(coefficients, radius, wavelength_nm)
    return ZernikeMeasurement(source.field_deg, fitted, object_distance_m)


@functools.lru_cache(maxsize=8)
def _quadrature(order: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of the unit disc (n, 2), and polynomials times weights there (terms, n).

    Exact for wavefronts of some orders more than `order`.
    """
    x, w = np.polynomial.legendre.leggauss(order + _EXTRA_RINGS)
    spokes = 2 * order + _EXTRA_SPOKES
    radius = np.sqrt((x + 1.0) / 2.0)
    turn = 2.0 * np.pi * np.arange(spokes) / spokes
    points = radius[:, None, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    points = points.reshape(-1, 2)
    share = np.repeat(w / 2.0, spokes) / spokes
    return points, polynomials(order, *points.T) * share
