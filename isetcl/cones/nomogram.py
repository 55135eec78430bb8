"""The shape that the absorbances of all pigments share."""

from __future__ import annotations

import numpy as np


def govardovskii_absorbance(peak_nm: float, wavelengths_nm: np.ndarray) -> np.ndarray:
    """Absorbance of a vitamin A1 pigment by its peak wavelength, alpha and beta bands, peak 1.

    Source: Govardovskii et al. 2000, Vis Neurosci 17:509, eqs. 1, 2, 4, 5a and 5b.
    """
    nm = np.asarray(wavelengths_nm, dtype=np.float64)
    x = peak_nm / nm
    a = 0.8795 + 0.0459 * np.exp(-((peak_nm - 300.0) ** 2) / 11940.0)
    alpha = 1.0 / (
        np.exp(69.7 * (a - x)) + np.exp(28.0 * (0.922 - x)) + np.exp(-14.9 * (1.104 - x)) + 0.674
    )
    middle, width = 189.0 + 0.315 * peak_nm, -40.5 + 0.195 * peak_nm
    return np.asarray(alpha + 0.26 * np.exp(-(((nm - middle) / width) ** 2)))
