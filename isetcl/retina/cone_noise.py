"""The error of an image in units of the noise of the cones that look at it."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_positive, check_type
from isetcl.eye.people.macular_pigment import PIGMENT_RANGE_NM, macular_density
from isetcl.eye.people.pigments import (
    FOVEAL_DENSITIES,
    PHOTON_EFFICIENCY,
    absorbance,
    absorptance,
)
from isetcl.spectrum import bin_widths, check_wavelengths
from isetcl.units import NM_PER_M, PLANCK_J_S, SPEED_OF_LIGHT_M_S

FOVEAL_APERTURE_UM = 1.6978
"""0.79 of the spacing, 2.1491 um, of a triangular lattice of 250 000 cones/mm^2.

Curcio et al. 1990, as ISETBio has its peak."""

_SPELLING = re.compile(r"cone_noise:(?P<ratio>[^@]+)(@(?P<time>[^@]+))?")


@dataclass(frozen=True)
class ConeNoise:
    """An error of an image: so many times the Poisson noise of a cone at any of its pixels.

    A cone of an aperture stands in each pixel and sees the light of that pixel alone. Of its mean
    excitations m in the integration time the image has the standard error s; the cone's own noise
    is sqrt(m). The error is the root mean square of s / sqrt(m) over the pixels that excite the
    cone, for the type, L, M or S, of which it is the largest.

    The cone is the standard observer's in the fovea, behind its macular pigment. A cone wider than
    a pixel averages over several, and the error in its excitations is smaller than stated. In
    renders at the receptors of a mosaic, pixels are the receptors, and the aperture is still this
    one.

    Parameters
    ----------
    ratio
        The error wanted, > 0.
    integration_time_s
        Time over which the cone counts, s. Beside its mean its noise falls as the root of the time:
        what is seen for longer must be rendered better.
    aperture_um
        Diameter of the cone's aperture, um; the default is that of the densest cones. Farther out
        cones are wider and beside their means less noisy, and the image must be better: apertures
        are about 9 um at 10 degrees (0.79 of the spacing of Curcio et al. 1990).
    """

    ratio: float
    integration_time_s: float = 0.005
    aperture_um: float = FOVEAL_APERTURE_UM

    def __post_init__(self) -> None:
        check_positive("cone_noise: ratio", self.ratio)
        check_positive("cone_noise: integration_time_s", self.integration_time_s, "s")
        check_positive("cone_noise: aperture_um", self.aperture_um, "um")

    @classmethod
    def parse(cls, text: str) -> ConeNoise:
        """The goal of a text: ``"cone_noise:0.1"``, or ``"cone_noise:0.1@0.05"`` for 50 ms.

        Raises
        ------
        InvalidInputError
            If it is another text, or a number is not positive.
        """
        check_type("target_error", text, str)
        match = _SPELLING.fullmatch(text.replace(" ", ""))
        try:
            if match is None:
                raise ValueError
            numbers = [float(each) for each in match.group("ratio", "time") if each is not None]
        except ValueError:
            raise InvalidInputError(
                "target_error must be a number, such as 0.01, or 'cone_noise:RATIO', such as "
                f"'cone_noise:0.1', or 'cone_noise:RATIO@SECONDS', got {text!r}"
            ) from None
        return cls(*numbers)

    def weights(self, wavelengths_nm: np.ndarray) -> np.ndarray:
        """Excitations of L, M and S per W m^-2 nm^-1 at each wavelength, (3, wavelengths).

        Raises
        ------
        InvalidInputError
            If there are fewer than two wavelengths, or none at which pigments are known.
        """
        grid = check_wavelengths(wavelengths_nm)
        low, high = PIGMENT_RANGE_NM["cie_170"]
        known = (grid >= low) & (grid <= high)
        if len(grid) < 2 or not np.any(known):
            raise InvalidInputError(
                f"cone_noise needs two wavelengths or more, some of them from {low:g} to {high:g} "
                f"nm, got {grid.tolist()} nm; pass wavelengths_nm, or a number as target_error"
            )
        seen = grid[known]
        density = macular_density(seen)
        per_photon = PHOTON_EFFICIENCY * np.stack(
            [
                absorptance(peak, absorbance(cone, seen)) * 10.0**-density
                for cone, peak in zip("LMS", FOVEAL_DENSITIES, strict=True)
            ]
        )
        area_m2 = math.pi * (0.5e-6 * self.aperture_um) ** 2
        photons = seen / (NM_PER_M * PLANCK_J_S * SPEED_OF_LIGHT_M_S) * bin_widths(grid)[known]
        weights = np.zeros((3, len(grid)))
        weights[:, known] = self.integration_time_s * area_m2 * per_photon * photons
        return weights

    def error(self, means: np.ndarray, errors: np.ndarray) -> float:
        """The error of an image from mean excitations and their standard errors, (3, pixels)."""
        worst = 0.0
        for mean, error in zip(means, errors, strict=True):
            lit = mean > 0
            if np.any(lit):
                worst = max(worst, float(np.sqrt(np.mean(np.square(error[lit]) / mean[lit]))))
        return worst
