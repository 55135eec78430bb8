"""Point spread functions of an eye, in degrees of visual angle in front of it.

A PSF belongs to a wavelength, a depth and a field position. It is what a pixel grid receives of the
flux of one object point, relative to that wavelength's own chief ray; its samples sum to the part
of the flux that falls on the kernel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_between,
    check_finite,
    check_pair,
    check_positive,
    check_type,
)
from isetcl.eye import paraxial
from isetcl.eye.field import direction_from_field
from isetcl.eye.field_plane import FieldPlane
from isetcl.eye.model import Eye
from isetcl.eye.prescription import elements
from isetcl.eye.rays import RayBundle
from isetcl.eye.sequential import trace_elements
from isetcl.units import MM_PER_M

MAX_KERNEL_PIXELS = 4096

PUPIL_RAYS = 1 << 16
RADIAL_RAYS = 2048
_BINS_PER_PIXEL = 8
_CORNEA_CLEARANCE_MM = 8.0
_SUM_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Psf:
    """A sampled point spread function.

    Attributes
    ----------
    kernel : ndarray, (n, n), n odd
        Fractions of the flux; row 0 is the upper side of the visual field.
    pitch_deg
        Width of a sample, degrees.
    energy_outside
        Fraction of the flux that falls beside the kernel; blur spreads it evenly.

    Raises
    ------
    InvalidInputError
        If the kernel is not square and odd, holds negative or infinite values, or the light in and
        beside it does not add up to 1.
    """

    kernel: np.ndarray
    pitch_deg: float
    energy_outside: float

    def __post_init__(self) -> None:
        kernel = check_array("psf: kernel", self.kernel)
        if kernel.ndim != 2 or kernel.shape[0] != kernel.shape[1] or kernel.shape[0] % 2 == 0:
            raise InvalidInputError(
                f"psf: kernel must be square with an odd number of samples, got {kernel.shape}; "
                "pad it with zeros"
            )
        if not np.isfinite(kernel).all() or kernel.min() < 0.0:
            raise InvalidInputError(
                f"psf: kernel must be finite and >= 0, since it holds shares of light, got "
                f"{kernel.min():g} to {kernel.max():g}; clip it and divide by its sum"
            )
        check_positive("psf: pitch_deg", self.pitch_deg, "deg")
        check_between("psf: energy_outside", self.energy_outside, -_SUM_TOLERANCE, 1.0)
        total = float(kernel.sum()) + self.energy_outside
        if abs(total - 1.0) > _SUM_TOLERANCE:
            raise InvalidInputError(
                f"psf: kernel and energy_outside must add up to 1, got {total:.7g}; divide the "
                "kernel by its sum, or say what is outside"
            )
        object.__setattr__(self, "kernel", kernel)

    @property
    def radius(self) -> int:
        """Samples from the middle to the border."""
        return self.kernel.shape[0] // 2


def geometric_psf(
    eye: Eye,
    wavelength_nm: float,
    vergence_dpt: float,
    pitch_deg: float,
    field_deg: tuple[float, float] = (0.0, 0.0),
) -> Psf:
    """The PSF of an object point from an eye's own rays, without diffraction.

    Where its light lands, the PSF of kind "geometric_spread"; that of kind "geometric" is where a
    retinal point gathers light from. On the axis of an eye that is a figure of revolution a
    meridional fan is traced and turned about the axis; otherwise the whole pupil is filled. Every
    ray carries the flux of its share of solid angle. The kernel is as large as the rays need.

    Parameters
    ----------
    wavelength_nm
        Wavelength, nm.
    vergence_dpt
        1/(distance along the axis from the corneal vertex), 1/m; 0 is infinity.
    pitch_deg
        Width of a sample, degrees of field angle.
    field_deg
        Field angles (x, y) of the point.

    Raises
    ------
    InvalidInputError
        If the point lies in or behind the eye, or the blur needs more than 4096 samples across.
    """
    check_type("eye", eye, Eye)
    check_positive("wavelength_nm", wavelength_nm, "nm")
    check_positive("pitch_deg", pitch_deg, "deg")
    check_finite("vergence_dpt", vergence_dpt, "dpt")
    field_deg = check_pair("field_deg", field_deg, "deg")
    if not 0.0 <= vergence_dpt < MM_PER_M / _CORNEA_CLEARANCE_MM:
        raise InvalidInputError(
            f"vergence_dpt must lie between 0 and {MM_PER_M / _CORNEA_CLEARANCE_MM:g} dpt (the "
            f"object in front of the eye), got {vergence_dpt:g} dpt"
        )
    if field_deg == (0.0, 0.0) and eye.is_rotational:
        radius_deg, weights = _axial_spread(eye, wavelength_nm, vergence_dpt)
        return turned(radius_deg / pitch_deg, weights, pitch_deg)
    x, y, weights = spread_deg(eye, wavelength_nm, vergence_dpt, field_deg)
    return deposited(x / pitch_deg, y / pitch_deg, weights, pitch_deg)


def _axial_spread(
    eye: Eye, wavelength_nm: float, vergence_dpt: float
) -> tuple[np.ndarray, np.ndarray]:
    """Signed distances from the axis in degrees, and flux, of a fan of rays from an axial point."""
    pupil = paraxial.entrance_pupil(eye, wavelength_nm)
    # A little more than the paraxial pupil; the stop decides.
    heights = 1.05 * pupil.radius_mm * np.sqrt((np.arange(RADIAL_RAYS) + 0.5) / RADIAL_RAYS)
    origins, directions = launch(
        np.stack([np.zeros_like(heights), heights], axis=1),
        vergence_dpt,
        np.array([0.0, 0.0, pupil.z_mm]),
        (0.0, 0.0),
    )
    rays = trace_elements(elements(eye, wavelength_nm), origins, directions, "retina")
    field = seen_from(eye, wavelength_nm, rays)
    flux = directions[:, 2] ** 3 * rays.passed
    _check_flux(eye, flux, vergence_dpt)
    return field[rays.passed, 1], (flux / flux.sum())[rays.passed]


def spread_deg(
    eye: Eye,
    wavelength_nm: float,
    vergence_dpt: float,
    field_deg: tuple[float, float],
    count: int = PUPIL_RAYS,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Offsets (x, y) from the chief ray in degrees, and flux, of rays that fill the pupil.

    As many of the `count` rays as pass; the sum of the flux is 1.
    """
    pupil = paraxial.entrance_pupil(eye, wavelength_nm)
    i = np.arange(count)
    radius = 1.3 * pupil.radius_mm * np.sqrt((i + 0.5) / count)
    turn = i * math.pi * (3.0 - math.sqrt(5.0))
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    middle = eye.field_map(wavelength_nm).entrance_mm(*np.array(field_deg))
    origins, directions = launch(points, vergence_dpt, middle, field_deg)
    rays = trace_elements(elements(eye, wavelength_nm), origins, directions, "retina")
    seen = seen_from(eye, wavelength_nm, rays)
    flux = directions[:, 2] ** 3 * rays.passed
    _check_flux(eye, flux, vergence_dpt)
    offset = (seen - np.array(field_deg))[rays.passed]
    return offset[:, 0], offset[:, 1], (flux / flux.sum())[rays.passed]


def _check_flux(eye: Eye, flux: np.ndarray, vergence_dpt: float) -> None:
    if not flux.sum() > 0:
        raise InvalidInputError(
            f"no ray of an object at {vergence_dpt:g} dpt passes eye {eye.name!r}; "
            "move the object or the field position"
        )


def launch(
    pupil_mm: np.ndarray, vergence_dpt: float, centre: np.ndarray, field_deg: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Rays from one object point through points (n, 2) of the entrance pupil's plane, mm.

    The points count from the pupil's centre (3,), mm, in the eye frame. The object's distance
    enters as its vergence, so that infinity is no special case. Rays start outside the cornea.
    """
    towards = direction_from_field(*np.array(field_deg))
    through = centre + np.concatenate([pupil_mm, np.zeros((len(pupil_mm), 1))], axis=1)
    # The object point is centre + towards * t with its depth 1000 / vergence from the cornea.
    per_mm = vergence_dpt / MM_PER_M
    reach = (1.0 + per_mm * centre[2]) / -towards[2]
    direction = per_mm * (through - centre) - reach * towards
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    back = (through[:, 2:] + _CORNEA_CLEARANCE_MM) / direction[:, 2:]
    return through - back * direction, direction


def seen_from(eye: Eye, wavelength_nm: float, rays: RayBundle) -> np.ndarray:
    """Field angles (x, y) in degrees of the chief rays to the retinal points of rays, (n, 2).

    Those of rays that were lost mean nothing.
    """
    chief = eye.field_map(wavelength_nm)
    point = rays.positions_mm
    if isinstance(chief, FieldPlane):
        seen = np.zeros((len(point), 2))
        seen[rays.passed] = chief.field_of_point_deg(point[rays.passed])
        return seen
    height = np.hypot(point[:, 0], point[:, 1])
    depth = point[:, 2] - eye.retina.vertex_z_mm
    arc = _arc_mm(eye, height, depth)
    reach = float(chief.arc_mm(chief.max_field_deg))
    field = chief.field_deg(np.minimum(arc, reach))
    scale = -field / np.where(height > 0, height, 1.0)
    return point[:, :2] * scale[:, None]


def _arc_mm(eye: Eye, height_mm: np.ndarray, depth_mm: np.ndarray) -> np.ndarray:
    """Arc length on the retina from its vertex to points given by height and depth, mm."""
    c, conic = eye.retina.curvature, eye.retina.conic
    if c == 0.0:
        return height_mm
    if conic == 0.0:
        return np.arctan2(height_mm, depth_mm - 1.0 / c) / -c
    nodes, weights = np.polynomial.legendre.leggauss(32)
    rho = height_mm[:, None] * (nodes + 1.0) / 2.0
    inside = np.maximum(1.0 - (1.0 + conic) * (c * rho) ** 2, 1e-12)
    return height_mm / 2.0 * np.sum(weights * np.sqrt(1.0 + (c * rho) ** 2 / inside), axis=1)


def turned(radius: np.ndarray, weights: np.ndarray, pitch_deg: float) -> Psf:
    """A kernel from a radial distribution (in samples), every ray spread over its ring.

    Between neighbouring rays of the fan the flux is spread evenly, so that the rings are dense.
    """
    distance, flux = _densified(radius, weights)
    half = _kernel_radius(float(distance.max()))
    bins = np.bincount(
        (distance * _BINS_PER_PIXEL).astype(int), flux, minlength=(half + 1) * _BINS_PER_PIXEL
    )
    used = np.flatnonzero(bins > 0)
    ring = (used + 0.5) / _BINS_PER_PIXEL
    points = np.maximum(8, np.ceil(4.0 * ring)).astype(int)
    which = np.repeat(np.arange(len(used)), points)
    number = np.arange(len(which)) - np.repeat(np.cumsum(points) - points, points)
    # An eighth of each ring, started at an angle of its own so that the points do not line up; the
    # eye is symmetric about its axis, so the other seven eighths are copies.
    angle = np.pi / 4.0 * (number + (which * 0.618033988749895) % 1.0) / points[which]
    column = np.rint(ring[which] * np.cos(angle)).astype(int) + half
    row = np.rint(ring[which] * np.sin(angle)).astype(int) + half
    size = 2 * half + 1
    share = (bins[used] / points)[which]
    counts = np.bincount(row * size + column, share, minlength=size * size)
    kernel = np.asarray(counts, dtype=np.float64).reshape(size, size)
    kernel = (kernel + kernel[::-1]) / 2.0
    kernel = (kernel + kernel[:, ::-1]) / 2.0
    kernel = (kernel + kernel.T) / 2.0
    return Psf(kernel, pitch_deg, 1.0 - float(kernel.sum()))


def _densified(radius: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ray distances and flux with each gap between neighbours filled evenly."""
    gap = np.abs(np.diff(radius))
    pieces = int(np.clip(np.ceil(gap.max() * _BINS_PER_PIXEL), 1, 64)) if len(gap) else 1
    step = (np.arange(pieces) + 0.5) / pieces
    between = radius[:-1, None] + step * np.diff(radius)[:, None]
    flux = (weights[:-1] + weights[1:])[:, None] / 2.0 * np.ones(pieces) / pieces
    ends_flux = np.array([weights[0] / 2.0, weights[-1] / 2.0])
    distance = np.abs(np.concatenate([between.ravel(), radius[[0, -1]]]))
    return distance, np.concatenate([flux.ravel(), ends_flux])


def deposited(x: np.ndarray, y: np.ndarray, weights: np.ndarray, pitch_deg: float) -> Psf:
    """A kernel from points (in samples), each shared between the four samples around it."""
    half = _kernel_radius(float(max(np.abs(x).max(), np.abs(y).max())) + 1.0)
    size = 2 * half + 1
    column, row = x + half, half - y
    left, top = np.floor(column).astype(int), np.floor(row).astype(int)
    fx, fy = column - left, row - top
    kernel = np.zeros(size * size)
    for dx, dy, share in (
        (0, 0, (1 - fx) * (1 - fy)),
        (1, 0, fx * (1 - fy)),
        (0, 1, (1 - fx) * fy),
        (1, 1, fx * fy),
    ):
        kernel += np.bincount((top + dy) * size + left + dx, weights * share, minlength=size * size)
    return Psf(kernel.reshape(size, size), pitch_deg, 1.0 - float(kernel.sum()))


def _kernel_radius(reach: float) -> int:
    half = math.ceil(reach + 0.5)
    if 2 * half + 1 > MAX_KERNEL_PIXELS:
        raise InvalidInputError(
            f"the blur reaches {2 * half + 1} samples across, more than {MAX_KERNEL_PIXELS}; "
            "use larger pixels, a smaller stop or objects nearer to focus"
        )
    return half
