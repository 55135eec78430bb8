"""Ray fans: where rays of the two principal sections land, against where they enter."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import check_count, check_finite
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.object_point import ObjectPoint
from isetcl.eye.stop import Stop
from isetcl.eye.visual_angle import retinal_scale, visual_angle_deg
from isetcl.units import ARCMIN_PER_DEG


@dataclass(frozen=True, eq=False)
class RayFan:
    """Rays of the tangential and the sagittal section of one object point; n rays each.

    Attributes
    ----------
    pupil : ndarray, (n,)
        Where rays meet the stop, -1 to 1 across it: upwards (tangential) or to the right.
    tangential_arcmin, sagittal_arcmin : ndarray, (n,)
        Transverse aberration: the visual angle from the chief ray of the reference wavelength,
        upwards for the tangential section and to the right for the sagittal one. NaN where a ray
        is lost.
    field_deg, wavelength_nm
        Of the object point.
    """

    pupil: np.ndarray
    tangential_arcmin: np.ndarray
    sagittal_arcmin: np.ndarray
    field_deg: float
    wavelength_nm: float


def ray_fan(
    eye: Eye,
    field_deg: float = 0.0,
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
    *,
    reference_nm: float | None = None,
    object_distance_m: float = math.inf,
    rays: int = 81,
) -> RayFan:
    """The ray fan of an object point.

    Parameters
    ----------
    field_deg
        Field angle upwards, degrees.
    wavelength_nm
        Wavelength of the rays, nm.
    reference_nm
        Wavelength of the chief ray that is the origin, nm; None is `wavelength_nm`. Another one
        shows the transverse chromatic aberration as well.
    object_distance_m
        Distance of the object plane from the corneal vertex, m.
    rays
        Rays of each section.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule, or no chief ray enters from there.
    """
    field = check_finite("field_deg", field_deg, "deg")
    count = check_count("rays", rays, 3, 10001)
    origin = ObjectPoint(
        eye, field, wavelength_nm if reference_nm is None else reference_nm, object_distance_m
    )
    scale = retinal_scale(eye.retina, origin.map, origin.field_deg)
    middle = origin.chief().point_mm[0]
    source = origin.at_wavelength(wavelength_nm)
    pupil = np.linspace(-1.0, 1.0, count)
    sections = []
    for column in (1, 0):
        stop = np.tile(eye.stop.decentre_mm, (count, 1))
        # A ray on the very rim may be lost to rounding.
        stop[:, column] += half_chord_mm(eye.stop, column) * (1.0 - 1e-9) * pupil
        points, found = source.aim(stop)
        traced = source.trace(points)
        seen = visual_angle_deg(traced.point_mm - middle, scale)[:, column] * ARCMIN_PER_DEG
        sections.append(np.where(found & traced.passed, seen, np.nan))
    return RayFan(pupil, sections[0], sections[1], field, source.wavelength_nm)


def half_chord_mm(stop: Stop, axis: int) -> float:
    """Distance from the middle of a stop to its rim along x (0) or y (1), mm."""
    step = np.array(stop.decentre_mm)
    step[axis] += 1.0
    return 1.0 / float(np.linalg.norm(stop.disc_of(step)))
