"""The chief-ray map of an eye that is not a figure of revolution: functions of two field angles.

The chief ray passes the middle of the stop. It is launched there, towards the retina and out of
the cornea; where both ends lie is found by Newton's method on real rays, started from a fan. Field
angles are polar about the optical axis, as in `isetcl.eye.field`.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from isetcl.errors import InvalidInputError, check_array
from isetcl.eye.blocked import blocked
from isetcl.eye.field import direction_from_field
from isetcl.eye.model import Eye
from isetcl.eye.plane_polynomial import sampled
from isetcl.eye.prescription import Element, ElementKind, elements
from isetcl.eye.rays import RayBundle
from isetcl.eye.retina_form import arc_coordinates_mm, off_relief, onto_relief, without_relief
from isetcl.eye.sequential import Towards, trace_elements

if TYPE_CHECKING:
    from scipy.interpolate import LinearNDInterpolator

_FAN_ANGLES = 160
_FAN_SPOKES = 48
_FAN_LIMIT_RAD = math.radians(89.0)
_NEWTON_STEPS = 16
_DIFFERENCE_RAD = 1e-6
_LONGEST_STEP_RAD = 0.05
_ENTRANCE_TOLERANCE_MM = 1e-4
_POINT_TOLERANCE_MM = 1e-9
_FIELD_TOLERANCE_DEG = 1e-7
_SLOPE_STEP_DEG = 1e-2
_FEW = 16


class FieldPlane:
    """The chief rays of an eye at one wavelength, against field angles (x, y).

    Attributes
    ----------
    eye
        The eye.
    wavelength_nm
        Wavelength of the chief rays.
    max_field_deg
        In every direction chief rays cross the whole eye out to at least this field angle.
    """

    def __init__(self, eye: Eye, wavelength_nm: float) -> None:
        self.eye = eye
        self.wavelength_nm = float(wavelength_nm)
        refracting = [e for e in elements(eye, wavelength_nm) if e.kind is not ElementKind.STOP]
        stop = eye.stop_index
        smooth = without_relief(eye.retina)
        retina = dataclasses.replace(refracting[-1], shape=smooth.shape)
        self._onto: tuple[Element, ...] = (*refracting[stop:-1], retina)
        self._out: tuple[Element, ...] = tuple(refracting[:stop][::-1])
        self._middle = np.array([*eye.stop.decentre_mm, eye.stop.z_mm])
        pupil = eye.entrance_pupil(wavelength_nm)
        self._entrance = np.array(
            [*(np.array(eye.stop.decentre_mm) * pupil.magnification), pupil.z_mm]
        )
        self._tabulate()

    def _tabulate(self) -> None:
        """Trace a fan, and make first guesses of it."""
        angle = np.linspace(0.0, _FAN_LIMIT_RAD, _FAN_ANGLES)
        turn = np.arange(_FAN_SPOKES) * 2.0 * np.pi / _FAN_SPOKES
        circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        launch = angle[:, None, None] * circle
        out = self._leave(launch.reshape(-1, 2))
        onto = self._arrive(launch.reshape(-1, 2))
        field = field_from_direction(out.directions).reshape(launch.shape)
        seen = self._about_stop(onto.positions_mm).reshape(launch.shape)
        passed = (out.passed & onto.passed).reshape(launch.shape[:2])
        # A spoke ends where a ray is lost, or where the fan turns back.
        outwards = np.linalg.norm(field - field[:1], axis=-1)
        passed[1:] &= np.diff(outwards, axis=0) > 0
        used = np.logical_and.accumulate(passed, axis=0)
        last = used.sum(axis=0) - 1
        if last.min() < 8:
            raise blocked(self.eye.name, self.wavelength_nm, onto, out)
        rim = field[last, np.arange(_FAN_SPOKES)]
        self.max_field_deg = _least_reach(rim)
        used[0, 1:] = False  # the middle of the fan once
        table = launch[used]
        # Newton's method finds launches of a field from afar, those of a retinal point it does not.
        self._launch_of_field = _Guesses(field[used], table, _FEW)
        self._launch_of_point = _Guesses(seen[used], table, 0)

    def retinal_point_mm(self, x_deg: np.ndarray, y_deg: np.ndarray) -> np.ndarray:
        """Point on the retina that receives the direction (x_deg, y_deg), mm, shape (..., 3)."""
        point = self._over_field(self.base_point_mm, x_deg, y_deg, _POINT_TOLERANCE_MM)
        return onto_relief(self.eye.retina, point.reshape(-1, 3)).reshape(point.shape)

    def base_point_mm(self, field_deg: np.ndarray) -> np.ndarray:
        """The same for field angles (n, 2) on the retina without relief, (n, 3)."""
        return self._arrive(self._launch(field_deg)).positions_mm

    def arriving(self, field_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """End points, mm, and directions on the retina of chief rays of field angles (n, 2)."""
        rays = self._arrive(self._launch(field_deg))
        return rays.positions_mm, rays.directions

    def coordinates_mm(self, x_deg: np.ndarray, y_deg: np.ndarray) -> np.ndarray:
        """Arc-length coordinates of the retinal point, mm, (..., 2); see `arc_coordinates_mm`."""
        retina = without_relief(self.eye.retina)

        def lengths(field: np.ndarray) -> np.ndarray:
            return arc_coordinates_mm(retina, self.eye.stop.z_mm, self.base_point_mm(field))

        return self._over_field(lengths, x_deg, y_deg, 1e-6)

    def entrance_mm(self, x_deg: np.ndarray, y_deg: np.ndarray) -> np.ndarray:
        """Point of the chief ray in front of the eye, produced, where it enters, mm, (..., 3).

        The one nearest to the middle of the paraxial entrance pupil.
        """

        def nearest(field: np.ndarray) -> np.ndarray:
            rays = self._leave(self._launch(field))
            gap = self._entrance - rays.positions_mm
            along = np.sum(gap * rays.directions, axis=1, keepdims=True)
            return np.asarray(rays.positions_mm + along * rays.directions)

        return self._over_field(nearest, x_deg, y_deg, _ENTRANCE_TOLERANCE_MM)

    def field_of_point_deg(self, point_mm: np.ndarray) -> np.ndarray:
        """Field angles (x, y) of the chief rays to points (n, 3) of the retina, mm; (n, 2).

        Where no chief ray arrives, those of the nearest one that does.
        """
        seen = self._about_stop(off_relief(self.eye.retina, point_mm))

        def fields(at: np.ndarray) -> np.ndarray:
            launch = self._newton(
                lambda a: self._about_stop(self._arrive(a).positions_mm),
                at,
                self._launch_of_point(at),
                1e-12,
            )
            return field_from_direction(self._leave(launch).directions)

        return sampled(fields, seen, _FIELD_TOLERANCE_DEG)

    def slopes_mm_per_deg(self, field_deg: tuple[float, float]) -> np.ndarray:
        """Derivatives of the retinal point by field angles x and y, mm/deg, (2, 3)."""
        h = _SLOPE_STEP_DEG
        field = np.array(field_deg)
        reach = max(0.0, self.max_field_deg - 2.0 * h)
        field = field * min(1.0, reach / max(float(np.hypot(*field)), 1e-9))
        steps = h * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        point = self.base_point_mm(field + steps)
        return np.asarray((point[::2] - point[1::2]) / (2.0 * h))

    def axial_scale_mm_per_deg(self) -> float:
        """Retinal length of a degree of field angle about the axis, mm/deg, the mean of x and y."""
        slopes = self.slopes_mm_per_deg((0.0, 0.0))
        return float(np.mean(np.linalg.norm(slopes, axis=1)))

    def _over_field(
        self,
        function: Callable[[np.ndarray], np.ndarray],
        x_deg: np.ndarray,
        y_deg: np.ndarray,
        tolerance: float,
    ) -> np.ndarray:
        x, y = np.broadcast_arrays(check_array("x_deg", x_deg), check_array("y_deg", y_deg))
        largest = float(np.max(np.hypot(x, y), initial=0.0))
        if not largest <= self.max_field_deg:
            raise InvalidInputError(
                f"field angle must be at most {self.max_field_deg:.2f} deg from the axis, within "
                f"which chief rays enter this eye from all sides, got {largest:.4g} deg"
            )
        field = np.stack([x.ravel(), y.ravel()], axis=1)
        values = sampled(function, field, tolerance)
        return values.reshape(*x.shape, values.shape[1])

    def _launch(self, field_deg: np.ndarray) -> np.ndarray:
        """Angles (n, 2), rad, at the stop of the chief rays of field angles (n, 2)."""
        return self._newton(
            lambda a: field_from_direction(self._leave(a).directions),
            field_deg,
            self._launch_of_field(field_deg),
            1e-11,
        )

    def _newton(
        self,
        function: Callable[[np.ndarray], np.ndarray],
        wanted: np.ndarray,
        guess: np.ndarray,
        tolerance: float,
    ) -> np.ndarray:
        """Launch angles at which a function of them, (n, 2), takes the wanted values."""
        launch, h = guess.copy(), _DIFFERENCE_RAD
        left = np.arange(len(guess))
        for _ in range(_NEWTON_STEPS):
            reached = function(launch[left])
            miss = wanted[left] - reached
            far = np.max(np.abs(miss), axis=1, initial=0.0) >= tolerance
            left, reached, miss = left[far], reached[far], miss[far]
            if len(left) == 0:
                break
            slopes = np.stack(
                [(function(launch[left] + h * e) - reached) / h for e in np.eye(2)], axis=-1
            )
            singular = ~(np.abs(np.linalg.det(slopes)) > 1e-9)
            slopes[singular] = np.eye(2)
            change = np.linalg.solve(slopes, np.where(singular[:, None], 0.0, miss)[..., None])
            change = change[..., 0]
            size = np.linalg.norm(change, axis=1, keepdims=True) / _LONGEST_STEP_RAD
            launch[left] += change / np.maximum(size, 1.0)
        return launch

    def _leave(self, launch: np.ndarray) -> RayBundle:
        """Chief rays out of the eye."""
        return self._trace(self._out, -_from_angles(launch), "scene")

    def _arrive(self, launch: np.ndarray) -> RayBundle:
        """Chief rays onto the retina."""
        return self._trace(self._onto, _from_angles(launch), "retina")

    def _trace(
        self, sequence: tuple[Element, ...], directions: np.ndarray, towards: Towards
    ) -> RayBundle:
        origins = np.broadcast_to(self._middle, directions.shape)
        return trace_elements(sequence, origins, directions, towards)

    def _about_stop(self, point_mm: np.ndarray) -> np.ndarray:
        """Polar angles (n, 2), rad, of points as seen from the middle of the stop."""
        away = point_mm - self._middle
        across = np.hypot(away[:, 0], away[:, 1])
        ratio = np.arctan2(across, away[:, 2]) / np.where(across > 0, across, 1.0)
        return np.asarray(away[:, :2] * ratio[:, None])


@functools.lru_cache(maxsize=256)
def field_plane(eye: Eye, wavelength_nm: float) -> FieldPlane:
    """The chief-ray map of an eye of any form at a wavelength in nm.

    Raises
    ------
    InvalidInputError
        If the wavelength lies outside the range of a medium, or no chief ray passes the eye.
    """
    return FieldPlane(eye, wavelength_nm)


def field_from_direction(direction: np.ndarray) -> np.ndarray:
    """Field angles (x, y), degrees, of unit vectors towards the scene; (n, 3) to (n, 2)."""
    across = np.hypot(direction[:, 0], direction[:, 1])
    theta = np.degrees(np.arctan2(across, -direction[:, 2]))
    ratio = theta / np.where(across > 0, across, 1.0)
    return np.asarray(direction[:, :2] * ratio[:, None])


def visual_angle_steps(field_deg: tuple[float, float]) -> np.ndarray:
    """Steps of field angles (x, y) for a degree of visual angle to the right and up, (2, 2).

    About the direction of a field angle; right and up as in `isetcl.eye.object_point.pupil_axes`.
    """
    angle = math.hypot(*field_deg)
    c, s = (field_deg[0] / angle, field_deg[1] / angle) if angle > 0 else (1.0, 0.0)
    theta = math.radians(angle)
    around = theta / math.sin(theta) if theta > 1e-9 else 1.0
    tangential, sagittal = np.array([c, s]), around * np.array([-s, c])
    return np.stack([c * tangential - s * sagittal, s * tangential + c * sagittal])


def _from_angles(launch: np.ndarray) -> np.ndarray:
    """Unit vectors towards the retina for polar angles in rad, (n, 2) to (n, 3)."""
    direction = direction_from_field(*np.degrees(launch).T)
    return direction * np.array([1.0, 1.0, -1.0])


class _Guesses:
    """First guesses from a table: linear between its points, beyond them the nearest one's.

    Up to `few` guesses are always the nearest point's: joining the points to triangles takes longer
    than some more steps of Newton's method.
    """

    def __init__(self, points: np.ndarray, values: np.ndarray, few: int) -> None:
        self._points, self._values, self._few = points, values, few

    def __call__(self, at: np.ndarray) -> np.ndarray:
        from scipy.spatial import cKDTree

        found = np.full(at.shape, np.nan)
        if len(at) > self._few:
            found = np.asarray(self._triangles(at), dtype=np.float64)
        beyond = ~np.isfinite(found).all(axis=1)
        if beyond.any():
            _, nearest = cKDTree(self._points).query(at[beyond])
            found[beyond] = self._values[nearest]
        return found

    @functools.cached_property
    def _triangles(self) -> LinearNDInterpolator:
        from scipy.interpolate import LinearNDInterpolator

        return LinearNDInterpolator(self._points, self._values)


def _least_reach(rim: np.ndarray) -> float:
    """Least distance of a polygon about the origin, by its edges, from the origin."""
    following = np.roll(rim, -1, axis=0)
    along = following - rim
    share = -np.sum(rim * along, axis=1) / np.maximum(np.sum(along**2, axis=1), 1e-30)
    nearest = rim + np.clip(share, 0.0, 1.0)[:, None] * along
    return float(np.min(np.linalg.norm(nearest, axis=1)))
