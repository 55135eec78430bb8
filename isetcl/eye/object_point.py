"""Rays from one object point into an eye, and which of them pass the stop.

The object's distance enters as its vergence, so that infinity is no special case. Rays are named by
where they cross the entrance pupil: the plane through the point where the chief ray meets the axis,
at right angles to the chief ray. (In an eye that is no figure of revolution it is the point where
the chief ray passes nearest to the middle of the paraxial entrance pupil.) Its axes x and y are the
right and the up of the eye that looks along the chief ray; on axis they are the axes of the eye
frame.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_finite, check_pair, check_positive, check_type
from isetcl.eye.field import FieldMap, direction_from_field
from isetcl.eye.field_plane import FieldPlane
from isetcl.eye.model import Eye
from isetcl.eye.prescription import Element, ElementKind, elements
from isetcl.eye.sequential import trace_elements
from isetcl.units import MM_PER_M, vergence_from_distance

_NEAREST_MM = 10.0
_NEWTON_STEPS = 12


@dataclass(frozen=True, eq=False)
class PupilRays:
    """Rays from the object point on the retina; n rays.

    Attributes
    ----------
    entrance_mm : ndarray, (n, 2)
        Where they cross the entrance pupil, mm from its middle.
    stop_mm : ndarray, (n, 2)
        Where they meet the plane of the stop, mm, eye frame.
    point_mm, direction : ndarray, (n, 3)
        Where they meet the retina, mm, and their unit directions there.
    opl_mm : ndarray, (n,)
        Optical path from the object to the retina, mm, less that to the middle of the entrance
        pupil in the medium before the eye.
    passed : ndarray, (n,)
        Rays that meet every surface inside its semi-diameter; the stop does not count.
    """

    entrance_mm: np.ndarray
    stop_mm: np.ndarray
    point_mm: np.ndarray
    direction: np.ndarray
    opl_mm: np.ndarray
    passed: np.ndarray


class ObjectPoint:
    """A point of the scene seen by an eye at one wavelength.

    Parameters
    ----------
    eye
        The eye.
    field_deg
        Field angles (x, y) of the chief ray in degrees; a single number is (0, y).
    wavelength_nm
        Wavelength, nm.
    object_distance_m
        Distance of the object plane in front of the corneal vertex, m; infinity is legal.

    Raises
    ------
    InvalidInputError
        If no chief ray enters from there, the object lies in or behind the eye, or the wavelength
        lies outside the range of a medium.
    """

    def __init__(
        self,
        eye: Eye,
        field_deg: tuple[float, float] | float,
        wavelength_nm: float,
        object_distance_m: float = math.inf,
    ) -> None:
        check_type("eye", eye, Eye)
        self.eye = eye
        self.wavelength_nm = check_positive("wavelength_nm", wavelength_nm, "nm")
        self.field_deg = check_field(field_deg)
        vergence = vergence_from_distance(object_distance_m)
        self.angle_deg = math.hypot(*self.field_deg)
        self.map: FieldMap | FieldPlane = eye.field_map(self.wavelength_nm)
        self._entrance = self._entrance_middle()
        self.entrance_z_mm = float(self._entrance[2])
        self.towards = direction_from_field(*np.array(self.field_deg))
        self._check_object(vergence)
        per_mm = vergence / MM_PER_M
        # 1 / (distance along the chief ray from the entrance pupil), 1/mm.
        self.per_mm = -float(self.towards[2]) * per_mm / (1.0 + per_mm * self.entrance_z_mm)
        self.axes = pupil_axes(self.field_deg)
        self._flatten()

    def _entrance_middle(self) -> np.ndarray:
        """The middle of the entrance pupil, mm, (3,)."""
        if isinstance(self.map, FieldPlane):
            return self.map.entrance_mm(*np.array(self.field_deg))
        return np.array([0.0, 0.0, float(self.map.entrance_z_mm(self.angle_deg))])

    def _flatten(self) -> None:
        """The eye at this wavelength as elements."""
        sequence = elements(self.eye, self.wavelength_nm)
        self._stop = self.eye.stop_index
        self.sequence = tuple(_opened(e) if e.kind is ElementKind.STOP else e for e in sequence)
        self._front = tuple(
            dataclasses.replace(e, semi_diameter_mm=math.inf)
            for e in self.sequence[: self._stop + 1]
        )
        self.index_before, self.index_after = sequence[0].n_before, sequence[-1].n_after

    def _check_object(self, vergence_dpt: float) -> None:
        if vergence_dpt > MM_PER_M / _NEAREST_MM:
            raise InvalidInputError(
                f"object_distance_m must be >= {_NEAREST_MM / MM_PER_M:g} m, so that the object "
                f"lies in front of the eye, got {1.0 / vergence_dpt:g} m"
            )
        if vergence_dpt > 0 and self.angle_deg > 85.0:
            raise InvalidInputError(
                "a plane at a finite distance is seen at less than 85 deg from the axis here, got "
                f"{self.angle_deg:g} deg; use object_distance_m = inf"
            )

    def trace(self, entrance_mm: np.ndarray) -> PupilRays:
        """Rays through points (n, 2) of the entrance pupil, mm, onto the retina."""
        return self._trace(entrance_mm, *self.launch(entrance_mm))

    def turned(self, entrance_mm: np.ndarray, angle_rad: np.ndarray) -> PupilRays:
        """Rays through a point (1, 2) of the entrance pupil, turned by small angles (n, 2), rad.

        As from an object farther to the right and up by these angles.
        """
        origins, directions = self.launch(np.broadcast_to(entrance_mm, angle_rad.shape))
        directions = directions - angle_rad @ self.axes
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return self._trace(np.broadcast_to(entrance_mm, angle_rad.shape), origins, directions)

    def at_wavelength(self, wavelength_nm: float) -> ObjectPoint:
        """The same object point at another wavelength, whose chief ray comes from elsewhere.

        The axis crossing of this wavelength's chief ray stays the middle of the entrance pupil.
        """
        other = copy.copy(self)
        other.wavelength_nm = check_positive("wavelength_nm", wavelength_nm, "nm")
        other._flatten()
        return other

    def _trace(
        self, entrance_mm: np.ndarray, origins: np.ndarray, directions: np.ndarray
    ) -> PupilRays:
        rays = trace_elements(self.sequence, origins, directions, "retina", record_hits=True)
        assert rays.opl_mm is not None
        assert rays.hits_mm is not None
        squared = np.sum(entrance_mm**2, axis=1)
        # Path from the object, by the form that is exact for every vergence.
        start = self.per_mm * squared / (1.0 + np.sqrt(1.0 + self.per_mm**2 * squared))
        return PupilRays(
            entrance_mm,
            rays.hits_mm[self._stop][:, :2],
            rays.positions_mm,
            rays.directions,
            rays.opl_mm + self.index_before * start,
            rays.passed,
        )

    def aim(
        self, stop_mm: np.ndarray, guess_mm: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Points of the entrance pupil whose rays meet the stop's plane at `stop_mm`, (n, 2), mm.

        Newton's method with differences, from the paraxial pupil or a better guess. The second
        result marks where it succeeded; it fails where no ray from the object gets there.
        """
        pupil = self.eye.entrance_pupil(self.wavelength_nm)
        foreshortened = max(math.cos(math.radians(self.angle_deg)), 0.2)
        along = np.array(self.field_deg) / self.angle_deg if self.angle_deg > 0 else np.zeros(2)
        point = (stop_mm - self.eye.stop.decentre_mm) * pupil.magnification
        point = point - (1.0 - foreshortened) * (point @ along)[:, None] * along
        if guess_mm is not None:
            point = guess_mm
        step = 1e-5 * self.eye.stop.radius_mm
        for _ in range(_NEWTON_STEPS):
            reached, _ = self._at_stop(point)
            miss = stop_mm - reached
            if np.max(np.abs(miss)) < 1e-13 * max(1.0, self.eye.stop.radius_mm):
                break
            slopes = np.stack(
                [(self._at_stop(point + step * e)[0] - reached) / step for e in np.eye(2)], axis=-1
            )
            regular = np.abs(np.linalg.det(slopes)) > 1e-6
            slopes[~regular] = np.eye(2)
            change = np.linalg.solve(slopes, miss[..., None])[..., 0]
            # No step beyond a stop radius: the first guess may be far off at wide fields.
            size = np.linalg.norm(change, axis=1, keepdims=True) / self.eye.stop.radius_mm
            point = point + change / np.maximum(size, 1.0)
        reached, ok = self._at_stop(point)
        return point, ok & (np.max(np.abs(stop_mm - reached), axis=1) < 1e-9)

    def chief(self) -> PupilRays:
        """The ray through the middle of the stop.

        Raises
        ------
        InvalidInputError
            If it is lost on its way.
        """
        point, found = self.aim(self.eye.stop.rim_mm(np.zeros((1, 2))))
        rays = self.trace(point)
        if not (found[0] and rays.passed[0]):
            raise InvalidInputError(
                f"eye {self.eye.name!r}: the chief ray from {self.angle_deg:g} deg does not reach "
                "the retina; use a smaller field angle or larger semi-diameters"
            )
        return rays

    def launch(self, entrance_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points in the eye frame, mm, and unit directions of rays through the entrance pupil."""
        offset = entrance_mm @ self.axes
        directions = self.per_mm * offset - self.towards
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return offset + self._entrance, directions

    def _at_stop(self, entrance_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rays = trace_elements(self._front, *self.launch(entrance_mm), "retina")
        return rays.positions_mm[:, :2], rays.passed


def check_field(field_deg: tuple[float, float] | float) -> tuple[float, float]:
    """Field angles (x, y) in degrees; a single number is (0, y)."""
    if np.ndim(field_deg) == 0:
        return (0.0, check_finite("field_deg", field_deg, "deg"))  # type: ignore[arg-type]
    return check_pair("field_deg", field_deg, "deg")  # type: ignore[arg-type]


def pupil_axes(field_deg: tuple[float, float]) -> np.ndarray:
    """Unit vectors x and y at right angles to the direction of a field angle, (2, 3), eye frame."""
    angle = math.hypot(*field_deg)
    if angle == 0.0:
        return np.eye(3)[:2]
    theta = math.radians(angle)
    c, s = field_deg[0] / angle, field_deg[1] / angle
    tangential = np.array([c * math.cos(theta), s * math.cos(theta), math.sin(theta)])
    sagittal = np.array([-s, c, 0.0])
    return np.stack([c * tangential - s * sagittal, s * tangential + c * sagittal])


def _opened(stop: Element) -> Element:
    """The stop without its opaque part."""
    return dataclasses.replace(stop, semi_diameter_mm=math.inf)
