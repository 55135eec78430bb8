"""Convolution of layers with PSFs by real FFTs, every transform made once."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from scipy import fft

from isetcl.errors import InvalidInputError
from isetcl.psf_baseline.psf import Psf
from isetcl.psf_baseline.pupil import PupilOffsets
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
        self._coverage_behind: dict[int, np.ndarray] = {}
        self._scene: np.ndarray | None = None

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

    def scene(self) -> np.ndarray:
        """Transform of all layers' colours, added, (basis, rows, frequencies)."""
        if self._scene is None:
            colour = np.sum([layer.colour for layer in self.layers], axis=0)
            self._scene = fft.rfft2(colour, self.size, workers=_WORKERS)
        return self._scene

    def coverage_behind(self, k: int) -> np.ndarray:
        """Transform of the coverage of layers 0 to k, added, (rows, frequencies)."""
        if k not in self._coverage_behind:
            own = self.coverage(k)
            self._coverage_behind[k] = own if k == 0 else own + self.coverage_behind(k - 1)
        return self._coverage_behind[k]


class SpectralBlur:
    """Blurred layers at one wavelength: the `Blur` that methods combine.

    Parameters
    ----------
    spectra
        Transforms of the layers.
    psfs
        One for every layer, all of one pitch.
    pupil
        Where rays of every layer land, for methods that follow them.
    """

    def __init__(
        self, spectra: LayerSpectra, psfs: Sequence[Psf], pupil: PupilOffsets | None = None
    ) -> None:
        self._spectra = spectra
        self._pitch_deg = psfs[0].pitch_deg
        self._transfer = [self._transform(psf) for psf in psfs]
        self._pupil = pupil

    @property
    def layers(self) -> Sequence[Layer]:
        """See `Blur`."""
        return self._spectra.layers

    def colour(self, layer: int) -> np.ndarray:
        """See `Blur`."""
        return self.image(self._transfer[layer] * self._spectra.colour(layer))

    def coverage(self, layer: int) -> np.ndarray:
        """See `Blur`."""
        return self.image(self._transfer[layer] * self._spectra.coverage(layer))

    def total(self, layers: Sequence[int]) -> np.ndarray:
        """See `Blur`; added before the inverse transform, of which one serves all."""
        spectrum = sum(self._transfer[k] * self._spectra.colour(k) for k in layers)
        return self.image(np.asarray(spectrum))

    def scene(self, layer: int) -> np.ndarray:
        """See `Blur`."""
        return self.image(self._transfer[layer] * self._spectra.scene())

    def coverage_behind(self, layer: int) -> np.ndarray:
        """See `Blur`."""
        return self.image(self._transfer[layer] * self._spectra.coverage_behind(layer))

    def pupil_shifts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See `Blur`."""
        if self._pupil is None:
            raise InvalidInputError(
                "this method needs PupilOffsets for its layers, got none; see pupil_offsets"
            )
        if len(self._pupil.vergences_dpt) != len(self.layers):
            raise InvalidInputError(
                f"PupilOffsets must have one vergence for each of the {len(self.layers)} layers, "
                f"got {len(self._pupil.vergences_dpt)}"
            )
        # Rows count downwards.
        columns, rows = self._pupil.x_deg / self._pitch_deg, -self._pupil.y_deg / self._pitch_deg
        return columns, rows, self._pupil.weights

    def image(self, spectrum: np.ndarray) -> np.ndarray:
        """See `Blur`."""
        rows, columns = self._spectra.layers[0].coverage.shape
        image = fft.irfft2(spectrum, self._spectra.size, workers=_WORKERS)
        return np.asarray(image[..., :rows, :columns])

    def layer_spectrum(self, layer: int) -> np.ndarray:
        """See `Blur`."""
        return self._spectra.colour(layer)

    def coverage_spectrum(self, layer: int) -> np.ndarray:
        """See `Blur`."""
        return self._spectra.coverage(layer)

    def points_transfer(
        self, columns: np.ndarray, rows: np.ndarray, weights: np.ndarray
    ) -> np.ndarray:
        """See `Blur`."""
        height, width = self._spectra.size
        left, top = np.floor(columns).astype(int), np.floor(rows).astype(int)
        right, low = columns - left, rows - top
        kernel = np.zeros(height * width)
        for down, share_y in ((0, 1.0 - low), (1, low)):
            for across, share_x in ((0, 1.0 - right), (1, right)):
                place = (top + down) % height * width + (left + across) % width
                np.add.at(kernel, place, weights * share_x * share_y)
        image = kernel.reshape(height, width).astype(np.float32)
        return np.asarray(fft.rfft2(image, workers=_WORKERS))

    def _transform(self, psf: Psf) -> np.ndarray:
        """Transform of a PSF with its middle at the origin."""
        rows, columns = self._spectra.size
        padded = np.zeros((rows, columns), dtype=np.float32)
        n = psf.kernel.shape[0]
        padded[:n, :n] = psf.kernel
        padded = np.roll(padded, (-psf.radius, -psf.radius), axis=(0, 1))
        return np.asarray(fft.rfft2(padded, workers=_WORKERS))
