"""Bands: groups of wavelengths that share one trace through the lens.

The eye's dispersion is smooth, so the lens is traced for a few wavelengths and each serves its
neighbours. Every wavelength of the grid belongs to exactly one band, for every number of bands.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Literal

import numpy as np

from isetcl.errors import check_count
from isetcl.eye import paraxial
from isetcl.eye.field import field_map
from isetcl.eye.field_plane import FieldPlane, field_plane
from isetcl.eye.model import Eye
from isetcl.retina.grid import RetinalGrid
from isetcl.units import ARCMIN_PER_DEG, MM_PER_M, NM_PER_M

AUTO_LIMIT = 16
"""Most bands that "auto" chooses for the sake of pixels; the paper found 8 to 16 sufficient."""

AUTO_TOLERANCE_PIXELS = 0.5
"""Chromatic displacement inside a band that "auto" accepts, in pixels."""

FEW_WAVELENGTHS = 8
"""Grids of so few wavelengths are not joined into bands by "auto": whoever asks for few wants each
of them right, and half a pixel of lateral colour is no small part of their difference."""

_SHARE_OF_ERROR = 0.4
"""What bands may add to an image, relative to the error wanted: in quadrature 8 %."""

_ACHROMATIC_PIXELS = 1e-6


@dataclass(frozen=True)
class Band:
    """Wavelengths `first` to `last` (indices, inclusive) of a grid, traced at `wavelength_nm`."""

    first: int
    last: int
    wavelength_nm: float

    @property
    def members(self) -> slice:
        """The wavelengths of the band, as a slice of the grid."""
        return slice(self.first, self.last + 1)


@dataclass(frozen=True, eq=False)
class BandChoice:
    """Bands, and the largest chromatic displacement they leave, in pixels."""

    bands: tuple[Band, ...]
    displacement_pixels: float
    is_achromatic: bool


def choose_bands(
    eye: Eye,
    grid: RetinalGrid,
    wavelengths_nm: np.ndarray,
    bands: int | Literal["auto"],
    expected_error: float = 0.01,
    *,
    has_diffraction: bool = False,
) -> BandChoice:
    """Contiguous bands over a wavelength grid.

    The displacement of a wavelength is how far its rays land from where the band's wavelength
    puts them: the change of the blur radius by longitudinal chromatic aberration plus the
    transverse shift at the edge of the field. The partition makes the largest one smallest.

    Parameters
    ----------
    bands
        A number from 1 to the number of wavelengths, or ``"auto"``: as few as keep the
        displacement below half a pixel, at most 16, but as many as the expected error needs; one if
        the eye is achromatic; one for each of up to 8 wavelengths.
    expected_error
        Photopic relative error that the image will have from its samples.
    has_diffraction
        Count the growth of the diffraction pattern (lambda / D) with wavelength as displacement.

    Raises
    ------
    InvalidInputError
        If the number is out of range.
    """
    count = len(wavelengths_nm)
    position = _chromatic_position(eye, grid, wavelengths_nm)
    if has_diffraction:
        # Both change monotonically; counted as if they added.
        growth = _diffraction_position(eye, grid, wavelengths_nm)
        position = position + (growth if position[-1] >= position[0] else -growth)
    cost = _interval_costs(wavelengths_nm, position)
    is_achromatic = bool(np.ptp(position) <= _ACHROMATIC_PIXELS)
    if not isinstance(bands, str) or bands != "auto":
        wanted = check_count("bands", bands, 1, count)
        chosen = _partition(wavelengths_nm, cost, wanted)
    elif is_achromatic:
        chosen = _partition(wavelengths_nm, cost, 1)
    elif count <= FEW_WAVELENGTHS:
        chosen = _partition(wavelengths_nm, cost, count)
    else:
        for wanted in range(1, count + 1):
            chosen = _partition(wavelengths_nm, cost, wanted)
            worst = _worst(chosen, cost)
            is_fine = worst <= AUTO_TOLERANCE_PIXELS or wanted >= AUTO_LIMIT
            if is_fine and _band_error(worst, grid) <= _SHARE_OF_ERROR * expected_error:
                break
    return BandChoice(chosen, _worst(chosen, cost), is_achromatic)


def split_bands(choice: BandChoice, wavelengths_nm: np.ndarray, most: int) -> BandChoice:
    """The same bands, those of more than `most` wavelengths cut into pieces of like size."""
    bands = []
    for band in choice.bands:
        count = band.last - band.first + 1
        edges = np.linspace(0, count, -(-count // most) + 1).astype(int) + band.first
        bands += [_band(wavelengths_nm, int(a), int(b) - 1) for a, b in itertools.pairwise(edges)]
    return BandChoice(tuple(bands), choice.displacement_pixels, choice.is_achromatic)


def _band_error(displacement_pixels: float, grid: RetinalGrid) -> float:
    """Photopic error to expect of bands with a displacement, relative.

    0.005 (d/arcmin)^1.8, or 0.02 (d/pixel)^1.4 where pixels are coarser than the eye. Fitted to 6
    to 22 bands on Figure 12 at 0.6 to 4.7 arcmin a pixel and on a slanted edge, through Navarro's
    and the Arizona eye, most of which made less; four bands made up to a third more.
    """
    arcmin = displacement_pixels * min(grid.pitch_deg) * ARCMIN_PER_DEG
    return float(min(5e-3 * arcmin**1.8, 0.02 * displacement_pixels**1.4))


def _chromatic_position(eye: Eye, grid: RetinalGrid, wavelengths_nm: np.ndarray) -> np.ndarray:
    """Where each wavelength lands at the edge of field and pupil, in pixels; ascending or flat."""
    pixel_rad = np.radians(min(grid.pitch_deg))
    radius_m = eye.entrance_pupil(grid.wavelength_nm).radius_mm / MM_PER_M
    vergence = np.array([paraxial.object_vergence_dpt(eye, w) for w in wavelengths_nm])
    transverse_rad = np.radians(_lateral_deg(eye, grid, wavelengths_nm[[0, -1]]))
    longitudinal = radius_m * (vergence - vergence[0])
    span = np.ptp(longitudinal)
    share = longitudinal / span if span > 0 else np.zeros(len(wavelengths_nm))
    return (longitudinal + share * transverse_rad) / pixel_rad


def _diffraction_position(eye: Eye, grid: RetinalGrid, wavelengths_nm: np.ndarray) -> np.ndarray:
    """Radius lambda / D of the diffraction pattern of each wavelength, in pixels."""
    diameter_m = 2.0 * eye.entrance_pupil(grid.wavelength_nm).radius_mm / MM_PER_M
    return np.asarray(wavelengths_nm / NM_PER_M / diameter_m / np.radians(min(grid.pitch_deg)))


def _lateral_deg(eye: Eye, grid: RetinalGrid, ends_nm: np.ndarray) -> float:
    """Angle between the directions that a retinal point sees at two wavelengths, at the worst."""
    if isinstance(grid.field_map, FieldPlane):
        point = grid.field_map.retinal_point_mm(*grid.rectangle.lattice(5).T)
        seen = [field_plane(eye, float(w)).field_of_point_deg(point) for w in ends_nm]
        return float(np.max(np.linalg.norm(seen[1] - seen[0], axis=1)))
    arc = float(grid.field_map.arc_mm(grid.limit_deg))
    lateral = []
    for wavelength in ends_nm:
        chief = field_map(eye, float(wavelength))
        reach = float(chief.arc_mm(chief.max_field_deg))
        lateral.append(float(chief.field_deg(min(arc, reach))))
    return abs(lateral[1] - lateral[0])


def _interval_costs(wavelengths_nm: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Largest displacement inside a band from i to j, pixels, (n, n); infinite for j < i."""
    n = len(wavelengths_nm)
    cost = np.full((n, n), np.inf)
    sums = np.concatenate([[0.0], np.cumsum(wavelengths_nm)])
    for i in range(n):
        length = np.arange(1, n - i + 1)
        at = np.interp((sums[i + 1 :] - sums[i]) / length, wavelengths_nm, position)
        # The position changes monotonically, so that the ends of a band lie farthest out.
        cost[i, i:] = np.maximum(np.abs(position[i] - at), np.abs(position[i:] - at))
    return cost


def _partition(wavelengths_nm: np.ndarray, cost: np.ndarray, count: int) -> tuple[Band, ...]:
    """`count` contiguous bands whose largest displacement is smallest (dynamic programming)."""
    n = len(wavelengths_nm)
    best = cost[0].copy()
    starts = [np.zeros(n, dtype=int)]
    for _ in range(1, count):
        following = np.full(n, np.inf)
        start = np.zeros(n, dtype=int)
        for j in range(1, n):
            worst = np.maximum(best[:j], cost[1 : j + 1, j])
            # On a tie take the later start, so that no band swallows its neighbours.
            i = j - 1 - int(np.argmin(worst[::-1]))
            following[j], start[j] = worst[i], i + 1
        best = following
        starts.append(start)
    bands: list[Band] = []
    last = n - 1
    for start in reversed(starts):
        first = int(start[last])
        bands.append(_band(wavelengths_nm, first, last))
        last = first - 1
    return tuple(reversed(bands))


def _band(wavelengths_nm: np.ndarray, first: int, last: int) -> Band:
    return Band(first, last, float(np.mean(wavelengths_nm[first : last + 1])))


def _worst(bands: tuple[Band, ...], cost: np.ndarray) -> float:
    """Largest displacement inside any band, pixels."""
    return max(float(cost[band.first, band.last]) for band in bands)
