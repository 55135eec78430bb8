"""The image of an axial point through the whole pupil of an eye that is no figure of revolution."""

from __future__ import annotations

import copy

import numpy as np

from isetcl.errors import FocusError, InvalidInputError
from isetcl.eye.model import Eye
from isetcl.eye.object_point import ObjectPoint
from isetcl.eye.smooth_map import SmoothMap
from isetcl.units import MM_PER_M

_RINGS = 12
_SPOKES = 24
_DEGREE = 10


class SpotPupil:
    """The rays of an axial object that fill the stop, weighted by their flux."""

    def __init__(self, eye: Eye, wavelength_nm: float) -> None:
        try:
            self._source = ObjectPoint(eye, (0.0, 0.0), wavelength_nm)
        except InvalidInputError as reason:
            raise FocusError(f"eye {eye.name!r} cannot be focused: {reason}") from reason
        nodes, shares = np.polynomial.legendre.leggauss(_RINGS)
        turn = 2.0 * np.pi * (np.arange(_SPOKES) + 0.5) / _SPOKES
        circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        disc = np.sqrt((nodes + 1.0) / 2.0)[:, None, None] * circle
        self._stop = eye.stop.rim_mm(disc.reshape(-1, 2))
        self._shares = np.repeat(shares, _SPOKES)
        self._points: np.ndarray | None = None

    def mean_square_mm2(self, vergence_dpt: float) -> float:
        """Flux-weighted mean square distance from the centroid on the retina, mm^2."""
        source = copy.copy(self._source)
        per_mm = vergence_dpt / MM_PER_M
        source.per_mm = per_mm / (1.0 + per_mm * source.entrance_z_mm)
        # The rays of the last vergence are near those of the next.
        points, found = source.aim(self._stop, self._points)
        rays = source.trace(points)
        if not (found & rays.passed).all():
            raise FocusError(
                f"eye {source.eye.name!r}: rays from an axial point at {vergence_dpt:g} dpt do not "
                f"fill the stop (diameter {source.eye.stop.diameter_mm:g} mm); use a smaller stop"
            )
        self._points = points
        slopes = SmoothMap(self._stop, points, _DEGREE).gradient(self._stop)
        spread = (1.0 + source.per_mm**2 * np.sum(points**2, axis=1)) ** -1.5
        flux = self._shares * np.abs(np.linalg.det(slopes)) * spread
        centroid = flux @ rays.point_mm / np.sum(flux)
        distance2 = np.sum((rays.point_mm - centroid) ** 2, axis=1)
        return float(flux @ distance2 / np.sum(flux))
