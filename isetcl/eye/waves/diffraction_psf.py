"""Point spread functions with diffraction, from a wavefront.

Fraunhofer: the amplitude at a visual angle v from the reference point is the Fourier transform of
the pupil function, U(v) = sum P(q) exp(2 pi i q . v), because q is a spatial frequency. It is
summed as two matrix products (Soummer et al. 2007, Opt Express 15:15935), an FFT with a free choice
of pitch. Huygens: each sample sends out a spherical wave, whose exact distance to the point of the
retina gives its phase and its strength.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from isetcl.errors import InvalidInputError, check_choice, check_count, check_positive
from isetcl.eye.waves.wavefront import Wavefront
from isetcl.units import ARCMIN_PER_DEG

Method = Literal["fraunhofer", "huygens"]

_BLOCK = 1 << 21  # samples times points that are held at once
_PEAK_PADDING = 2


@dataclass(frozen=True, eq=False)
class DiffractionPsf:
    """A point spread function on the plane that touches the retina at the reference point.

    Attributes
    ----------
    density_per_arcmin2 : ndarray, (n, n)
        Share of the flux per square arcmin; row 0 is the upper side of the visual field.
    x_arcmin, y_arcmin : ndarray, (n,)
        Visual angle from the reference point; y descends.
    peak_per_arcmin2
        The density at the peak of the same pupil without aberrations.
    wavelength_nm
        Wavelength, nm.
    """

    density_per_arcmin2: np.ndarray
    x_arcmin: np.ndarray
    y_arcmin: np.ndarray
    peak_per_arcmin2: float
    wavelength_nm: float

    @property
    def relative(self) -> np.ndarray:
        """The density over that of the peak without aberrations: its largest value is Strehl's."""
        return self.density_per_arcmin2 / self.peak_per_arcmin2

    @property
    def pitch_arcmin(self) -> float:
        """Distance of neighbouring samples, arcmin."""
        return float(self.x_arcmin[1] - self.x_arcmin[0])

    @property
    def energy(self) -> float:
        """Share of the flux that falls on the samples."""
        return float(np.sum(self.density_per_arcmin2) * self.pitch_arcmin**2)


def psf(
    front: Wavefront, fov_arcmin: float, resolution: int, method: Method = "fraunhofer"
) -> DiffractionPsf:
    """The point spread function of a wavefront; see `Wavefront.psf`."""
    check_choice("method", method, ("fraunhofer", "huygens"))
    v = visual_angles_deg(front, fov_arcmin, resolution)
    wave = fraunhofer(front, v, -v) if method == "fraunhofer" else huygens(front, v, -v)
    return from_amplitude(front, wave, v)


def visual_angles_deg(front: Wavefront, fov_arcmin: float, resolution: int) -> np.ndarray:
    """Visual angles of the samples across a square on the retina, degrees, (resolution,).

    Raises
    ------
    InvalidInputError
        If the samples of the wavefront are too few for the aberrations or for this width.
    """
    width = check_positive("fov_arcmin", fov_arcmin, "arcmin")
    count = check_count("resolution", resolution, 2, 4096)
    front.check_sampling()
    largest = ARCMIN_PER_DEG / front.step_cpd
    if width > largest * (1 + 1e-9):
        wanted = 8 * math.ceil(front.samples * width / largest / 8)
        raise InvalidInputError(
            f"fov_arcmin must be at most {largest:.4g} arcmin with {front.samples} samples across "
            f"the pupil, got {width:g}; use samples={wanted} or a smaller width"
        )
    return (np.arange(count) - (count - 1) / 2.0) * width / count / ARCMIN_PER_DEG


def from_amplitude(front: Wavefront, wave: np.ndarray, v_deg: np.ndarray) -> DiffractionPsf:
    """The point spread function of amplitudes at columns `v_deg` and rows `-v_deg`."""
    per_arcmin2 = 1.0 / ARCMIN_PER_DEG**2
    x = v_deg * ARCMIN_PER_DEG
    return DiffractionPsf(
        np.abs(wave) ** 2 * per_arcmin2,
        x,
        -x,
        _ideal_peak(front) * per_arcmin2,
        front.wavelength_nm,
    )


def fraunhofer(front: Wavefront, x_deg: np.ndarray, y_deg: np.ndarray) -> np.ndarray:
    """Complex amplitude on the grid of visual angles x (columns) and y (rows), (rows, columns).

    Its squared modulus is the share of the flux per square degree.
    """
    by_x = np.exp(2j * np.pi * np.outer(front.x_cpd, x_deg))
    by_y = np.exp(2j * np.pi * np.outer(y_deg, front.y_cpd))
    return np.asarray(by_y @ front.pupil_function() @ by_x * front.step_cpd)


def huygens(front: Wavefront, x_deg: np.ndarray, y_deg: np.ndarray) -> np.ndarray:
    """As `fraunhofer`, by spherical waves from the reference sphere with exact distances."""
    used = front.inside
    source = front.pupil_function()[used]
    towards = _directions(front)[used]
    columns, rows = np.meshgrid(x_deg, y_deg)
    points = np.stack([columns.ravel(), rows.ravel()], axis=1) @ front.mm_per_deg
    wave_number = 2.0 * math.pi * front.vitreous_index / (front.wavelength_nm * 1e-6)
    result = np.empty(len(points), dtype=complex)
    block = max(1, _BLOCK // len(source))
    for start in range(0, len(points), block):
        part = points[start : start + block]
        # |R d + p| - R = (2 R d.p + p.p) / (|R d + p| + R), without cancellation.
        squared = np.sum(part * part, axis=1)[:, None] + 2.0 * front.radius_mm * part @ towards.T
        distance = np.sqrt(front.radius_mm**2 + squared)
        excess = squared / (distance + front.radius_mm)
        wave = np.exp(1j * wave_number * excess) * (front.radius_mm / distance)
        result[start : start + block] = wave @ source
    return result.reshape(columns.shape) * front.step_cpd


def strehl(front: Wavefront) -> float:
    """Peak of the PSF, wherever it lies, over its peak without aberrations."""
    height, _ = peak(front)
    return height / _ideal_peak(front)


def peak(front: Wavefront) -> tuple[float, np.ndarray]:
    """Largest density of the PSF per square degree and where it lies, (x, y) in degrees.

    The best point of a padded FFT, then refined.
    """
    from scipy.optimize import minimize

    front.check_sampling()
    size = _PEAK_PADDING * front.samples
    rough = np.abs(np.fft.fft2(front.pupil_function()[::-1], (size, size)))
    row, column = np.unravel_index(np.argmax(rough), rough.shape)
    pitch = 1.0 / (size * front.step_cpd)
    # fft2 has exp(-2 pi i ...): its frequencies are -v.
    start = -np.fft.fftfreq(size, 1.0 / size)[[column, row]] * pitch
    values = front.pupil_function()[front.inside]
    x, y = np.meshgrid(front.x_cpd, front.y_cpd)
    q = np.stack([x[front.inside], y[front.inside]], axis=1)

    def negative(v: np.ndarray) -> float:
        return -abs(np.sum(values * np.exp(2j * np.pi * (q @ (start + v * pitch)))))

    found = minimize(negative, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-4})
    return float((found.fun * front.step_cpd) ** 2), start + found.x * pitch


def _ideal_peak(front: Wavefront) -> float:
    """Peak density per square degree of the same amplitude without aberrations."""
    return float((np.sum(front.amplitude) * front.step_cpd) ** 2)


def _directions(front: Wavefront) -> np.ndarray:
    """Unit directions of travel from the samples to the reference point, (n, n, 3)."""
    to_plane = front.mm_per_deg
    normal = np.cross(to_plane[0], to_plane[1])
    normal /= np.linalg.norm(normal)
    x, y = np.meshgrid(front.x_cpd, front.y_cpd)
    wavelength_mm = front.wavelength_nm * 1e-6
    q = np.stack([x, y], axis=-1) * (wavelength_mm / front.vitreous_index)
    # q holds M d; the part of d in the plane of the retina is M^T (M M^T)^-1 M d.
    along = q @ np.linalg.inv(to_plane @ to_plane.T) @ to_plane
    out = np.sqrt(np.maximum(1.0 - np.sum(along**2, axis=-1, keepdims=True), 0.0))
    return np.asarray(along + out * normal)
