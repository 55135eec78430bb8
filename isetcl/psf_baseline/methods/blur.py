"""What methods may ask for: layers, and their convolutions at one wavelength."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from isetcl.psf_baseline.view import Layer


class Blur(Protocol):
    """Layers, far to near, and their convolutions with PSFs at one wavelength.

    Images are (rows, columns), colours (basis, rows, columns), spectra their real Fourier
    transforms.
    """

    @property
    def layers(self) -> Sequence[Layer]:
        """The sharp layers."""

    def colour(self, layer: int) -> np.ndarray:
        """P_k * (m_k f_k), (basis, rows, columns)."""

    def coverage(self, layer: int) -> np.ndarray:
        """P_k * m_k, (rows, columns)."""

    def total(self, layers: Sequence[int]) -> np.ndarray:
        """Sum of `colour` over layers, (basis, rows, columns)."""

    def scene(self, layer: int) -> np.ndarray:
        """P_k * sum_j (m_j f_j): all layers blurred like one of them, (basis, rows, columns)."""

    def coverage_behind(self, layer: int) -> np.ndarray:
        """P_k * sum_{j <= k} m_j: what lies at or behind a layer, (rows, columns)."""

    def pupil_shifts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where rays through points of the pupil land, in samples; see `PupilOffsets`.

        Returns
        -------
        columns, rows : ndarray, (layers, samples, rays)
        weights : ndarray, (samples, rays)
            Their sum is 1.
        """

    def image(self, spectrum: np.ndarray) -> np.ndarray:
        """The images of a transform."""

    def layer_spectrum(self, layer: int) -> np.ndarray:
        """Transform of m_k f_k."""

    def coverage_spectrum(self, layer: int) -> np.ndarray:
        """Transform of m_k."""

    def points_transfer(
        self, columns: np.ndarray, rows: np.ndarray, weights: np.ndarray
    ) -> np.ndarray:
        """Transform of a kernel of points, places in samples, each shared by four samples."""
