"""The region of the exit pupil that a retinal point sees, for every point and wavelength.

A ray drawn from the retina is wasted unless it passes the stop. Seen from a retinal point the stop
is nearly an ellipse in the plane of the paraxial exit pupil, and the ellipse changes smoothly with
field angle. Drawing the second point of a ray inside that ellipse wastes almost none. The bound is
an ellipse slightly larger than the true outline, so that no light is missed; the stop itself still
decides in the kernel.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.eye.field import FieldMap
from isetcl.eye.field_plane import FieldPlane
from isetcl.eye.model import Eye
from isetcl.eye.polynomial import evaluate, fit, unit_nodes
from isetcl.eye.prescription import Element, ElementKind, elements
from isetcl.eye.rays import RayStatus
from isetcl.eye.sequential import meets_far_side, trace_elements

MARGIN = 1e-6
"""Relative excess of the bound over the outermost ray found. A loose bound is noise: 0.4 % costs
4.5 times the variance at 64 samples on smooth scenes; at 1e-5 the rare lost ray is still the
largest error of a uniform scene."""

_AZIMUTHS = 24
_CHECK_AZIMUTHS = 40
_FIELD_NODES = 12
_FIT_TOLERANCE = 2e-7  # of the radius of the stop
_SCAN_FIELDS = (40, 81)
_SCAN_TOLERANCE = 0.01
_SCAN_MARGIN = 0.02  # outlines found by trial may have corners between the azimuths tried
_CHIEF_RAYS = 1024
_CHIEF_FAN_RAD = math.radians(89.0)
_RIGHT = np.array([1.0, 0.0])
_UP = np.array([0.0, 1.0])


@dataclass(frozen=True, eq=False)
class ExitPupilBound:
    """An ellipse in the plane `z_mm` for every field angle, as polynomials in s = (field/limit)^2.

    With g = field vector / `field_limit_deg` (so that s = g . g), the ellipse is
    centre(s) g + semi(s) u + stretch(s) g (g . u) over the unit disc u. On the axis it is a
    circle; its area is pi semi (semi + s stretch).

    Attributes
    ----------
    fill
        The smallest fraction of the ellipse that the true outline fills, over the field.
    clipped_elsewhere
        True if a ray inside the bound may be lost other than at the stop.
    has_far_side
        True if a ray inside the bound may cross a surface beyond its equator.
    """

    z_mm: float
    field_limit_deg: float
    centre: np.ndarray
    semi: np.ndarray
    stretch: np.ndarray
    fill: float
    clipped_elsewhere: bool
    has_far_side: bool

    def area_mm2(self, field_deg: np.ndarray | float) -> np.ndarray:
        """Area of the ellipse for field angles in degrees, mm^2."""
        s = np.square(np.asarray(field_deg, dtype=np.float64) / self.field_limit_deg)
        semi = evaluate(self.semi, s)
        return math.pi * semi * (semi + s * evaluate(self.stretch, s))


@functools.lru_cache(maxsize=256)
def exit_pupil_bound(
    eye: Eye, wavelength_nm: float, grid_map: FieldMap, field_limit_deg: float
) -> ExitPupilBound:
    """The bound for all retinal points out to a field angle, at one wavelength.

    Parameters
    ----------
    eye
        The eye.
    wavelength_nm
        Wavelength of the rays, nm.
    grid_map
        The chief-ray map that labels retinal points with field angles (one wavelength for all
        bands: a retinal point does not move).
    field_limit_deg
        Largest field angle, degrees.
    """
    outline = StopOutline(eye, wavelength_nm, grid_map)
    limit = float(field_limit_deg)

    # Whether the whole stop can be seen decides how outlines are found, for all fields alike.
    outline.edge(np.array([limit]), _AZIMUTHS)
    # Where part of it is hidden the outline has corners, and polynomials need watching.
    nodes, checks = (_FIELD_NODES, _FIELD_NODES + 3) if outline.is_complete else _SCAN_FIELDS
    # The polynomials divide by g; near the axis the outline is taken a little off it.
    s = np.maximum(unit_nodes(nodes), 1e-4)
    check = limit * np.sqrt(np.linspace(0.0, 1.0, checks))
    centre, sagittal, tangential = outline.ellipse(limit * np.sqrt(s))
    relative = _FIT_TOLERANCE if outline.is_complete else _SCAN_TOLERANCE
    tolerance = relative * eye.stop.radius_mm
    # Outlines found by trial are a little uncertain; dividing by g must not make it much.
    by_g, by_s = (None, None) if outline.is_complete else (np.sqrt(s), s)
    bound = ExitPupilBound(
        outline.z_mm,
        limit,
        fit(s, centre / np.sqrt(s), tolerance, by_g),
        fit(s, sagittal, tolerance),
        fit(s, (tangential - sagittal) / s, tolerance, by_s),
        fill=1.0,
        clipped_elsewhere=False,
        has_far_side=False,
    )
    _check_ellipses(eye, bound)
    excess, fill = outline.compare(bound, check)
    grow = max(excess, 1.0) * (1.0 + (MARGIN if outline.is_complete else _SCAN_MARGIN))
    clipped, far_side = outline.losses(check)
    return dataclasses.replace(
        bound,
        semi=bound.semi * grow,
        stretch=bound.stretch * grow,
        fill=fill / grow**2,
        clipped_elsewhere=clipped,
        has_far_side=far_side,
    )


def _check_ellipses(eye: Eye, bound: ExitPupilBound) -> None:
    """Refuse a bound whose ellipses are not ellipses somewhere: its polynomials have failed."""
    s = np.linspace(0.0, 1.0, 513)
    semi = evaluate(bound.semi, s)
    area = bound.area_mm2(bound.field_limit_deg * np.sqrt(s))
    if np.min(semi) <= 0 or np.min(area) <= 0:
        raise InvalidInputError(
            f"eye {eye.name!r}: the stop cannot be seen from the retina at every field angle out "
            f"to {bound.field_limit_deg:.4g} deg; reduce fov_deg or centre_deg"
        )


class StopOutline:
    """The edge of the stop as seen from retinal points, found with the host tracer.

    Attributes
    ----------
    z_mm
        The plane of the paraxial exit pupil, in which the outline lies.
    is_complete
        False once a retinal point was met that cannot see the whole stop. From then on outlines are
        found by trial.
    """

    def __init__(self, eye: Eye, wavelength_nm: float, grid_map: FieldMap | FieldPlane) -> None:
        self._map = grid_map
        sequence = [
            e for e in reversed(elements(eye, wavelength_nm)) if e.kind is not ElementKind.RETINA
        ]
        rear = len(eye.surfaces) - eye.stop_index
        self._to_stop = (*sequence[:rear], _open_plane(sequence[rear]))
        self._through = tuple(sequence)
        self._open = (*sequence[:rear], _open_plane(sequence[rear]), *sequence[rear + 1 :])
        self._stop_radius = eye.stop.radius_mm
        self._stop_z = eye.stop.z_mm
        self._from_stop = tuple(
            e
            for e in elements(eye, wavelength_nm)[eye.stop_index :]
            if e.kind is not ElementKind.STOP
        )
        pupil = eye.exit_pupil(wavelength_nm)
        self.z_mm = pupil.z_mm
        self._magnification = pupil.magnification
        self.is_complete = True

    def ellipse(self, field_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Tangential centre, sagittal and tangential semi-axes in mm, for each field angle."""
        edge = self.edge(field_deg, _AZIMUTHS)
        sagittal = np.abs(edge[..., 0]).max(axis=1)
        top, bottom = edge[..., 1].max(axis=1), edge[..., 1].min(axis=1)
        return (top + bottom) / 2.0, sagittal, (top - bottom) / 2.0

    def edge(self, field_deg: np.ndarray, azimuths: int) -> np.ndarray:
        """Points in the pupil plane that aim at the edge of the stop, (fields, azimuths, 2), mm."""
        turn = np.arange(azimuths) * 2.0 * np.pi / azimuths
        circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        start = self._retina(field_deg, azimuths)
        if self.is_complete:
            target = np.tile(self._rim(circle), (len(field_deg), 1))
            point, found = self._aim_at_stop(start, target)
            if found.all():
                return point.reshape(len(field_deg), azimuths, 2)
            self.is_complete = False
        return self._scan(field_deg, circle)

    def _rim(self, circle: np.ndarray) -> np.ndarray:
        """Points of the stop's rim, (n, 2), mm."""
        return self._stop_radius * circle

    def _aim_at_stop(self, start: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Newton's method for the pupil points whose rays meet the stop plane at `target`, mm."""
        point = target * self._magnification
        step = 1e-4 * self._stop_radius
        for _ in range(8):
            reached, _ = self._reach(start, point)
            miss = target - reached
            if np.max(np.abs(miss)) < 1e-10:
                break
            along_x = (self._reach(start, point + step * _RIGHT)[0] - reached) / step
            along_y = (self._reach(start, point + step * _UP)[0] - reached) / step
            determinant = along_x[:, 0] * along_y[:, 1] - along_x[:, 1] * along_y[:, 0]
            safe = np.where(np.abs(determinant) > 1e-6, determinant, np.inf)
            dx = (miss[:, 0] * along_y[:, 1] - miss[:, 1] * along_y[:, 0]) / safe
            dy = (along_x[:, 0] * miss[:, 1] - along_x[:, 1] * miss[:, 0]) / safe
            point = point + np.stack([dx, dy], axis=1)
        reached, ok = self._reach(start, point)
        return point, ok & (np.max(np.abs(target - reached), axis=1) < 1e-7)

    def _scan(self, field_deg: np.ndarray, circle: np.ndarray) -> np.ndarray:
        """The outline by trial, where part of the stop cannot be seen: outermost rays that pass.

        Searches outwards from the chief ray in steps of 1/24 of the stop radius, to 2.5 radii, then
        within the last step, and returns the step after the last ray that passes the whole eye;
        (fields, azimuths, 2), mm.
        """
        chief = self._chief(self._retina(field_deg, 1))
        coarse = self._stop_radius / 24.0
        inner = np.zeros((len(field_deg), len(circle)))
        for step, count in ((coarse, 60), (coarse / 24.0, 24)):
            last = self._last_passing(field_deg, chief, circle, inner, step, count)
            inner = inner + step * last
        outermost = inner + step
        return chief[:, None, :] + outermost[..., None] * circle

    def _chief(self, retina_mm: np.ndarray) -> np.ndarray:
        """Where the rays from retinal points through the centre of the stop cross the pupil plane.

        From a fan of rays from the centre of the stop onto the retina; Newton's method would not
        converge where hardly any ray passes.
        """
        angle = np.linspace(0.0, _CHIEF_FAN_RAD, _CHIEF_RAYS)
        origins = np.broadcast_to([0.0, 0.0, self._stop_z], (_CHIEF_RAYS, 3))
        directions = np.stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)], axis=1)
        rays = trace_elements(self._from_stop, origins, directions, "retina")
        passed = rays.passed
        point, direction = rays.positions_mm[passed], rays.directions[passed]
        slope = direction[:, 1] / direction[:, 2]
        height = point[:, 1] + slope * (self.z_mm - point[:, 2])
        about_pupil = np.arctan2(point[:, 1], point[:, 2] - self.z_mm)
        wanted = np.arctan2(retina_mm[:, 1], retina_mm[:, 2] - self.z_mm)
        y = np.sign(wanted) * np.interp(np.abs(wanted), about_pupil, height)
        return np.stack([np.zeros_like(y), y], axis=1)

    def _last_passing(
        self,
        field_deg: np.ndarray,
        chief: np.ndarray,
        circle: np.ndarray,
        inner: np.ndarray,
        step: float,
        count: int,
    ) -> np.ndarray:
        """Number of the outermost of `count` steps from `inner` whose ray passes the eye."""
        numbers = np.arange(1, count + 1)
        radii = inner[:, None, :] + step * numbers[:, None]
        points = chief[:, None, None, :] + radii[..., None] * circle
        start = self._retina(field_deg, count * len(circle))
        points = points.reshape(-1, 2)
        rays = trace_elements(self._through, start, self._aim(start, points), "scene")
        passed = rays.passed.reshape(radii.shape)
        return np.max(np.where(passed, numbers[:, None], 0), axis=1)

    def compare(self, bound: ExitPupilBound, field_deg: np.ndarray) -> tuple[float, float]:
        """How far the outline reaches beyond the bound (1 touches it), and what it fills of it."""
        edge = self.edge(field_deg, _CHECK_AZIMUTHS)
        g = field_deg / bound.field_limit_deg
        s = (g * g)[:, np.newaxis]
        semi = evaluate(bound.semi, s)
        tangential = semi + s * evaluate(bound.stretch, s)
        u = edge[..., 0] / semi
        v = (edge[..., 1] - g[:, np.newaxis] * evaluate(bound.centre, s)) / tangential
        area = np.abs(np.sum(u * np.roll(v, -1, axis=1) - v * np.roll(u, -1, axis=1), axis=1)) / 2
        polygon = np.sin(2 * np.pi / _CHECK_AZIMUTHS) / (2 * np.pi / _CHECK_AZIMUTHS)
        return float(np.max(np.hypot(u, v))), float(np.min(area) / (np.pi * polygon))

    def losses(self, field_deg: np.ndarray) -> tuple[bool, bool]:
        """Whether rays through the edge are lost elsewhere, and whether they meet far sides."""
        if not self.is_complete:
            return True, True
        edge = self.edge(field_deg, _AZIMUTHS // 2).reshape(-1, 2)
        start = self._retina(field_deg, _AZIMUTHS // 2)
        aim = self._aim(start, edge)
        rays = trace_elements(self._through, start, aim, "scene")
        clipped = np.any(~rays.passed & (rays.status != RayStatus.STOPPED))
        unit = aim / np.linalg.norm(aim, axis=1, keepdims=True)
        return bool(clipped), bool(np.any(meets_far_side(self._open, start, unit, "scene")))

    def _retina(self, field_deg: np.ndarray, repeats: int) -> np.ndarray:
        point = self._map.retinal_point_mm(np.zeros_like(field_deg), field_deg)
        return np.repeat(point, repeats, axis=0)

    def _aim(self, start: np.ndarray, point: np.ndarray) -> np.ndarray:
        target = np.concatenate([point, np.full((len(point), 1), self.z_mm)], axis=1)
        return target - start

    def _reach(self, start: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rays = trace_elements(self._to_stop, start, self._aim(start, point), "scene")
        return rays.positions_mm[:, :2], rays.passed


def _open_plane(stop: Element) -> Element:
    """The plane of the stop, without its opaque part."""
    return dataclasses.replace(stop, kind=ElementKind.REFRACT, semi_diameter_mm=math.inf)
