"""Convolution of layers with PSFs by real FFTs, every transform made once."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from scipy import fft

from isetcl.psf_baseline.psf import Psf
from isetcl.psf_baseline.view import Layer

_WORKERS = min(8, os.cpu_count() or 1)


class LayerSpectra:
    """Fourier transforms of all layers, shared by all wavelengths.

    The views reach beyond the image by more than the PSFs do, so the cyclic convolution is right
    on the image. Transforms that no method asks for are not made.
    """

    def __init__(self, layers: Sequence[Layer]) -> None:
        self.layers = layers
        rows, columns = layers[0].coverage.shape
        self.size = fft.next_fast_len(rows, real=True), fft.next_fast_len(columns, real=True)
        self._colour: dict[int, np.ndarray] = {}
        self._coverage: dict[int, np.ndarray] = {}

    def colour(self, k: int) -> np.ndarray:
        """Transform of layer k's colour, (basis, rows, frequencies)."""
        if k not in self._colour:
            self._colour[k] = fft.rfft2(self.layers[k].colour, self.size, workers=_WORKERS)
        return self._colour[k]

    def coverage(self, k: int) -> np.ndarray:
        """Transform of layer k's coverage, (rows, frequencies)."""
        if k not in self._coverage:
            self._coverage[k] = fft.rfft2(self.layers[k].coverage, self.size, workers=_WORKERS)
        return self._coverage[k]


class SpectralBlur:
    """Blurred layers at one wavelength: the `Blur` that methods combine."""

    def __init__(self, spectra: LayerSpectra, psfs: Sequence[Psf]) -> None:
        self._spectra = spectra
        self._transfer = [self._transform(psf) for psf in psfs]

    def colour(self, layer: int) -> np.ndarray:
        """See `Blur`."""
        return self._image(self._transfer[layer] * self._spectra.colour(layer))

    def coverage(self, layer: int) -> np.ndarray:
        """See `Blur`."""
        return self._image(self._transfer[layer] * self._spectra.coverage(layer))

    def total(self, layers: Sequence[int]) -> np.ndarray:
        """See `Blur`; added before the inverse transform, of which one serves all."""
        spectrum = sum(self._transfer[k] * self._spectra.colour(k) for k in layers)
        return self._image(np.asarray(spectrum))

    def _transform(self, psf: Psf) -> np.ndarray:
        """Transform of a PSF with its middle at the origin."""
        rows, columns = self._spectra.size
        padded = np.zeros((rows, columns), dtype=np.float32)
        n = psf.kernel.shape[0]
        padded[:n, :n] = psf.kernel
        padded = np.roll(padded, (-psf.radius, -psf.radius), axis=(0, 1))
        return np.asarray(fft.rfft2(padded, workers=_WORKERS))

    def _image(self, spectrum: np.ndarray) -> np.ndarray:
        rows, columns = self._spectra.layers[0].coverage.shape
        image = fft.irfft2(spectrum, self._spectra.size, workers=_WORKERS)
        return np.asarray(image[..., :rows, :columns])
