"""PSFs of published formulas: of an eye they know the size of its pupil, if that."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable

import numpy as np

from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.people.glare import ijspeert_terms, vos_van_den_berg
from isetcl.eye.people.human_mtf import watson_2013_mtf, williams_1994_mtf
from isetcl.psf_baseline.psf import Psf
from isetcl.psf_baseline.psfs.cells import OUTSIDE, radial_psf
from isetcl.units import NM_PER_MM

_RADII = 6  # a period of the cut-off, the least scale of the pattern
_NODES = 10
_RINGS = (8.0, 12.0)
_FIRST_REACH_DEG = 0.3
_LARGEST_DEG = 90.0
_LEAST_DEG = 1e-6
_CELLS = 320


def watson_psf(
    eye: Eye,
    wavelength_nm: float,
    vergence_dpt: float,
    pitch_deg: float,
    field_deg: tuple[float, float] = (0.0, 0.0),
    *,
    reach_deg: float = 2.0,
) -> Psf:
    """The PSF of `watson_2013_mtf` at the eye's pupil, 2 to 6 mm: mean eyes in white light."""
    pupil_mm = _pupil_mm(eye)
    return _of_mtf(lambda f: watson_2013_mtf(f, pupil_mm), pupil_mm, 555.0, pitch_deg, reach_deg)


def williams_psf(
    eye: Eye,
    wavelength_nm: float,
    vergence_dpt: float,
    pitch_deg: float,
    field_deg: tuple[float, float] = (0.0, 0.0),
    *,
    reach_deg: float = 2.0,
) -> Psf:
    """The PSF of `williams_1994_mtf`: 3 mm and 633 nm, whatever the eye."""
    return _of_mtf(williams_1994_mtf, 3.0, 633.0, pitch_deg, reach_deg)


def ijspeert_psf(
    eye: Eye,
    wavelength_nm: float,
    vergence_dpt: float,
    pitch_deg: float,
    field_deg: tuple[float, float] = (0.0, 0.0),
    *,
    reach_deg: float = 2.0,
    age_years: float = 35.0,
    pigmentation: float = 0.142,
) -> Psf:
    """The PSF of `glare.ijspeert_psf` at the eye's pupil, by age and pigmentation m."""
    share, width = ijspeert_terms(age_years, pigmentation, _pupil_mm(eye))

    def enclosed(angle_deg: np.ndarray) -> np.ndarray:
        """Integral of c b sin t / (sin^2 t + b^2 cos^2 t)^1.5 from the middle."""
        t = np.radians(np.minimum(angle_deg, _LARGEST_DEG))[..., None]
        left = width * np.cos(t) / np.sqrt(np.sin(t) ** 2 + (width * np.cos(t)) ** 2)
        return np.asarray(np.sum(share * (1.0 - left), axis=-1))

    return radial_psf(enclosed, pitch_deg, reach_deg)


def vos_van_den_berg_psf(
    eye: Eye,
    wavelength_nm: float,
    vergence_dpt: float,
    pitch_deg: float,
    field_deg: tuple[float, float] = (0.0, 0.0),
    *,
    reach_deg: float = 2.0,
    age_years: float = 35.0,
    pigmentation: float = 0.5,
) -> Psf:
    """The PSF of the CIE total glare function, by age and pigmentation p, whatever the pupil.

    Divided by its integral over the half space, which is 1.00 to 1.02.
    """
    return radial_psf(_vos_enclosed(age_years, pigmentation), pitch_deg, reach_deg)


@functools.lru_cache(maxsize=8)
def _vos_enclosed(age_years: float, pigmentation: float) -> Callable[[np.ndarray], np.ndarray]:
    """The share of the light within an angle in degrees, by integration in log angle."""
    from scipy.interpolate import CubicSpline

    edges = np.linspace(math.log(_LEAST_DEG), math.log(_LARGEST_DEG), _CELLS + 1)
    x, w = np.polynomial.legendre.leggauss(_NODES)
    half = (edges[1] - edges[0]) / 2.0
    angle = np.exp((edges[:-1] + half)[:, None] + half * x)
    density = vos_van_den_berg(angle, age_years, pigmentation) * np.radians(angle)
    cells = np.sum(w * density * 2.0 * np.pi * np.sin(np.radians(angle)), axis=1) * half
    first = math.pi * math.radians(_LEAST_DEG) ** 2 * vos_van_den_berg(0.0, age_years, pigmentation)
    total = np.cumsum(np.concatenate([[float(first)], cells]))
    spline = CubicSpline(edges, total / total[-1])
    low = float(first) / float(total[-1])

    def enclosed(angle_deg: np.ndarray) -> np.ndarray:
        clipped = np.clip(angle_deg, _LEAST_DEG, _LARGEST_DEG)
        tiny = low * (np.minimum(angle_deg, _LEAST_DEG) / _LEAST_DEG) ** 2
        return np.where(angle_deg < _LEAST_DEG, tiny, spline(np.log(clipped)))

    return enclosed


def _of_mtf(
    mtf: Callable[[np.ndarray], np.ndarray],
    pupil_mm: float,
    wavelength_nm: float,
    pitch_deg: float,
    reach_deg: float,
) -> Psf:
    """The round PSF of a modulation transfer with the cut-off of a pupil.

    Light within r: the integral of MTF(f) 2 pi r J1(2 pi f r), which has all tails in it: nothing
    is lost or folded back at the border of a grid.
    """
    from scipy.interpolate import CubicSpline

    cutoff = pupil_mm * NM_PER_MM / wavelength_nm * math.pi / 180.0
    reach = min(_FIRST_REACH_DEG, reach_deg)
    while True:
        # The corner squares of a kernel lie farther out than its reach.
        radii, inside = _light_within(mtf, cutoff, 1.5 * (reach + pitch_deg))
        enclosed = CubicSpline(radii, _without_rings(inside))
        if reach >= reach_deg or float(enclosed(reach)) > 1.0 - OUTSIDE:
            return radial_psf(enclosed, pitch_deg, reach)
        reach = min(2.0 * reach, reach_deg)


def _light_within(
    mtf: Callable[[np.ndarray], np.ndarray], cutoff_cpd: float, farthest_deg: float
) -> tuple[np.ndarray, np.ndarray]:
    """Radii, evenly spaced, and the light within each, (n,) both."""
    from scipy.special import j1

    # Cells of at most one period of the Bessel function at the farthest radius. Frequencies crowd
    # towards the cut-off as squares, where transfers end in a root.
    count = max(32, math.ceil(2.0 * cutoff_cpd * farthest_deg))
    x, w = np.polynomial.legendre.leggauss(_NODES)
    s = (np.arange(count)[:, None] + (x + 1.0) / 2.0).ravel() / count
    f = cutoff_cpd * s * (2.0 - s)
    values = mtf(f) * cutoff_cpd * (1.0 - s) * np.tile(w, count) / count
    radii = np.linspace(0.0, farthest_deg, max(64, math.ceil(_RADII * cutoff_cpd * farthest_deg)))
    inside = [2.0 * np.pi * r * (j1(2.0 * np.pi * r * f) @ values) for r in radii]
    return radii, np.array(inside)


def _without_rings(inside: np.ndarray) -> np.ndarray:
    """Light within radii, averaged over a ring's width beyond the first rings.

    Squares far out see many rings, which quadrature over a few directions would not.
    """
    window = np.convolve(np.full(_RADII, 1.0 / _RADII), np.full(_RADII, 1.0 / _RADII))
    edge = len(window) // 2
    straight = np.pad(inside, edge, mode="reflect", reflect_type="odd")
    smooth = np.convolve(straight, window, mode="valid")
    first, last = _RINGS
    share = np.clip((np.arange(len(inside)) / _RADII - first) / (last - first), 0.0, 1.0)
    return np.asarray(inside + share * (smooth - inside))


def _pupil_mm(eye: Eye) -> float:
    return eye.entrance_pupil(REFERENCE_WAVELENGTH_NM).diameter_mm
