"""Images of a point from rays alone, without diffraction: spot diagrams and geometric MTF."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_count, check_finite
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.object_point import ObjectPoint
from isetcl.eye.smooth_map import SmoothMap
from isetcl.eye.visual_angle import retinal_scale, visual_angle_deg
from isetcl.eye.waves.otf import check_frequencies
from isetcl.eye.waves.wavefront import Wavefront
from isetcl.units import ARCMIN_PER_DEG

_DEGREE = 12

FEWEST_RINGS = 9
"""Least rings of a spot: 24 spokes, which 8 rings have, do not tell cos(12 phi) from 0."""


@dataclass(frozen=True, eq=False)
class Spot:
    """Where the rays of an object point meet the retina; n rays.

    Attributes
    ----------
    x_arcmin, y_arcmin : ndarray, (n,)
        Visual angles to the right and up from the chief ray's point.
    weights : ndarray, (n,)
        Shares of the flux; they sum to 1.
    entrance_mm : ndarray, (n, 2)
        Where the rays cross the entrance pupil, mm from the chief ray.
    mm_per_deg : ndarray, (2,)
        Length on the retina of a degree of visual angle to the right and up, mm.
    wavelength_nm
        Wavelength, nm.
    """

    x_arcmin: np.ndarray
    y_arcmin: np.ndarray
    weights: np.ndarray
    entrance_mm: np.ndarray
    mm_per_deg: np.ndarray
    wavelength_nm: float

    @property
    def centroid_arcmin(self) -> tuple[float, float]:
        """Mean position by flux, arcmin."""
        return float(self.weights @ self.x_arcmin), float(self.weights @ self.y_arcmin)

    @property
    def rms_arcmin(self) -> float:
        """Root-mean-square distance from the centroid by flux, arcmin."""
        x, y = self.centroid_arcmin
        squared = (self.x_arcmin - x) ** 2 + (self.y_arcmin - y) ** 2
        return float(np.sqrt(self.weights @ squared))

    def otf(
        self, frequency_cpd: np.ndarray | Sequence[float], orientation_deg: float = 0.0
    ) -> np.ndarray:
        """Complex geometric OTF along one direction, (n,); see `OpticalTransfer.mtf`."""
        frequency = check_frequencies(frequency_cpd) / ARCMIN_PER_DEG
        angle = math.radians(check_finite("orientation_deg", orientation_deg, "deg"))
        along = math.cos(angle) * self.x_arcmin + math.sin(angle) * self.y_arcmin
        return np.asarray(np.exp(-2j * np.pi * np.outer(frequency, along)) @ self.weights)

    def mtf(
        self, frequency_cpd: np.ndarray | Sequence[float], orientation_deg: float = 0.0
    ) -> np.ndarray:
        """Geometric MTF at frequencies in cycles/degree along one direction, (n,)."""
        return np.abs(self.otf(frequency_cpd, orientation_deg))


def spot(
    eye: Eye,
    field_deg: tuple[float, float] | float = (0.0, 0.0),
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
    *,
    object_distance_m: float = math.inf,
    rings: int = 40,
    scale_wavelength_nm: float | None = None,
) -> Spot:
    """Rays that fill the stop from an object point, weighted by flux.

    Gauss quadrature in the squared radius and even angles over the stop; each ray carries the flux
    of its share of the entrance pupil, so that smooth functions of the rays are summed exactly.

    Parameters
    ----------
    field_deg, wavelength_nm, object_distance_m, scale_wavelength_nm
        As in `Eye.wavefront`.
    rings
        Rings of rays, 9 to 400; each has 2 rings + 8 rays.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule, or rays are vignetted.
    """
    rings = check_count("rings", rings, FEWEST_RINGS, 400)
    source = ObjectPoint(eye, field_deg, wavelength_nm, object_distance_m)
    chief = source.chief()
    nodes, shares = np.polynomial.legendre.leggauss(rings)
    spokes = 2 * rings + 8
    turn = 2.0 * np.pi * (np.arange(spokes) + 0.5) / spokes
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    radius = np.sqrt((nodes + 1.0) / 2.0)
    stop = eye.stop.rim_mm((radius[:, None, None] * circle).reshape(-1, 2))
    points, found = source.aim(stop)
    rays = source.trace(points)
    if not (found & rays.passed).all():
        lost = 100.0 * float(np.mean(~(found & rays.passed)))
        raise InvalidInputError(
            f"eye {eye.name!r}: {lost:.2g} % of the stop is vignetted from field "
            f"{source.field_deg} deg; use a smaller field angle, a smaller stop or larger "
            "semi-diameters"
        )
    slopes = SmoothMap(stop, points, _DEGREE).gradient(stop)
    spread = (1.0 + source.per_mm**2 * np.sum(points**2, axis=1)) ** -1.5
    flux = np.repeat(shares, spokes) * np.abs(np.linalg.det(slopes)) * spread
    scale_map = source.map if scale_wavelength_nm is None else eye.field_map(scale_wavelength_nm)
    scale = retinal_scale(eye.retina, scale_map, source.field_deg)
    seen = visual_angle_deg(rays.point_mm - chief.point_mm[0], scale) * ARCMIN_PER_DEG
    return Spot(
        seen[:, 0],
        seen[:, 1],
        flux / flux.sum(),
        points - chief.entrance_mm[0],
        np.linalg.norm(scale, axis=1),
        source.wavelength_nm,
    )


def spot_of_wavefront(front: Wavefront) -> Spot:
    """The spot diagram that a wavefront implies: rays are its normals, v = grad_q W / lambda."""
    used = front.inside
    x, y = np.meshgrid(front.x_cpd, front.y_cpd)
    q = np.stack([x[used], y[used]], axis=1)
    # Cells on the rim are sampled beside their middles.
    whole = front.amplitude[used] ** 2 > front.flux[used] * (1.0 - 1e-6)
    waves = SmoothMap(q[whole], front.opd_waves[used][whole][:, None], _DEGREE)
    seen = waves.gradient(q)[:, 0, :] * ARCMIN_PER_DEG
    return Spot(
        seen[:, 0],
        seen[:, 1],
        front.flux[used],
        front.entrance_mm[used],
        np.linalg.norm(front.mm_per_deg, axis=1),
        front.wavelength_nm,
    )


def shifted(spot_diagram: Spot, offset_arcmin: np.ndarray) -> Spot:
    """The same spot diagram, displaced by (x, y) arcmin."""
    return dataclasses.replace(
        spot_diagram,
        x_arcmin=spot_diagram.x_arcmin + offset_arcmin[0],
        y_arcmin=spot_diagram.y_arcmin + offset_arcmin[1],
    )
