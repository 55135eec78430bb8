"""The error of an image in units of the noise of the cones that look at it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from isetcl.errors import InvalidInputError, check_positive, check_type
from isetcl.eye.people.macular_pigment import PIGMENT_RANGE_NM, macular_density
from isetcl.eye.people.pigments import (
    FOVEAL_DENSITIES,
    PHOTON_EFFICIENCY,
    absorbance,
    absorptance,
)
from isetcl.retina.places import Receptors
from isetcl.spectrum import Uneven, bin_widths, check_even_or_bins
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
    a pixel averages over several, and the error in its excitations is smaller than stated. Renders
    at the receptors of a mosaic take these themselves instead, by their own apertures, types and
    pigments, so that the goal is that of the excitations; see `ConeMosaic.places`.

    Parameters
    ----------
    ratio
        The error wanted, > 0.
    integration_time_s
        Time over which the cone counts, s. Beside its mean its noise falls as the root of the time:
        what is seen for longer must be rendered better.
    aperture_um
        Diameter of the cone's aperture, um; None is that of the densest cones, or a mosaic's own.
        Farther out cones are wider and beside their means less noisy, and the image must be better:
        apertures are about 9 um at 10 degrees (0.79 of the spacing of Curcio et al. 1990). A number
        puts such a foveal cone at the places of a mosaic, too.
    uneven_wavelengths
        As in `isetcl.cones.excitations`.
    """

    ratio: float
    integration_time_s: float = 0.005
    aperture_um: float | None = None
    uneven_wavelengths: Uneven = "refuse"

    def __post_init__(self) -> None:
        check_positive("cone_noise: ratio", self.ratio)
        check_positive("cone_noise: integration_time_s", self.integration_time_s, "s")
        if self.aperture_um is not None:
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
        ratio, *times = numbers
        return cls(ratio, times[0]) if times else cls(ratio)

    @property
    def cone_aperture_um(self) -> float:
        """Diameter of the aperture of the one cone that stands in every pixel, um."""
        return FOVEAL_APERTURE_UM if self.aperture_um is None else self.aperture_um

    def describe(self) -> dict[str, Any]:
        """Everything as plain values, the aperture that of the one cone, for provenance."""
        return asdict(self) | {"aperture_um": self.cone_aperture_um}

    def weights(self, wavelengths_nm: np.ndarray) -> np.ndarray:
        """Excitations of L, M and S per W m^-2 nm^-1 at each wavelength, (3, wavelengths).

        Raises
        ------
        InvalidInputError
            If there are fewer than two wavelengths, or none at which pigments are known, or steps
            are unequal.
        """
        grid = check_even_or_bins("cone_noise", wavelengths_nm, self.uneven_wavelengths)
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
        area_m2 = math.pi * (0.5e-6 * self.cone_aperture_um) ** 2
        photons = seen / (NM_PER_M * PLANCK_J_S * SPEED_OF_LIGHT_M_S) * bin_widths(grid)[known]
        weights = np.zeros((3, len(grid)))
        weights[:, known] = self.integration_time_s * area_m2 * per_photon * photons
        return weights

    def receptor_weights(self, receptors: Receptors, wavelengths_nm: np.ndarray) -> np.ndarray:
        """Excitations of receptors per W m^-2 nm^-1 at each wavelength, (n, wavelengths).

        Raises
        ------
        InvalidInputError
            If there are fewer than two wavelengths, or some that the receptors do not take.
        """
        if len(wavelengths_nm) < 2:
            raise InvalidInputError(
                f"cone_noise needs two wavelengths or more, got {wavelengths_nm.tolist()} nm; pass "
                "wavelengths_nm, or a number as target_error"
            )
        per_second = receptors.efficiencies(wavelengths_nm, self.uneven_wavelengths)
        return self.integration_time_s * per_second

    def error(self, means: Iterable[np.ndarray], errors: Iterable[np.ndarray]) -> float:
        """The error of an image from mean excitations of each type and their standard errors."""
        worst = 0.0
        for mean, error in zip(means, errors, strict=True):
            lit = mean > 0
            if np.any(lit):
                worst = max(worst, float(np.sqrt(np.mean(np.square(error[lit]) / mean[lit]))))
        return worst
