"""Gaussian optics of an eye: power, cardinal points, pupils.

Rays are (y, n u): height in mm and index times slope. A surface of power (n' - n) c takes n u to
n u - y (n' - n) c; a gap t takes y to y + t n u / n (Smith & Atchison 1997, appendix 1).
A gradient takes (y, n u) along by the paraxial equation (n0 y')' = 2 n1 y, n = n0(z) + n1(z) r^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.eye.model import Eye
from isetcl.eye.prescription import placed_gradients
from isetcl.units import MM_PER_M


@dataclass(frozen=True)
class CardinalPoints:
    """Cardinal points of an eye at one wavelength, positions in mm behind the corneal vertex.

    Attributes
    ----------
    power_dpt
        Equivalent power, 1/m.
    focal_length_front_mm, focal_length_back_mm
        f = -n/P (negative) and f' = n'/P.
    focal_point_front_mm, focal_point_back_mm
        F and F'.
    principal_point_front_mm, principal_point_back_mm
        H and H'.
    nodal_point_front_mm, nodal_point_back_mm
        N and N'.
    """

    power_dpt: float
    focal_length_front_mm: float
    focal_length_back_mm: float
    focal_point_front_mm: float
    focal_point_back_mm: float
    principal_point_front_mm: float
    principal_point_back_mm: float
    nodal_point_front_mm: float
    nodal_point_back_mm: float


@dataclass(frozen=True)
class Pupil:
    """A paraxial image of the stop.

    Attributes
    ----------
    z_mm
        Position behind the corneal vertex.
    magnification
        Diameter of the pupil over the diameter of the stop.
    diameter_mm
        Diameter of the pupil.
    """

    z_mm: float
    magnification: float
    diameter_mm: float

    @property
    def radius_mm(self) -> float:
        """Radius of the pupil, mm."""
        return self.diameter_mm / 2.0


def system_matrix(
    eye: Eye, wavelength_nm: float, first: int = 0, last: int | None = None
) -> np.ndarray:
    """Ray matrix from the vertex of surface `first` through surface `last` - 1, shape (2, 2).

    Includes the refractions at both ends; acts on the column (y in mm, n u).
    """
    index = eye.indices(wavelength_nm)
    surfaces = eye.surfaces
    last = len(surfaces) if last is None else last
    matrix = np.eye(2)
    gradients = placed_gradients(eye, wavelength_nm)
    for i in range(first, last):
        n_before, inside = index[i], gradients[i]
        if i > 0 and inside is not None:
            gap = surfaces[i].vertex_z_mm - surfaces[i - 1].vertex_z_mm
            n_before = inside.profile.axial(np.array([gap]))[0][0]
        if i > first:
            gap = surfaces[i].vertex_z_mm - surfaces[i - 1].vertex_z_mm
            along = _transfer(gap / index[i]) if inside is None else inside.ray_matrix(0.0, gap)
            matrix = along @ matrix
        bend_x, _, bend_y = surfaces[i].vertex_curvatures()
        power = (index[i + 1] - n_before) * (bend_x + bend_y) / 2.0
        matrix = np.array([[1.0, 0.0], [-power, 1.0]]) @ matrix
    return matrix


def cardinal_points(eye: Eye, wavelength_nm: float) -> CardinalPoints:
    """Focal, principal and nodal points of an eye at a wavelength in nm.

    Raises
    ------
    InvalidInputError
        If the eye has no power, or the wavelength lies outside the range of a medium.
    """
    matrix = system_matrix(eye, wavelength_nm)
    a, c, d = float(matrix[0, 0]), float(matrix[1, 0]), float(matrix[1, 1])
    if c == 0:
        raise InvalidInputError(f"eye {eye.name!r} has no power, so it has no cardinal points")
    index = eye.indices(wavelength_nm)
    n, n_image = float(index[0]), float(index[-1])
    front_length, back_length = n / c, -n_image / c
    front_focus = eye.surfaces[0].vertex_z_mm + n * d / c
    back_focus = eye.surfaces[-1].vertex_z_mm - n_image * a / c
    return CardinalPoints(
        power_dpt=-c * MM_PER_M,
        focal_length_front_mm=front_length,
        focal_length_back_mm=back_length,
        focal_point_front_mm=front_focus,
        focal_point_back_mm=back_focus,
        principal_point_front_mm=front_focus - front_length,
        principal_point_back_mm=back_focus - back_length,
        nodal_point_front_mm=front_focus + back_length,
        nodal_point_back_mm=back_focus + front_length,
    )


def entrance_pupil(eye: Eye, wavelength_nm: float) -> Pupil:
    """The stop imaged into the scene by the surfaces in front of it."""
    index = eye.indices(wavelength_nm)
    i = eye.stop_index
    matrix = system_matrix(eye, wavelength_nm, 0, i)
    if i > 0:
        gap = eye.stop.z_mm - eye.surfaces[i - 1].vertex_z_mm
        matrix = _transfer(gap / index[i]) @ matrix
        z = eye.surfaces[0].vertex_z_mm + float(index[0] * matrix[0, 1] / matrix[0, 0])
    else:
        z = eye.stop.z_mm
    magnification = 1.0 / float(matrix[0, 0])
    return Pupil(z, magnification, eye.stop.diameter_mm * magnification)


def exit_pupil(eye: Eye, wavelength_nm: float) -> Pupil:
    """The stop imaged into the vitreous by the surfaces behind it."""
    index = eye.indices(wavelength_nm)
    i = eye.stop_index
    if i == len(eye.surfaces):
        return Pupil(eye.stop.z_mm, 1.0, eye.stop.diameter_mm)
    gap = eye.surfaces[i].vertex_z_mm - eye.stop.z_mm
    matrix = system_matrix(eye, wavelength_nm, i) @ _transfer(gap / index[i])
    z = eye.surfaces[-1].vertex_z_mm - float(index[-1] * matrix[0, 1] / matrix[1, 1])
    magnification = 1.0 / float(matrix[1, 1])
    return Pupil(z, magnification, eye.stop.diameter_mm * magnification)


def object_vergence_dpt(eye: Eye, wavelength_nm: float) -> float:
    """Vergence (1/m from the corneal vertex) of the axial object imaged on the retina, paraxially.

    0 is infinity; negative means a virtual object (hyperopia).
    """
    index = eye.indices(wavelength_nm)
    gap = eye.retina.vertex_z_mm - eye.surfaces[-1].vertex_z_mm
    matrix = _transfer(gap / index[-1]) @ system_matrix(eye, wavelength_nm)
    # Of an object s in front of the first surface, y = s u there; A s / n + B = 0 at its image.
    start = eye.surfaces[0].vertex_z_mm
    return float(-MM_PER_M * matrix[0, 0] / (index[0] * matrix[0, 1] + start * matrix[0, 0]))


def _transfer(reduced_gap: float) -> np.ndarray:
    return np.array([[1.0, reduced_gap], [0.0, 1.0]])
