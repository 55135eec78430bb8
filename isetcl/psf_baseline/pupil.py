"""Where rays through points of the pupil come from, for methods that follow parts of the light.

The pupil is divided into cells of equal area in rings, each filled with rays. A ray of a retinal
point through point p of the pupil meets an object at vergence V in another direction than the
point's chief ray comes from; the chief ray's direction less the object's is its offset, in degrees
of visual angle. It is one ray for all vergences, so that what stands before what is right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
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
from isetcl.eye.model import Eye
from isetcl.psf_baseline.outgoing import LARGEST_PUPIL, RetinalPoint
from isetcl.units import MM_PER_M

MAX_SAMPLES = 1 << 16

_DIRECTIONS = 96
_BISECTIONS = 24
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
_LATTICE = np.arange(_DIRECTIONS) / _DIRECTIONS * 2.0 * math.pi


@dataclass(frozen=True, eq=False)
class PupilOffsets:
    """Rays of a retinal point through the pupil, and what they meet at some vergences.

    Attributes
    ----------
    vergences_dpt : tuple of float
        Vergences of the objects, 1/m.
    points_mm : ndarray, (samples, rays, 2)
        Points (x, y) of the entrance pupil's plane, from its centre, mm.
    weights : ndarray, (samples, rays)
        Shares of the flux; their sum is 1.
    x_deg, y_deg : ndarray, (vergences, samples, rays)
        How far what they meet is moved in the image, degrees of visual angle; y is up.
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
    """What the eye's own rays meet, aberrations and longitudinal colour included.

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
        Field angles (x, y) of the retinal point.

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
    point = RetinalPoint(eye, wavelength_nm, field)
    turn = np.arctan2(unit[..., 1], unit[..., 0]).ravel()
    reach = np.interp(turn, _LATTICE, _boundary_mm(point), period=2.0 * math.pi)
    rays = point.through(unit.reshape(-1, 2) * reach[:, None])
    if not np.any(rays.flux > 0):
        raise InvalidInputError(
            f"no ray passes eye {eye.name!r} at {field}; move the field position"
        )
    # Equal areas of the unit disc are reach^2 as large here.
    share = rays.flux * reach**2
    shape = unit.shape[:2]
    offsets = np.array([rays.offsets_deg(float(v)) for v in verges])
    x, y = np.moveaxis(offsets, -1, 0).reshape(2, len(verges), *shape)
    points = rays.entrance_points_mm().reshape(*shape, 2)
    return PupilOffsets(
        tuple(map(float, verges)), points, (share / share.sum()).reshape(shape), x, y
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


def _boundary_mm(point: RetinalPoint) -> np.ndarray:
    """How far from its centre the pupil reaches in every direction, by bisection, mm."""
    towards = np.stack([np.cos(_LATTICE), np.sin(_LATTICE)], axis=1)
    low, high = np.zeros(_DIRECTIONS), np.full(_DIRECTIONS, LARGEST_PUPIL * point.radius_mm)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        passed = point.through(towards * middle[:, None]).flux > 0
        low, high = np.where(passed, middle, low), np.where(passed, high, middle)
    return low
