"""Where the frame of a surface lies in the eye: shifted off the axis, tilted, turned."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import check_between, check_finite, check_pair

MAX_TILT_DEG = 60.0
"""Largest tilt: beyond it a surface stands edge on to the light."""


@dataclass(frozen=True)
class Placement:
    """Decentration and rotation of a surface about its vertex.

    A point q of the surface's frame lies at vertex + decentre + R q in the eye frame, with
    R = Rx(tilt about x) Ry(tilt about y) Rz(axis): tilted about the eye's x axis last. Angles are
    right-handed about the axes of the eye frame; seen along the light's way (+z) a positive axis
    angle turns from +x towards +y.

    Parameters
    ----------
    decentre_mm
        Displacement (x, y) of the vertex, mm.
    tilt_deg
        Rotations about x and about y, degrees, up to 60.
    axis_deg
        Rotation about z: the direction of the surface's own x section, degrees.
    """

    decentre_mm: tuple[float, float] = (0.0, 0.0)
    tilt_deg: tuple[float, float] = (0.0, 0.0)
    axis_deg: float = 0.0

    def __post_init__(self) -> None:
        decentre = check_pair("placement: decentre_mm", self.decentre_mm, "mm")
        object.__setattr__(self, "decentre_mm", decentre)
        tilt = check_pair("placement: tilt_deg", self.tilt_deg, "deg")
        for angle in tilt:
            check_between("placement: tilt_deg", angle, -MAX_TILT_DEG, MAX_TILT_DEG, "deg")
        object.__setattr__(self, "tilt_deg", tilt)
        axis = check_finite("placement: axis_deg", self.axis_deg, "deg")
        object.__setattr__(self, "axis_deg", axis)

    @property
    def is_centred(self) -> bool:
        """Whether the surface's axis is the eye's."""
        return self.decentre_mm == (0.0, 0.0) and self.tilt_deg == (0.0, 0.0)

    @functools.cached_property
    def rotation(self) -> np.ndarray:
        """R, (3, 3): its columns are the surface's axes in the eye frame."""
        (cx, sx), (cy, sy), (cz, sz) = (
            (math.cos(a), math.sin(a)) for a in np.radians([*self.tilt_deg, self.axis_deg])
        )
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
        about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
        about_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
        rotation = about_x @ about_y @ about_z
        rotation.setflags(write=False)
        return rotation
