"""Optical transfer functions: of a wavefront, and over many wavelengths.

OTF(f) is the Fourier transform of the point spread function, exp(-2 pi i f . v), with the
frequency f in cycles per degree of visual angle; OTF(0) = 1. MTF and PTF are its modulus and phase.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_finite
from isetcl.eye.waves import diffraction_psf
from isetcl.eye.waves.wavefront import Wavefront
from isetcl.units import ARCMIN_PER_DEG

_AZIMUTHS = 36


@dataclass(frozen=True, eq=False)
class OpticalTransfer:
    """An optical transfer function.

    Attributes
    ----------
    values : ndarray, (2 n, 2 n)
        OTF; row 0 is the largest y.
    without_aberrations : ndarray, (2 n, 2 n)
        OTF of the same amplitude without aberrations, real.
    x_cpd, y_cpd : ndarray, (2 n,)
        Frequencies, cycles/degree; y descends; both hold 0.
    peak_deg : ndarray, (2,)
        Where the peak of the PSF lies from the reference point, degrees.
    wavelength_nm
        Wavelength, nm.
    """

    values: np.ndarray
    without_aberrations: np.ndarray
    x_cpd: np.ndarray
    y_cpd: np.ndarray
    peak_deg: np.ndarray
    wavelength_nm: float

    def at(self, x_cpd: np.ndarray | float, y_cpd: np.ndarray | float) -> np.ndarray:
        """Complex OTF at frequencies (x, y) in cycles/degree, any shape; 0 beyond the cut-off.

        Interpolated as the product of two smooth functions: the loss by aberrations, and the
        distance of the transfer without them from its cone at 0.
        """
        from scipy.ndimage import map_coordinates

        x, y = np.broadcast_arrays(check_array("x_cpd", x_cpd), check_array("y_cpd", y_cpd))
        step = float(self.x_cpd[1] - self.x_cpd[0])
        places = np.stack([(self.y_cpd[0] - y) / step, (x - self.x_cpd[0]) / step])
        grid_x, grid_y = np.meshgrid(self.x_cpd, self.y_cpd)
        size = np.hypot(grid_x, grid_y)
        ideal = self.without_aberrations
        turn = np.exp(2j * np.pi * (grid_x * self.peak_deg[0] + grid_y * self.peak_deg[1]))
        loss = np.where(ideal > 1e-6, self.values * turn / np.maximum(ideal, 1e-6), 0.0)
        zero = size == 0
        cone = (1.0 - ideal) / np.where(zero, 1.0, size)
        cone[zero] = np.mean(cone[(size > 0) & (size < 1.5 * step)])
        real, imaginary, slope = (
            map_coordinates(part, places, order=3, mode="nearest")
            for part in (loss.real, loss.imag, cone)
        )
        frequency = np.hypot(x, y)
        within = np.max(np.abs([x, y]), axis=0) < self.x_cpd[-1]
        ideal_there = np.clip(1.0 - frequency * slope, 0.0, 1.0) * within
        back = np.exp(-2j * np.pi * (x * self.peak_deg[0] + y * self.peak_deg[1]))
        return np.asarray(ideal_there * (real + 1j * imaginary) * back)

    def mtf(
        self, frequency_cpd: np.ndarray | Sequence[float], orientation_deg: float | None = None
    ) -> np.ndarray:
        """Modulation transfer at frequencies in cycles/degree, (n,).

        Parameters
        ----------
        frequency_cpd
            Frequencies >= 0.
        orientation_deg
            Direction across the stripes of the grating, anticlockwise from the horizontal: 0 is for
            vertical stripes. None gives the mean over all directions.
        """
        frequency = check_frequencies(frequency_cpd)
        if orientation_deg is not None:
            return np.abs(self.along(frequency, orientation_deg))
        turns = np.arange(_AZIMUTHS) * 180.0 / _AZIMUTHS
        return np.asarray(np.mean([np.abs(self.along(frequency, t)) for t in turns], axis=0))

    def ptf_deg(
        self, frequency_cpd: np.ndarray | Sequence[float], orientation_deg: float = 0.0
    ) -> np.ndarray:
        """Phase transfer, degrees, (n,): where a grating is displaced, from the peak of the PSF."""
        frequency = check_frequencies(frequency_cpd)
        angle = math.radians(check_finite("orientation_deg", orientation_deg, "deg"))
        moved = frequency * float(self.peak_deg @ [math.cos(angle), math.sin(angle)])
        turned = self.along(frequency, orientation_deg) * np.exp(2j * np.pi * moved)
        return np.degrees(np.angle(turned))

    def along(
        self, frequency_cpd: np.ndarray | Sequence[float], orientation_deg: float
    ) -> np.ndarray:
        """Complex OTF along one direction; see `mtf`, (n,)."""
        frequency = check_frequencies(frequency_cpd)
        angle = math.radians(check_finite("orientation_deg", orientation_deg, "deg"))
        return self.at(frequency * math.cos(angle), frequency * math.sin(angle))

    def encircled_energy(
        self,
        radius_arcmin: np.ndarray | Sequence[float] | float,
        centre_arcmin: tuple[float, float] | None = None,
    ) -> np.ndarray:
        """Share of the flux within a radius of visual angle, arcmin, (n,).

        EE(r) = integral of OTF(f) r J1(2 pi r f) / f, so that no light is lost at a border.

        Parameters
        ----------
        radius_arcmin
            Radii.
        centre_arcmin
            Middle of the circle from the reference point; None is the peak of the PSF.
        """
        from scipy.special import j1

        radius = np.atleast_1d(check_array("radius_arcmin", radius_arcmin)) / ARCMIN_PER_DEG
        middle = (
            self.peak_deg if centre_arcmin is None else np.array(centre_arcmin) / ARCMIN_PER_DEG
        )
        step = float(self.x_cpd[1] - self.x_cpd[0])
        if np.any(radius < 0) or np.any(radius > 0.25 / step):
            raise InvalidInputError(
                f"radius_arcmin must lie between 0 and {0.25 / step * ARCMIN_PER_DEG:.4g} arcmin "
                "with this many samples across the pupil; use more samples"
            )
        x, y = np.meshgrid(self.x_cpd, self.y_cpd)
        size = np.hypot(x, y)
        turned = (self.values * np.exp(2j * np.pi * (x * middle[0] + y * middle[1]))).real
        used = np.abs(turned) > 1e-14
        size, turned = size[used], turned[used]
        safe = np.where(size > 0, size, 1.0)
        kernels = [
            np.where(size > 0, r * j1(2 * np.pi * r * safe) / safe, np.pi * r * r) for r in radius
        ]
        return np.array([np.sum(k * turned) * step**2 for k in kernels])


def transfer(front: Wavefront) -> OpticalTransfer:
    """The optical transfer function of a wavefront; see `Wavefront.otf`."""
    front.check_sampling()
    n = front.samples
    frequency = (np.arange(2 * n) - n) * front.step_cpd
    _, where = diffraction_psf.peak(front)
    return OpticalTransfer(
        _autocorrelation(front.pupil_function()),
        _autocorrelation(front.amplitude.astype(complex)).real,
        frequency,
        -frequency,
        where,
        front.wavelength_nm,
    )


def _autocorrelation(pupil: np.ndarray) -> np.ndarray:
    """sum P(q + f) P*(q) for a flux of 1, on the grid of `transfer`, (2 n, 2 n).

    Without a shift it is the flux, which the cells on the rim would give too small.
    """
    size = 2 * pupil.shape[0]
    spread = np.abs(np.fft.fft2(pupil, (size, size))) ** 2
    whole = np.fft.fftshift(np.fft.ifft2(spread))
    # Rows of the pupil descend in y, and so do the lags.
    whole[size // 2, size // 2] = 1.0
    return np.asarray(whole)


def check_frequencies(frequency_cpd: np.ndarray | Sequence[float]) -> np.ndarray:
    """Frequencies as a float64 array (n,); raise InvalidInputError unless all are >= 0."""
    frequency = np.atleast_1d(check_array("frequency_cpd", frequency_cpd))
    if frequency.ndim != 1 or not np.all(frequency >= 0) or not np.all(np.isfinite(frequency)):
        raise InvalidInputError(
            f"frequency_cpd must be a list of numbers >= 0 cycles/degree, got {frequency}"
        )
    return frequency
