"""What lenses that are put in front of an eye or into it share: prescriptions, radii, places.

Prescriptions are written as opticians do: sphere and cylinder in dioptres, the axis in degrees as
an examiner sees it who faces the eye, anticlockwise from the examiner's right (ISO 8429, TABO).
"""

from __future__ import annotations

import math

import numpy as np

from isetcl.errors import check_between
from isetcl.eye.media import Medium
from isetcl.eye.placement import Placement
from isetcl.eye.shapes.toric import Toric
from isetcl.eye.surface import Surface
from isetcl.units import MM_PER_M

POWER_WAVELENGTH_NM = 546.07
"""The mercury e line, nm, at which lens powers are stated (ISO 7944; ISO 11979-2)."""

_CLEAR_MM = 0.98  # of the radius of curvature, for the rims of strongly curved surfaces


def check_prescription(name: str, sphere: float, cylinder: float, axis: float) -> None:
    """Refuse powers beyond 30 dpt and axes beyond 0 to 180 degrees."""
    for part, value in (("sphere_dpt", sphere), ("cylinder_dpt", cylinder)):
        check_between(f"{name}: {part}", value, -30.0, 30.0, "dpt")
    check_between(f"{name}: axis_deg", axis, 0.0, 180.0, "deg")


def radius_mm_of(index_step: float, power_dpt: float) -> float:
    """Radius, mm, of a surface of a power between media of these indices: R = (n' - n) / P."""
    return radius_of_curvature(power_dpt / MM_PER_M / index_step)


def radius_of_curvature(curvature: float) -> float:
    """1/c; infinite for a plane."""
    return math.inf if curvature == 0.0 else 1.0 / curvature


def lens_surface(
    name: str,
    vertex_mm: np.ndarray,
    turn: np.ndarray,
    radii_mm: tuple[float, float],
    axis_deg: float,
    semi_diameter_mm: float,
    medium_after: Medium,
    conic: float = 0.0,
) -> Surface:
    """A surface with radii (x, y) in its own frame, turned as a whole by a rotation."""
    least = min(abs(r) for r in radii_mm)
    if conic > -1.0:
        semi_diameter_mm = min(semi_diameter_mm, _CLEAR_MM * least / math.sqrt(1.0 + conic))
    about_x, about_y, about_z = _tilts_deg(turn)
    decentre = (float(vertex_mm[0]), float(vertex_mm[1]))
    placement = Placement(decentre, (about_x, about_y), axis_deg + about_z)
    is_round = radii_mm[0] == radii_mm[1]
    centred = placement.is_centred and (is_round or placement.axis_deg == 0.0)
    in_x, in_y = (1.0 / r for r in radii_mm)
    return Surface(
        name,
        float(vertex_mm[2]),
        in_y,
        conic,
        semi_diameter_mm,
        medium_after,
        None if is_round else Toric(in_x),
        None if centred else placement,
    )


def _tilts_deg(turn: np.ndarray) -> tuple[float, float, float]:
    """Angles of a rotation Rx(a) Ry(b) Rz(c), degrees."""
    b = math.asin(max(-1.0, min(1.0, float(turn[0, 2]))))
    a = math.atan2(-float(turn[1, 2]), float(turn[2, 2]))
    c = math.atan2(-float(turn[0, 1]), float(turn[0, 0]))
    return math.degrees(a), math.degrees(b), math.degrees(c)
