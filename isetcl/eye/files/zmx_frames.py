"""Where the surfaces of a Zemax file lie: coordinate breaks resolved into one frame.

Zemax gives every surface in the frame of the one before it. A coordinate break shifts that frame
and turns it: by x, then the new y, then the new z; with its order flag set it turns by z, y, x and
shifts afterwards. Rotations are right-handed about axes with x into the page of a drawing that has
z to the right and y up, which is isetcl's eye frame.

Source: Zemax knowledge base, "Rotation matrix and tilt about X/Y/Z in OpticStudio".
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.eye.files.zmx_text import ZmxSurface
from isetcl.eye.placement import Placement

_SAME = 1e-12


@dataclass(frozen=True)
class Frame:
    """An origin (3,), mm, and axes as the columns of a (3, 3) rotation."""

    origin_mm: np.ndarray
    axes: np.ndarray

    def moved(self, x_mm: float, y_mm: float, z_mm: float) -> Frame:
        """The frame shifted along its own axes."""
        return Frame(self.origin_mm + self.axes @ [x_mm, y_mm, z_mm], self.axes)

    def placement(self) -> Placement | None:
        """Decentration and angles of the frame; None where it lies on the axis untilted."""
        # R = Rx Ry Rz has R[0, 2] = sin(y), R[1, 2] = -sin(x) cos(y), R[0, 1] = -cos(y) sin(z).
        r = self.axes
        about_y = math.asin(max(-1.0, min(1.0, r[0, 2])))
        about_x = math.atan2(-r[1, 2], r[2, 2])
        about_z = math.atan2(-r[0, 1], r[0, 0])
        angles = [math.degrees(a) if abs(a) > _SAME else 0.0 for a in (about_x, about_y, about_z)]
        decentre = [float(v) if abs(v) > _SAME else 0.0 for v in self.origin_mm[:2]]
        if not any(angles) and not any(decentre):
            return None
        return Placement((decentre[0], decentre[1]), (angles[0], angles[1]), angles[2])

    @property
    def is_tilted(self) -> bool:
        """Whether its z axis is not that of the eye."""
        return bool(abs(self.axes[2, 2] - 1.0) > _SAME)


def start() -> Frame:
    """The frame of the first surface behind the object."""
    return Frame(np.zeros(3), np.eye(3))


def broken(frame: Frame, surface: ZmxSurface, unit_mm: float) -> Frame:
    """The frame behind a coordinate break, without its thickness."""
    get = surface.parameters.get
    x, y = get(1, 0.0) * unit_mm, get(2, 0.0) * unit_mm
    about_x, about_y, about_z = (_rotation(i, get(3 + i, 0.0)) for i in range(3))
    if get(6, 0.0) == 0:
        shifted = frame.moved(x, y, 0.0)
        return Frame(shifted.origin_mm, frame.axes @ about_x @ about_y @ about_z)
    return Frame(frame.origin_mm, frame.axes @ about_z @ about_y @ about_x).moved(x, y, 0.0)


def onward(frame: Frame, surface: ZmxSurface, unit_mm: float) -> Frame:
    """The frame of the next surface."""
    if not math.isfinite(surface.thickness):
        raise InvalidInputError("the thickness (DISZ) must be finite behind the object")
    return frame.moved(0.0, 0.0, surface.thickness * unit_mm)


def _rotation(axis: int, angle_deg: float) -> np.ndarray:
    """Right-handed rotation about x, y or z (0, 1, 2)."""
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = c
    matrix[second, first], matrix[first, second] = s, -s
    return matrix
