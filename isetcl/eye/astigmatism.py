"""Astigmatic eyes: power matrices, principal meridians, and refractions of narrow pencils.

A ray is (x, y, n ux, n uy) and an eye a matrix of 4 x 4 made of blocks of 2 x 2, in which a
surface's power is the matrix (n' - n) times the second derivatives of its sag (Keating 1981, Am J
Optom Physiol Opt 58:810; Harris 1997, Optom Vis Sci 74:349). Decentrations and tilts are left out:
they bend the axis, but to first order not the powers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.eye.aberrations.refraction_error import Refraction
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.object_point import ObjectPoint
from isetcl.eye.prescription import placed_gradients
from isetcl.units import MM_PER_M

_PARABASAL_MM = 1e-3


@dataclass(frozen=True)
class PrincipalMeridians:
    """The two directions in which an astigmatic eye bends light most and least.

    Attributes
    ----------
    power_dpt
        Equivalent powers, 1/m, the stronger first.
    axis_deg
        Direction of the stronger meridian, degrees from +x towards +y in the eye frame, 0 to 180.
    """

    power_dpt: tuple[float, float]
    axis_deg: float

    @property
    def mean_dpt(self) -> float:
        """Mean power, 1/m."""
        return sum(self.power_dpt) / 2.0

    @property
    def cylinder_dpt(self) -> float:
        """Stronger less weaker power, 1/m."""
        return self.power_dpt[0] - self.power_dpt[1]


def astigmatic_matrix(eye: Eye, wavelength_nm: float = REFERENCE_WAVELENGTH_NM) -> np.ndarray:
    """Ray matrix from the first vertex through the last surface, (4, 4); lengths in mm.

    Acts on the column (x, y, n ux, n uy).

    Raises
    ------
    InvalidInputError
        If the wavelength lies outside the range of a medium.
    """
    index = eye.indices(wavelength_nm)
    gradients = placed_gradients(eye, wavelength_nm)
    matrix = np.eye(4)
    for i, surface in enumerate(eye.surfaces):
        n_before, inside = index[i], gradients[i]
        if i > 0:
            gap = surface.vertex_z_mm - eye.surfaces[i - 1].vertex_z_mm
            along = _transfer(gap / index[i])
            if inside is not None:
                n_before = inside.profile.axial(np.array([gap]))[0][0]
                along = np.kron(inside.ray_matrix(0.0, gap), np.eye(2))
            matrix = along @ matrix
        xx, xy, yy = surface.vertex_curvatures()
        bend = np.eye(4)
        bend[2:, :2] = -(index[i + 1] - n_before) * np.array([[xx, xy], [xy, yy]])
        matrix = bend @ matrix
    return matrix


def power_matrix_dpt(eye: Eye, wavelength_nm: float = REFERENCE_WAVELENGTH_NM) -> np.ndarray:
    """Equivalent power as a matrix over the eye's x and y, (2, 2), 1/m.

    Light along the axis at (x, y) m is turned by -F (x, y) rad times the index behind.

    Raises
    ------
    InvalidInputError
        If the wavelength lies outside the range of a medium.
    """
    return -astigmatic_matrix(eye, wavelength_nm)[2:, :2] * MM_PER_M


def principal_meridians(
    eye: Eye, wavelength_nm: float = REFERENCE_WAVELENGTH_NM
) -> PrincipalMeridians:
    """Powers and directions of the principal meridians.

    Of the symmetric part of the power matrix: astigmatic surfaces at oblique axes, apart, also turn
    the image a little.

    Raises
    ------
    InvalidInputError
        If the wavelength lies outside the range of a medium.
    """
    power = power_matrix_dpt(eye, wavelength_nm)
    values, vectors = np.linalg.eigh((power + power.T) / 2.0)
    axis = math.degrees(math.atan2(vectors[1, 1], vectors[0, 1])) % 180.0
    return PrincipalMeridians((float(values[1]), float(values[0])), axis)


def paraxial_refraction(eye: Eye, wavelength_nm: float = REFERENCE_WAVELENGTH_NM) -> Refraction:
    """The thin lens at the corneal vertex that makes an eye see infinity sharp, paraxially.

    It turns light along the axis by n u = -L (x, y), which is imaged on the retina if B L = A with
    (A, B) the upper half of the matrix from there to the retina.

    Raises
    ------
    InvalidInputError
        If the eye has no power, or the wavelength lies outside the range of a medium.
    """
    index = eye.indices(wavelength_nm)
    gap = eye.retina.vertex_z_mm - eye.surfaces[-1].vertex_z_mm
    start = eye.surfaces[0].vertex_z_mm
    matrix = _transfer(gap / index[-1]) @ astigmatic_matrix(eye, wavelength_nm)
    matrix = matrix @ _transfer(start / index[0])
    try:
        lens = np.linalg.solve(matrix[:2, 2:], matrix[:2, :2]) * MM_PER_M
    except np.linalg.LinAlgError:
        raise InvalidInputError(f"eye {eye.name!r} sees no point of its retina") from None
    (xx, xy), (yx, yy) = lens.tolist()
    return Refraction((xx + yy) / 2.0, (xx - yy) / 2.0, (xy + yx) / 2.0)


def pencil_refraction(
    eye: Eye,
    field_deg: tuple[float, float] | float = (0.0, 0.0),
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
) -> Refraction:
    """The refraction of a narrow pencil about a chief ray, in the entrance pupil, by real rays.

    Of two rays that enter parallel, dp apart, one is turned by L dp so that both meet the retina at
    one point: L is the matrix of the correcting lens. Its axes are the right and the up of the eye
    that looks along the chief ray. `oblique_foci` gives the same along and across one meridian.

    Parameters
    ----------
    field_deg
        Field angles (x, y) of the chief ray, degrees; a single number is (0, y).
    wavelength_nm
        Wavelength, nm.

    Raises
    ------
    InvalidInputError
        If no chief ray enters from there, or rays about it do not pass.
    """
    source = ObjectPoint(eye, field_deg, wavelength_nm)
    chief = source.chief()
    h = _PARABASAL_MM
    steps = h * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    moved = source.trace(chief.entrance_mm + steps)
    turned = source.turned(chief.entrance_mm, steps)
    if not (moved.passed.all() and turned.passed.all()):
        raise InvalidInputError(
            f"eye {eye.name!r}: rays about the chief ray from field {source.field_deg} deg do not "
            "pass; use a smaller field angle"
        )
    by_place = moved.point_mm[::2] - moved.point_mm[1::2]
    by_angle = turned.point_mm[::2] - turned.point_mm[1::2]
    # `turned` turns the object, against the slope of the ray.
    (xx, xy), (yx, yy) = (-by_place @ np.linalg.pinv(by_angle) * MM_PER_M).tolist()
    return Refraction((xx + yy) / 2.0, (xx - yy) / 2.0, (xy + yx) / 2.0)


def _transfer(reduced_gap: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:2, 2:] = reduced_gap * np.eye(2)
    return matrix
