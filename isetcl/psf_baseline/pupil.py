"""Where rays through points of the pupil land, for methods that follow light through parts of it.

The pupil is divided into cells of equal area in rings, each filled with rays. A ray through point
p of the pupil from an object at vergence V lands where the chief ray from another direction does;
the difference of that direction and the object's is its offset, in degrees of visual angle.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_count,
    check_finite,
    check_pair,
    check_positive,
    check_type,
)
from isetcl.eye import paraxial
from isetcl.eye.model import Eye
from isetcl.eye.prescription import elements
from isetcl.eye.rays import RayBundle
from isetcl.eye.sequential import trace_elements
from isetcl.psf_baseline.psf import launch, seen_from
from isetcl.units import MM_PER_M

MAX_SAMPLES = 1 << 16

_DIRECTIONS = 96
_BISECTIONS = 24
_LARGEST_PUPIL = 1.3  # of the paraxial radius
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
_LATTICE = np.arange(_DIRECTIONS) / _DIRECTIONS * 2.0 * math.pi


@dataclass(frozen=True, eq=False)
class PupilOffsets:
    """Rays through the pupil from objects at some vergences.

    Attributes
    ----------
    vergences_dpt : tuple of float
        Vergences of the objects, 1/m.
    points_mm : ndarray, (samples, rays, 2)
        Points (x, y) of the entrance pupil's plane, from its centre, mm.
    weights : ndarray, (samples, rays)
        Shares of the flux; their sum is 1.
    x_deg, y_deg : ndarray, (vergences, samples, rays)
        Offsets of where they land, degrees of visual angle; y is up.
    """

    vergences_dpt: tuple[float, ...]
    points_mm: np.ndarray
    weights: np.ndarray
    x_deg: np.ndarray
    y_deg: np.ndarray


def pupil_offsets(
    eye: Eye,
    wavelength_nm: float,
    vergences_dpt: Sequence[float],
    samples: int,
    *,
    rays_per_sample: int = 1,
    field_deg: tuple[float, float] = (0.0, 0.0),
) -> PupilOffsets:
    """Where the eye's own rays land, aberrations and longitudinal colour included.

    Parameters
    ----------
    wavelength_nm
        Wavelength, nm.
    vergences_dpt
        Vergences of objects, 1/m, as in `geometric_psf`.
    samples
        Cells of the pupil, of equal area before vignetting.
    rays_per_sample
        Rays in each; a single one goes through its middle.
    field_deg
        Field angles (x, y) of the objects.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule or no light passes.
    """
    check_type("eye", eye, Eye)
    check_positive("wavelength_nm", wavelength_nm, "nm")
    verges = np.array([check_finite("vergences_dpt", v, "dpt") for v in vergences_dpt])
    field = check_pair("field_deg", field_deg, "deg")
    unit = _cells(samples, rays_per_sample)
    tracer = _Tracer(eye, wavelength_nm, field)
    radius_mm = _boundary_mm(tracer, {float(verges.min()), float(verges.max())})
    turn = np.arctan2(unit[..., 1], unit[..., 0]).ravel()
    reach = np.interp(turn, _LATTICE, radius_mm, period=2.0 * math.pi)
    points = unit.reshape(-1, 2) * reach[:, None]
    weights, offsets = [], []
    for v in verges:
        rays, flux = tracer.through(points, float(v))
        # Equal areas of the unit disc are reach^2 as large here.
        weights.append(flux * reach**2)
        seen = seen_from(eye, wavelength_nm, rays) - np.array(field)
        offsets.append(np.where(rays.passed[:, None], seen, 0.0))
    passed = np.all(np.array(weights) > 0, axis=0)
    if not passed.any():
        raise InvalidInputError(
            f"no ray passes eye {eye.name!r} for all of {verges.tolist()} dpt at {field}; move the "
            "objects or the field position"
        )
    share = np.mean([w * passed / (w * passed).sum() for w in weights], axis=0)
    shape = unit.shape[:2]
    x, y = np.moveaxis(np.array(offsets), -1, 0).reshape(2, len(verges), *shape)
    return PupilOffsets(
        tuple(map(float, verges)), points.reshape(*shape, 2), share.reshape(shape), x, y
    )


def thin_lens_offsets(
    pupil_radius_mm: float, defocus_dpt: Sequence[float], samples: int, *, rays_per_sample: int = 1
) -> PupilOffsets:
    """Offsets -p dD of a thin lens without aberration; the vergences are relative to its focus.

    Parameters
    ----------
    pupil_radius_mm
        Radius of the pupil, mm.
    defocus_dpt
        dD, vergence of each object less that of the focus, 1/m.
    samples, rays_per_sample
        As in `pupil_offsets`.
    """
    check_positive("pupil_radius_mm", pupil_radius_mm, "mm")
    defocus = np.array([check_finite("defocus_dpt", d, "dpt") for d in defocus_dpt])
    unit = _cells(samples, rays_per_sample)
    points = unit * pupil_radius_mm
    x, y = (
        -np.degrees(points[None, ..., axis] / MM_PER_M * defocus[:, None, None]) for axis in (0, 1)
    )
    weights = np.full(unit.shape[:2], 1.0 / (unit.shape[0] * unit.shape[1]))
    return PupilOffsets(tuple(map(float, defocus)), points, weights, x, y)


def _cells(samples: int, rays_per_sample: int) -> np.ndarray:
    """Points of the unit disc, (samples, rays, 2), in cells of equal area."""
    samples = check_count("samples", samples, 1, MAX_SAMPLES)
    rays = check_count("rays_per_sample", rays_per_sample, 1, MAX_SAMPLES)
    rings = max(1, round(math.sqrt(samples / math.pi)))
    # Cells about as wide as high: ring i has pi (2 i + 1) of them.
    ends = np.round(samples * (np.arange(1, rings + 1) / rings) ** 2).astype(int)
    counts = np.diff(ends, prepend=0)
    if rays == 1:
        across, along = np.array([0.5]), np.array([0.5])
    else:
        i = np.arange(rays)
        across, along = (i * _GOLDEN + 0.5 / rays) % 1.0, (i + 0.5) / rays
    cells = []
    for ring, (count, end) in enumerate(zip(counts, ends, strict=True)):
        for sector in range(count):
            r = np.sqrt((end - count + count * along) / samples)
            angle = 2.0 * math.pi * ((sector + across) / count + _GOLDEN * ring)
            cells.append(np.stack([r * np.cos(angle), r * np.sin(angle)], axis=-1))
    return np.array(cells)


class _Tracer:
    """Rays of one wavelength and field position through points of the pupil."""

    def __init__(self, eye: Eye, wavelength_nm: float, field_deg: tuple[float, float]) -> None:
        self._elements = elements(eye, wavelength_nm)
        self._field = field_deg
        self._middle = eye.field_map(wavelength_nm).entrance_mm(*np.array(field_deg))
        self.largest_mm = _LARGEST_PUPIL * paraxial.entrance_pupil(eye, wavelength_nm).radius_mm

    def through(self, points_mm: np.ndarray, vergence_dpt: float) -> tuple[RayBundle, np.ndarray]:
        """The rays at the retina, and the flux of each, 0 where it does not arrive."""
        origins, directions = launch(points_mm, vergence_dpt, self._middle, self._field)
        rays = trace_elements(self._elements, origins, directions, "retina")
        return rays, directions[:, 2] ** 3 * rays.passed


def _boundary_mm(tracer: _Tracer, vergences_dpt: Collection[float]) -> np.ndarray:
    """How far from its centre the pupil reaches in every direction, by bisection, mm."""
    towards = np.stack([np.cos(_LATTICE), np.sin(_LATTICE)], axis=1)
    low, high = np.zeros(_DIRECTIONS), np.full(_DIRECTIONS, tracer.largest_mm)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        passed = np.ones(_DIRECTIONS, dtype=bool)
        for v in vergences_dpt:
            passed &= tracer.through(towards * middle[:, None], v)[0].passed
        low, high = np.where(passed, middle, low), np.where(passed, high, middle)
    return low
