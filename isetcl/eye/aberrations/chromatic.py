"""Chromatic aberration: how focus and place of the image change with wavelength."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from isetcl.errors import check_choice
from isetcl.eye.focus import focus_vergence_dpt
from isetcl.eye.model import Eye, FocusCriterion, check_eye_wavelengths
from isetcl.eye.object_point import ObjectPoint
from isetcl.eye.visual_angle import retinal_scale, visual_angle_deg
from isetcl.spectrum import check_wavelengths
from isetcl.units import ARCMIN_PER_DEG, MM_PER_M

Plane = Literal["cornea", "principal"]

LCA_REFERENCE_NM = 589.3
"""Sodium D lines, nm: where chromatic difference of refraction is usually set to 0."""


def lca_dpt(
    eye: Eye,
    wavelengths_nm: np.ndarray | Sequence[float],
    reference_nm: float = LCA_REFERENCE_NM,
    criterion: FocusCriterion = "paraxial",
    plane: Plane = "cornea",
) -> np.ndarray:
    """Longitudinal chromatic aberration: refraction less that at the reference, dpt, (n,).

    Negative in the blue, where the eye is myopic.

    Parameters
    ----------
    wavelengths_nm
        Wavelengths, ascending, nm.
    reference_nm
        Where the result is 0, nm.
    criterion
        How focus is judged; see `Eye.focus_at`.
    plane
        Where the vergences are measured: ``"cornea"``, or ``"principal"``, the front principal
        point of each wavelength, where refraction is n'/L' - P.

    Raises
    ------
    InvalidInputError
        If a wavelength lies outside the range of a medium.
    """
    grid = check_wavelengths(wavelengths_nm)
    check_eye_wavelengths(eye, grid)
    check_choice("plane", plane, ("cornea", "principal"))

    def vergence(wavelength_nm: float) -> float:
        at_cornea = focus_vergence_dpt(eye, wavelength_nm, criterion)
        if plane == "cornea":
            return at_cornea
        gap_m = eye.cardinal_points(wavelength_nm).principal_point_front_mm / MM_PER_M
        return at_cornea / (1.0 + at_cornea * gap_m)

    return vergence(reference_nm) - np.array([vergence(float(w)) for w in grid])


def tca_arcmin(
    eye: Eye,
    field_deg: tuple[float, float] | float,
    wavelengths_nm: np.ndarray | Sequence[float],
    reference_nm: float = LCA_REFERENCE_NM,
    object_distance_m: float = math.inf,
) -> np.ndarray:
    """Transverse chromatic aberration: where the image lies, less that at the reference, (n, 2).

    Chief rays of every wavelength from one object point, and the distance of their points on the
    retina in arcmin of visual angle to the right and up. Positive along the field angle where the
    image lies farther from the axis than at the reference.

    Parameters
    ----------
    field_deg
        Field angles (x, y) of the chief ray at the reference wavelength, degrees; one number is
        (0, y).
    wavelengths_nm
        Wavelengths, ascending, nm.
    reference_nm
        Wavelength of the reference, nm.
    object_distance_m
        Distance of the object plane from the corneal vertex, m.

    Raises
    ------
    InvalidInputError
        If a wavelength lies outside the range of a medium, or no chief ray enters from there.
    """
    grid = check_wavelengths(wavelengths_nm)
    check_eye_wavelengths(eye, grid)
    reference = ObjectPoint(eye, field_deg, reference_nm, object_distance_m)
    origin = reference.chief().point_mm[0]
    scale = retinal_scale(eye.retina, reference.map, reference.field_deg)
    places = [
        reference.at_wavelength(float(wavelength)).chief().point_mm[0] - origin
        for wavelength in grid
    ]
    return visual_angle_deg(np.array(places), scale) * ARCMIN_PER_DEG
