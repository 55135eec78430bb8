"""The chief-ray map: which point of the retina receives light from which direction.

The chief ray passes the centre of the stop. It is launched there, towards the retina and out of
the cornea, over a fan of angles; both ends together tabulate the map, without any iteration. The
image is inverted: a direction up and to the right is received down and to the left.

Eyes that are not figures of revolution have a `isetcl.eye.field_plane.FieldPlane` instead.

Field angles are polar: a direction at angle theta from the optical axis with azimuth phi has
(x_deg, y_deg) = theta (cos phi, sin phi); +x is the viewer's right, +y is up, in the scene.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from isetcl.errors import InvalidInputError, check_array
from isetcl.eye.blocked import blocked
from isetcl.eye.model import Eye
from isetcl.eye.prescription import ElementKind, elements
from isetcl.eye.sequential import trace_elements

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

_FAN_RAYS = 512
_FAN_LIMIT_RAD = math.radians(89.0)


@dataclass(frozen=True, eq=False)
class FieldMap:
    """The chief rays of an eye at one wavelength, tabulated against field angle.

    Attributes
    ----------
    wavelength_nm
        Wavelength of the chief rays.
    max_field_deg
        The largest field angle whose chief ray crosses the whole eye.
    """

    wavelength_nm: float
    max_field_deg: float
    _height_mm: CubicSpline
    _z_mm: CubicSpline
    _entrance_z_mm: CubicSpline
    _arc_mm: CubicSpline
    _field_of_arc: CubicSpline

    def height_mm(self, field_deg: np.ndarray | float) -> np.ndarray:
        """Distance of the retinal point from the axis, mm, for field angles in degrees."""
        return self._height_mm(self._inside(field_deg))

    def arc_mm(self, field_deg: np.ndarray | float) -> np.ndarray:
        """Arc length along the retina from its vertex, mm, for field angles in degrees."""
        return self._arc_mm(self._inside(field_deg))

    def mm_per_deg(self, field_deg: np.ndarray | float) -> np.ndarray:
        """Local scale of the map: retinal arc length per degree of field angle, mm/deg."""
        return self._arc_mm(self._inside(field_deg), 1)

    def axial_scale_mm_per_deg(self) -> float:
        """`mm_per_deg` on the axis."""
        return float(self.mm_per_deg(0.0))

    def field_deg(self, arc_mm: np.ndarray | float) -> np.ndarray:
        """Field angle in degrees of the chief ray to a retinal point given by its arc length.

        Raises
        ------
        InvalidInputError
            If no chief ray reaches the point.
        """
        arc = check_array("arc_mm", arc_mm)
        limit = float(self._arc_mm(self.max_field_deg))
        if not np.all(np.abs(arc) <= limit * (1 + 1e-12)):
            raise InvalidInputError(
                f"arc_mm must lie within {limit:.4g} mm of the retinal vertex, where chief rays "
                f"reach, got {np.max(np.abs(arc)):.4g} mm"
            )
        return self._field_of_arc(arc)

    def retinal_point_mm(self, x_deg: np.ndarray, y_deg: np.ndarray) -> np.ndarray:
        """Point on the retina that receives the direction (x_deg, y_deg), mm, shape (..., 3)."""
        x, y = np.broadcast_arrays(check_array("x_deg", x_deg), check_array("y_deg", y_deg))
        field = self._inside(np.hypot(x, y))
        ratio = self._height_mm(field) / np.where(field > 0, field, 1.0)
        return np.stack([-x * ratio, -y * ratio, self._z_mm(field)], axis=-1)

    def entrance_z_mm(self, field_deg: np.ndarray | float) -> np.ndarray:
        """Where the chief ray in front of the eye, produced, crosses the axis, mm.

        On axis this is the paraxial entrance pupil.
        """
        return self._entrance_z_mm(self._inside(field_deg))

    def entrance_mm(self, x_deg: np.ndarray, y_deg: np.ndarray) -> np.ndarray:
        """That point of the axis for directions (x_deg, y_deg), mm, (..., 3)."""
        z = self.entrance_z_mm(np.hypot(x_deg, y_deg))
        return np.stack([np.zeros_like(z), np.zeros_like(z), z], axis=-1)

    def coordinates_mm(self, x_deg: np.ndarray, y_deg: np.ndarray) -> np.ndarray:
        """Arc-length coordinates of the retinal point, mm, (..., 2): polar about the vertex."""
        field = np.hypot(x_deg, y_deg)
        scale = -self.arc_mm(field) / np.where(field > 0, field, 1.0)
        return np.stack([x_deg * scale, y_deg * scale], axis=-1)

    def _inside(self, field_deg: np.ndarray | float) -> np.ndarray:
        field = check_array("field_deg", field_deg)
        if not np.all(np.abs(field) <= self.max_field_deg):
            raise InvalidInputError(
                f"field angle must be at most {self.max_field_deg:.2f} deg from the axis, where "
                f"the last chief ray enters this eye, got {np.max(np.abs(field)):.4g} deg"
            )
        return field


def direction_from_field(x_deg: np.ndarray, y_deg: np.ndarray) -> np.ndarray:
    """Unit vectors from the eye towards the scene for polar field angles in degrees, (..., 3)."""
    x, y = np.broadcast_arrays(
        np.asarray(x_deg, dtype=np.float64), np.asarray(y_deg, dtype=np.float64)
    )
    theta_deg = np.hypot(x, y)
    theta = np.radians(theta_deg)
    ratio = np.sin(theta) / np.where(theta_deg > 0, theta_deg, 1.0)
    return np.stack([x * ratio, y * ratio, -np.cos(theta)], axis=-1)


@functools.lru_cache(maxsize=256)
def field_map(eye: Eye, wavelength_nm: float) -> FieldMap:
    """The chief-ray map of an eye at a wavelength in nm.

    Raises
    ------
    InvalidInputError
        If the wavelength lies outside the range of a medium, or no chief ray passes the eye.
    """
    sequence = elements(eye, wavelength_nm)
    stop = eye.stop_index
    refracting = [e for e in sequence if e.kind is not ElementKind.STOP]
    angle = np.linspace(0.0, _FAN_LIMIT_RAD, _FAN_RAYS)
    origins = np.broadcast_to([0.0, 0.0, eye.stop.z_mm], (_FAN_RAYS, 3))
    directions = np.stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)], axis=1)
    onto = trace_elements(tuple(refracting[stop:]), origins, directions, "retina")
    out = trace_elements(tuple(refracting[:stop][::-1]), origins, -directions, "scene")
    count = _leading(onto.passed & out.passed)
    if count < 8:
        raise blocked(eye.name, wavelength_nm, onto, out)
    retina, leaving, exit_point = onto.positions_mm, out.directions, out.positions_mm
    field = np.degrees(np.arctan2(-leaving[:, 1], -leaving[:, 2]))
    count = min(count, _leading(np.diff(field, prepend=-1.0) > 0))
    field = field[:count]
    slope = leaving[1:count, 1] / leaving[1:count, 2]
    entrance = exit_point[1:count, 2] - exit_point[1:count, 1] / slope
    height = _odd_spline(field, retina[:count, 1])
    depth = _even_spline(field, retina[:count, 2])
    speed = np.hypot(height(field, 1), depth(field, 1))
    arc = _even_spline(field, speed).antiderivative()
    arcs = arc(field) - arc(0.0)
    return FieldMap(
        float(wavelength_nm),
        float(field[-1]),
        height,
        depth,
        _even_spline(field, np.concatenate([[_axis_limit(field, entrance)], entrance])),
        _odd_spline(field, arcs),
        _odd_spline(arcs, field),
    )


def _leading(flags: np.ndarray) -> int:
    """Number of True entries before the first False."""
    return len(flags) if flags.all() else int(np.argmin(flags))


def _axis_limit(field: np.ndarray, values: np.ndarray) -> float:
    """Limit at field 0 of an even function known at field[1:]: quadratic in field^2."""
    return float(np.polynomial.polynomial.polyfit(field[1:7] ** 2, values[:6], 2)[0])


def _odd_spline(x: np.ndarray, y: np.ndarray) -> CubicSpline:
    from scipy.interpolate import CubicSpline

    return CubicSpline(np.concatenate([-x[:0:-1], x]), np.concatenate([-y[:0:-1], y]))


def _even_spline(x: np.ndarray, y: np.ndarray) -> CubicSpline:
    from scipy.interpolate import CubicSpline

    return CubicSpline(np.concatenate([-x[:0:-1], x]), np.concatenate([y[:0:-1], y]))
