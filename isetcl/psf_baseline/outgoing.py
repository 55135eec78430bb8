"""Rays from a retinal point out of the eye: what it gathers light from.

The PSF of an object point says where its light lands. An image is made the other way: a retinal
point gathers the light of all directions that rays reach it from. Both are the same where an eye
blurs alike all over its field. Where coma grows with the field, points on either side of the middle
of a blur disc are blurred differently, and discs gathered and spread differ in size by about as
much as the eye offends against the sine condition: 1 % in Navarro's eye with a pupil of 4 mm, which
changes the contrast of checks 1.5 dpt out of focus by 2 %.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.eye.model import Eye
from isetcl.eye.prescription import ElementKind, elements
from isetcl.eye.rays import RayBundle
from isetcl.eye.retina_form import retinal_normal
from isetcl.eye.sequential import trace_elements
from isetcl.psf_baseline.psf import launch
from isetcl.units import MM_PER_M

LARGEST_PUPIL = 1.3
"""Radius, over that of the paraxial exit pupil, within which rays are tried off the axis."""

_GOLDEN_TURN = math.pi * (3.0 - math.sqrt(5.0))


@dataclass(frozen=True, eq=False)
class Outgoing:
    """Rays of one retinal point in front of the eye.

    Attributes
    ----------
    origins_mm, directions : ndarray, (n, 3)
        Of the rays as they leave the cornea, eye frame.
    flux : ndarray, (n,)
        Share of irradiance per area of the exit pupil's plane, unnormalised; 0 for lost rays.
    entrance_mm : ndarray, (3,)
        Where the point's chief ray crosses the axis in front of the eye.
    field_deg
        Where that chief ray comes from.
    """

    origins_mm: np.ndarray
    directions: np.ndarray
    flux: np.ndarray
    entrance_mm: np.ndarray
    field_deg: tuple[float, float]

    def offsets_deg(self, vergence_dpt: float) -> np.ndarray:
        """How far what each ray meets at a vergence is moved in the image, (n, 2), degrees.

        The field angle of the retinal point less that of where the ray crosses the plane 1/vergence
        before the cornea, as the middle of the entrance pupil sees it. Of lost rays it is 0.
        """
        v = vergence_dpt / MM_PER_M
        # Times the vergence, so that infinity is no special case.
        reach = (1.0 + v * self.origins_mm[:, 2:]) / -self.directions[:, 2:]
        towards = v * (self.origins_mm - self.entrance_mm) + reach * self.directions
        across = np.hypot(towards[:, 0], towards[:, 1])
        angle = np.degrees(np.arctan2(across, -towards[:, 2]))
        seen = towards[:, :2] * (angle / np.where(across > 0, across, 1.0))[:, None]
        return np.where(self.flux[:, None] > 0, np.array(self.field_deg) - seen, 0.0)

    def entrance_points_mm(self) -> np.ndarray:
        """Points (x, y) of the plane of the entrance pupil that rays come through, (n, 2), mm.

        From its centre; 0 for lost rays.
        """
        back = (self.entrance_mm[2] - self.origins_mm[:, 2:]) / self.directions[:, 2:]
        points = self.origins_mm + back * self.directions - self.entrance_mm
        return np.where(self.flux[:, None] > 0, points[:, :2], 0.0)


class RetinalPoint:
    """A point of the retina, by the field angles (x, y) of its own chief ray at a wavelength.

    Points of its exit pupil count from where the chief ray crosses the plane of the paraxial exit
    pupil, mm.

    Raises
    ------
    InvalidInputError
        If the chief ray does not pass the eye.
    """

    def __init__(self, eye: Eye, wavelength_nm: float, field_deg: tuple[float, float]) -> None:
        chief = eye.field_map(wavelength_nm)
        field = np.array(field_deg)
        sequence = elements(eye, wavelength_nm)
        self._outwards = tuple(e for e in reversed(sequence) if e.kind is not ElementKind.RETINA)
        self._entrance = chief.entrance_mm(*field)
        self._field = field_deg
        origin, direction = launch(np.zeros((1, 2)), 0.0, self._entrance, field_deg)
        ray = trace_elements(sequence, origin, direction, "retina")
        if not ray.passed[0]:
            raise InvalidInputError(
                f"no ray from {field_deg} deg passes eye {eye.name!r}; move the field position"
            )
        pupil = eye.exit_pupil(wavelength_nm)
        self.radius_mm = pupil.radius_mm
        self._start = np.asarray(chief.retinal_point_mm(*field[:, None])).reshape(3)
        self._normal = retinal_normal(eye.retina, self._start[None])[0]
        along = ray.directions[0] / ray.directions[0, 2]
        self._middle = ray.positions_mm[0] + (pupil.z_mm - ray.positions_mm[0, 2]) * along

    def through(self, points_mm: np.ndarray) -> Outgoing:
        """Rays through points (n, 2) of the exit pupil."""
        target = self._middle + np.concatenate([points_mm, np.zeros((len(points_mm), 1))], axis=1)
        away = target - self._start
        distance2 = np.sum(away * away, axis=1)
        directions = away / np.sqrt(distance2)[:, None]
        # A pupil behind the retina is looked away from.
        directions *= math.copysign(1.0, float(self._start[2] - self._middle[2]))
        starts = np.broadcast_to(self._start, target.shape)
        rays: RayBundle = trace_elements(self._outwards, starts, directions, "scene")
        flux = np.abs(directions @ self._normal) * np.abs(directions[:, 2]) / distance2
        return Outgoing(
            rays.positions_mm,
            rays.directions,
            np.where(rays.passed & (rays.directions[:, 2] < 0.0), flux, 0.0),
            self._entrance,
            self._field,
        )


def gathered_deg(
    eye: Eye,
    wavelength_nm: float,
    vergence_dpt: float,
    field_deg: tuple[float, float],
    count: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Offsets (x, y) in degrees, and flux, of rays that fill the pupil of a retinal point.

    As many of the `count` rays as pass; the sum of the flux is 1. See `Outgoing.offsets_deg`.

    Raises
    ------
    InvalidInputError
        If no ray passes.
    """
    return kept(_filling(eye, wavelength_nm, field_deg, count), vergence_dpt)


@functools.lru_cache(maxsize=2)
def _filling(
    eye: Eye, wavelength_nm: float, field_deg: tuple[float, float], count: int
) -> Outgoing:
    """Rays that fill the pupil; they serve all depths, which are asked for one after the other."""
    point = RetinalPoint(eye, wavelength_nm, field_deg)
    i = np.arange(count)
    radius = LARGEST_PUPIL * point.radius_mm * np.sqrt((i + 0.5) / count)
    turn = i * _GOLDEN_TURN
    return point.through(np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1))


def gathered_fan_deg(
    eye: Eye, wavelength_nm: float, vergence_dpt: float, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Signed offsets in degrees, and flux, of a fan of rays from the retina's vertex.

    For eyes that are figures of revolution; every ray stands for a ring of the pupil.
    """
    point = RetinalPoint(eye, wavelength_nm, (0.0, 0.0))
    # A little more than the paraxial pupil; the stop decides.
    heights = 1.05 * point.radius_mm * np.sqrt((np.arange(count) + 0.5) / count)
    rays = point.through(np.stack([np.zeros_like(heights), heights], axis=1))
    _, y, flux = kept(rays, vergence_dpt)
    return y, flux


def kept(rays: Outgoing, vergence_dpt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Offsets (x, y) in degrees, and flux of sum 1, of the rays that pass."""
    passed = rays.flux > 0
    if not passed.any():
        raise InvalidInputError(
            f"no ray from {rays.field_deg} deg passes the eye; move the field position"
        )
    x, y = rays.offsets_deg(vergence_dpt)[passed].T
    return x, y, rays.flux[passed] / rays.flux.sum()
