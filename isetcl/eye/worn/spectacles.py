"""Spectacle lenses: a change of an eye. Powers are back vertex powers in air (ISO 13666)."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_between,
    check_finite,
    check_pair,
    check_positive,
    check_type,
)
from isetcl.eye.media import AbbeDispersion, Medium
from isetcl.eye.model import Eye
from isetcl.eye.turning import AHEAD, ROTATION_CENTRE_MM, gaze_direction, shortest_rotation
from isetcl.eye.worn.surfaces import (
    POWER_WAVELENGTH_NM,
    check_prescription,
    lens_surface,
    radius_mm_of,
)
from isetcl.units import MM_PER_M

CR39 = Medium("CR-39", AbbeDispersion(1.498, 58.0))
"""The resin of most spectacle lenses (allyl diglycol carbonate; PPG data sheet)."""

_PLUS_EDGE_MM = 1.0
_LEAST_CENTRE_MM = 2.0


@dataclass(frozen=True)
class SpectacleLens:
    """A meniscus in front of the eye: a spherical front, and a back that is toric if needed.

    Parameters
    ----------
    sphere_dpt, cylinder_dpt, axis_deg
        The prescription.
    vertex_distance_mm
        From the back of the lens to the cornea, mm.
    front_power_dpt
        Power of the front surface, (n - 1) / R; None follows Vogel's rule: 6 dpt and the spherical
        equivalent, half of it if negative (Jalie, Principles of Ophthalmic Lenses), at least 1 dpt.
    centre_thickness_mm
        None takes 2 mm, or what leaves the edge of a plus lens 1 mm.
    diameter_mm
        Of the lens, mm.
    medium
        What it is made of.
    decentre_mm
        Place of its middle (x, y), mm.
    pantoscopic_tilt_deg
        Its lower rim towards the cheek, degrees, about its back vertex.
    gaze_deg
        Where the eye looks behind it: right and up, degrees. The lens stays on the head while the
        eye turns about a centre 13.5 mm behind its cornea, without twist; in the frame of the eye
        the lens turns the other way.
    """

    sphere_dpt: float
    cylinder_dpt: float = 0.0
    axis_deg: float = 0.0
    vertex_distance_mm: float = 12.0
    front_power_dpt: float | None = None
    centre_thickness_mm: float | None = None
    diameter_mm: float = 40.0
    medium: Medium = CR39
    decentre_mm: tuple[float, float] = (0.0, 0.0)
    pantoscopic_tilt_deg: float = 0.0
    gaze_deg: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        check_prescription("spectacle lens", self.sphere_dpt, self.cylinder_dpt, self.axis_deg)
        check_positive("spectacle lens: vertex_distance_mm", self.vertex_distance_mm, "mm")
        check_positive("spectacle lens: diameter_mm", self.diameter_mm, "mm")
        if self.front_power_dpt is not None:
            check_finite("spectacle lens: front_power_dpt", self.front_power_dpt, "dpt")
        if self.centre_thickness_mm is not None:
            check_positive("spectacle lens: centre_thickness_mm", self.centre_thickness_mm, "mm")
        check_type("spectacle lens: medium", self.medium, Medium)
        check_pair("spectacle lens: decentre_mm", self.decentre_mm, "mm")
        tilt = self.pantoscopic_tilt_deg
        check_between("spectacle lens: pantoscopic_tilt_deg", tilt, -30.0, 30.0, "deg")
        for angle in check_pair("spectacle lens: gaze_deg", self.gaze_deg, "deg"):
            check_between("spectacle lens: gaze_deg", angle, -50.0, 50.0, "deg")

    def apply(self, eye: Eye) -> Eye:
        """The eye with this lens in front of everything it has."""
        index = float(self.medium.index(POWER_WAVELENGTH_NM))
        front_power = self._front_power_dpt()
        thickness = self.centre_thickness_mm
        if thickness is None:
            thickness = self._thickness_mm(index)
        # Vergence of light from infinity at the back surface, inside the lens.
        arriving = front_power / (1.0 - thickness / MM_PER_M * front_power / index)
        radii = [
            radius_mm_of(1.0 - index, power - arriving)
            for power in (self.sphere_dpt, self.sphere_dpt + self.cylinder_dpt)
        ]
        turn, back_mm = self._pose()
        front_mm = back_mm + turn @ np.array([0.0, 0.0, -thickness])
        before = eye.surfaces[0]
        if back_mm[2] >= before.vertex_z_mm:
            raise InvalidInputError(
                f"spectacle lens: vertex_distance_mm must leave room for {before.name!r}, whose "
                f"vertex lies {-before.vertex_z_mm:g} mm in front of the cornea, got "
                f"{self.vertex_distance_mm:g} mm"
            )
        axis = (180.0 - self.axis_deg) if self.cylinder_dpt != 0.0 else 0.0
        front = lens_surface(
            "spectacle lens front",
            front_mm,
            turn,
            (radius_mm_of(index - 1.0, front_power),) * 2,
            0.0,
            self.diameter_mm / 2.0,
            self.medium,
        )
        back = lens_surface(
            "spectacle lens back",
            back_mm,
            turn,
            (radii[0], radii[1]),
            axis,
            self.diameter_mm / 2.0,
            eye.medium_before,
        )
        return dataclasses.replace(eye, surfaces=(front, back, *eye.surfaces))

    def _front_power_dpt(self) -> float:
        if self.front_power_dpt is not None:
            return self.front_power_dpt
        equivalent = self.sphere_dpt + self.cylinder_dpt / 2.0
        return max(6.0 + (equivalent if equivalent > 0 else equivalent / 2.0), 1.0)

    def _thickness_mm(self, index: float) -> float:
        """Centre thickness, mm, by the sag of a thin lens of the strongest power at its edge."""
        strongest = max(self.sphere_dpt, self.sphere_dpt + self.cylinder_dpt, 0.0)
        bulge = strongest / MM_PER_M / (index - 1.0) * (self.diameter_mm / 2.0) ** 2 / 2.0
        return max(_LEAST_CENTRE_MM, _PLUS_EDGE_MM + 1.2 * bulge)

    def _pose(self) -> tuple[np.ndarray, np.ndarray]:
        """Rotation of the lens and place of its back vertex in the frame of the turned eye."""
        tilt = math.radians(-self.pantoscopic_tilt_deg)
        cosine, sine = math.cos(tilt), math.sin(tilt)
        lens = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
        back = np.array([*self.decentre_mm, -self.vertex_distance_mm])
        gaze = shortest_rotation(AHEAD, gaze_direction(self.gaze_deg))
        centre = np.array([0.0, 0.0, ROTATION_CENTRE_MM])
        return gaze.T @ lens, centre + gaze.T @ (back - centre)
