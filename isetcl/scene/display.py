"""The display that pictures are shown on: spectra of its primaries."""

from __future__ import annotations

import functools

import numpy as np

from isetcl.spectrum import Spectrum


@functools.lru_cache(maxsize=16)
def display_primaries(luminance_cd_m2: float = 100.0) -> tuple[Spectrum, Spectrum, Spectrum]:
    """Spectral radiances of red, green and blue of an sRGB display, W m^-2 sr^-1 nm^-1.

    Linear sRGB values times these spectra have exactly the colour those values stand for, and
    (1, 1, 1) is D65 of the given luminance.

    Source: smooth sRGB basis of Mallett & Yuksel 2019 (EGSR), times CIE D65, as tabulated by
    colour-science from 380 to 780 nm.
    """
    import colour

    basis = colour.recovery.MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019
    grid = np.asarray(basis.domain, dtype=np.float64)
    white = Spectrum.illuminant("D65", luminance_cd_m2).at(grid)
    values = np.maximum(np.asarray(basis.values, dtype=np.float64), 0.0)
    # The published basis sums to 1 within 1e-6; make that exact, so that white is D65.
    values = values / values.sum(axis=1, keepdims=True)
    red, green, blue = (
        Spectrum(grid, values[:, i] * white, f"sRGB {name}")
        for i, name in enumerate(("red", "green", "blue"))
    )
    return red, green, blue
