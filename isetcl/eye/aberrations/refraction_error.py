"""Refractive error of an eye: from a wavefront, along the axis, and over the field.

A refraction is the correcting lens in the entrance pupil, as a power vector (Thibos, Wheeler &
Horner 1997, Optom Vis Sci 74:367): M is the spherical equivalent, J0 and J45 the cylinder. A myopic
eye has M < 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_choice
from isetcl.eye.least_squares import least_squares
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.object_point import ObjectPoint
from isetcl.eye.waves import zernike
from isetcl.eye.waves.wavefront import Wavefront
from isetcl.units import MM_PER_M

RefractionDefinition = Literal["minimum_rms", "zernike", "seidel"]
FocusMetric = Literal["strehl", "rms", "mtf"]

_DEFINITIONS = ("minimum_rms", "zernike", "seidel")
_METRICS = ("strehl", "rms", "mtf")
_PARABASAL_MM = 1e-3
_ORDER = 8


@dataclass(frozen=True)
class Refraction:
    """The lens that corrects an eye, in the plane of its entrance pupil, dioptres.

    Attributes
    ----------
    m_dpt
        Spherical equivalent.
    j0_dpt, j45_dpt
        Jackson cylinders at 0 and 45 degrees: the lens has the power M + J0 along x and M - J0
        along y. x is the right of the eye that looks out; for an examiner J45 changes sign.
    """

    m_dpt: float
    j0_dpt: float
    j45_dpt: float

    @property
    def sphere_cylinder_axis(self) -> tuple[float, float, float]:
        """Sphere and (negative) cylinder in dioptres, and its axis in degrees from 0 to 180.

        The axis is anticlockwise from the right of the eye that looks out; an examiner, who writes
        prescriptions, sees 180 less that.
        """
        cross = math.hypot(self.j0_dpt, self.j45_dpt)
        # The cylinder acts across its axis; negative cylinder: the axis is the stronger meridian.
        axis = math.degrees(math.atan2(self.j45_dpt, self.j0_dpt)) / 2.0
        return self.m_dpt + cross, -2.0 * cross, axis % 180.0


def refraction(front: Wavefront, definition: RefractionDefinition = "minimum_rms") -> Refraction:
    """The correction of a wavefront.

    Parameters
    ----------
    front
        The wavefront. For an object at infinity this is the refraction of the eye; for a nearer one
        its vergence is part of the error.
    definition
        * ``"minimum_rms"``: the lens that leaves the smallest RMS, weighted by flux, over this very
          pupil. On a round, evenly lit pupil the same as ``"zernike"``.
        * ``"zernike"``: from Z(2, 0), Z(2, 2), Z(2, -2) of the fit of order 8 on the circle about
          the pupil, M = -4 sqrt(3) c / r^2, J0 = -2 sqrt(6) c / r^2 (ANSI Z80.28).
        * ``"seidel"``: from the curvature of that fit at the middle of the pupil, which is the
          paraxial refraction of that fit (Thibos et al. 2004, J Vis 4:329).

    Raises
    ------
    InvalidInputError
        If a Zernike fit is asked for and part of the pupil is vignetted.
    """
    check_choice("definition of refraction", definition, _DEFINITIONS)
    if definition == "minimum_rms":
        values, x, y, flux = front._listed()
        basis = np.stack(
            [np.ones_like(x), x, y, (x * x + y * y) / 2, (x * x - y * y) / 2, x * y], axis=1
        )
        found = least_squares(basis, values, flux)
        return Refraction(*(-float(v) for v in found[3:]))
    fit = front.zernike(_ORDER)
    if definition == "zernike":
        fit = zernike.ZernikeFit(fit.coefficients_um[:6], fit.radius_mm, fit.wavelength_nm)
    return _central_curvature(fit)


def _central_curvature(fit: zernike.ZernikeFit) -> Refraction:
    """The refraction that a wavefront has at the middle of its pupil."""
    powers = []
    for m in (0, 2, -2):
        terms = (
            fit.coefficient_um(n, m)
            * zernike.norm(n, m)
            * float(zernike.radial_coefficients(n, m)[2])
            for n in range(2, fit.order + 1, 2)
        )
        # W = a rho^2: a lens of -2 a / r^2.
        powers.append(-2.0 * sum(terms) / fit.radius_mm**2)
    return Refraction(*powers)


def through_focus(
    front: Wavefront,
    vergences_dpt: np.ndarray | Sequence[float],
    metric: FocusMetric = "strehl",
    frequency_cpd: float = 10.0,
) -> np.ndarray:
    """A measure of image quality for objects nearer by each of some vergences, (n,).

    Parameters
    ----------
    front
        The wavefront of the object at 0.
    vergences_dpt
        How much nearer, 1/m; see `Wavefront.defocused`.
    metric
        ``"strehl"``, ``"rms"`` (um; smaller is better) or ``"mtf"`` (mean over directions at
        `frequency_cpd`).
    frequency_cpd
        Frequency for ``"mtf"``, cycles/degree.
    """
    measure = _measure(metric, frequency_cpd)
    values = np.atleast_1d(check_array("vergences_dpt", vergences_dpt))
    return np.array([measure(front.defocused(float(v))) for v in values])


def best_focus_dpt(
    front: Wavefront, metric: FocusMetric = "strehl", frequency_cpd: float = 10.0
) -> float:
    """How much nearer an object is seen best, 1/m, by a measure of `through_focus`.

    Searched about the focus of least RMS, first on a grid finer than the depth of focus, as there
    may be several maxima. Where the samples are too few for the defocus, the image is not the best.
    """
    from scipy.optimize import minimize_scalar

    measure = _measure(metric, frequency_cpd)
    start = -refraction(front).m_dpt
    if metric == "rms":
        return start
    # A quarter wave at the rim: lambda / (2 r^2), um / mm^2 = 1/m.
    depth = front.wavelength_nm * 1e-3 / (2.0 * front.entrance_radius_mm**2)
    reach = max(6.0 * depth, abs(start - -refraction(front, "seidel").m_dpt) + depth)
    grid = start + np.arange(-reach, reach + depth / 2, depth / 1.5)
    fronts = [front.defocused(float(v)) for v in grid]
    heights = [measure(f) if f.is_sampled else -np.inf for f in fronts]
    best = float(grid[int(np.argmax(heights))])
    found = minimize_scalar(
        lambda v: -measure(front.defocused(float(v))),
        bounds=(best - depth, best + depth),
        method="bounded",
        options={"xatol": 1e-4},
    )
    return float(found.x)


def _measure(metric: FocusMetric, frequency_cpd: float) -> Callable[[Wavefront], float]:
    check_choice("focus metric", metric, _METRICS)
    if metric == "strehl":
        return lambda front: front.strehl()
    if metric == "rms":
        return lambda front: front.rms_um
    return lambda front: float(front.otf().mtf([frequency_cpd])[0])


@dataclass(frozen=True, eq=False)
class ObliqueFoci:
    """Line foci over the field: the refraction of narrow pencils about chief rays.

    Attributes
    ----------
    field_deg : ndarray, (n,)
        Angles from the axis.
    tangential_dpt, sagittal_dpt : ndarray, (n,)
        Refraction in the plane of the chief ray and the axis, and across it, at the entrance pupil:
        negative where that line focus lies in front of the retina.
    """

    field_deg: np.ndarray
    tangential_dpt: np.ndarray
    sagittal_dpt: np.ndarray

    @property
    def field_curvature_dpt(self) -> np.ndarray:
        """Mean of both, M, less that on the axis if the first angle is 0, dpt, (n,)."""
        mean = (self.tangential_dpt + self.sagittal_dpt) / 2.0
        return mean - mean[0] if self.field_deg[0] == 0 else mean

    @property
    def astigmatism_dpt(self) -> np.ndarray:
        """Tangential less sagittal, dpt, (n,)."""
        return self.tangential_dpt - self.sagittal_dpt


def oblique_foci(
    eye: Eye,
    field_deg: np.ndarray | Sequence[float] | float,
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
) -> ObliqueFoci:
    """Tangential and sagittal refraction of an eye at field angles, upwards.

    For other directions, and the oblique part of an eye that is no figure of revolution, see
    `isetcl.eye.astigmatism.pencil_refraction`.

    Of two rays that enter parallel, dp apart in the entrance pupil, one is turned by dtheta so that
    both meet the retina at one point: dtheta/dp is the vergence that the correcting lens gives.

    Parameters
    ----------
    field_deg
        Angles from the axis, degrees.
    wavelength_nm
        Wavelength, nm.

    Raises
    ------
    InvalidInputError
        If no chief ray enters from there.
    """
    angles = np.atleast_1d(check_array("field_deg", field_deg))
    pairs = np.array([_oblique_pair(eye, float(a), wavelength_nm) for a in angles])
    return ObliqueFoci(angles, pairs[:, 0], pairs[:, 1])


def _oblique_pair(eye: Eye, angle_deg: float, wavelength_nm: float) -> tuple[float, float]:
    source = ObjectPoint(eye, (0.0, angle_deg), wavelength_nm)
    chief = source.chief()
    h = _PARABASAL_MM
    steps = h * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    moved = source.trace(chief.entrance_mm + steps)
    turned = source.turned(chief.entrance_mm, steps)
    if not (moved.passed.all() and turned.passed.all()):
        raise InvalidInputError(
            f"eye {eye.name!r}: rays about the chief ray from {angle_deg:g} deg do not pass; use a "
            "smaller field angle"
        )
    by_place = (moved.point_mm[::2] - moved.point_mm[1::2]) / (2.0 * h)
    by_angle = (turned.point_mm[::2] - turned.point_mm[1::2]) / (2.0 * h)
    # Along the direction in which the point moves; x is sagittal here and y tangential. `turned`
    # turns the object, against the slope of the ray.
    ratio = -np.sum(by_place * by_angle, axis=1) / np.sum(by_angle**2, axis=1)
    return float(ratio[1]) * MM_PER_M, float(ratio[0]) * MM_PER_M


def longitudinal_spherical_aberration_dpt(
    eye: Eye,
    heights_mm: np.ndarray | Sequence[float],
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
) -> np.ndarray:
    """Power of the eye for rays that enter at heights, more than that on the axis, dpt, (n,).

    A ray parallel to the axis at height h crosses the axis at z(h); its power is n' over the
    distance from the second principal point to there. Positive for the usual, undercorrected eye.

    Parameters
    ----------
    heights_mm
        Heights > 0 of the incoming rays, mm. The stop does not count.
    wavelength_nm
        Wavelength, nm.

    Raises
    ------
    InvalidInputError
        If a ray does not pass the eye, or a surface of it is no figure of revolution.
    """
    if not all(surface.is_rotational for surface in eye.surfaces):
        raise InvalidInputError(
            "longitudinal spherical aberration belongs to figures of revolution, in which rays "
            f"cross the axis again; for eye {eye.name!r} fit Zernike polynomials"
        )
    heights = np.atleast_1d(check_array("heights_mm", heights_mm))
    if not np.all(heights > 0):
        raise InvalidInputError(f"heights_mm must be > 0 mm, got {heights.tolist()}")
    source = ObjectPoint(eye, (0.0, 0.0), wavelength_nm)
    rays = source.trace(np.stack([np.zeros_like(heights), heights], axis=1))
    if not rays.passed.all():
        raise InvalidInputError(
            f"eye {eye.name!r}: the ray at {heights[~rays.passed][0]:g} mm does not reach the "
            "retina; use smaller heights or larger semi-diameters"
        )
    crossing = rays.point_mm[:, 2] - rays.point_mm[:, 1] * (
        rays.direction[:, 2] / rays.direction[:, 1]
    )
    cardinal = eye.cardinal_points(wavelength_nm)
    power = MM_PER_M * source.index_after / (crossing - cardinal.principal_point_back_mm)
    return np.asarray(power - cardinal.power_dpt)
