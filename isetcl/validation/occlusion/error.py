"""Occlusion error: what an approximation gets wrong where light is hidden or revealed.

A point behind a depth edge is seen through part of the pupil only, over a strip of half-width
a |D1 - D2| radians on both sides of the edge (a: radius of the entrance pupil in metres, D:
vergences in dioptres), whatever the eye is focused on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from isetcl.errors import InvalidInputError, check_type
from isetcl.retina.depth_edges import occlusion_strip
from isetcl.retina.image import RetinalImage
from isetcl.validation.grids import check_finite_pixels, check_one_grid

if TYPE_CHECKING:
    import xarray

_NORMAL_95 = 1.959964


@dataclass(frozen=True)
class RegionError:
    """Errors over a set of pixels, relative to `level`; times `level` they are absolute.

    Attributes
    ----------
    rms
        Root mean square, with the noise of both images subtracted in quadrature; 0 where the noise
        is larger than the difference.
    rms_interval
        Where it lies with 95 %; from 0 where no error was found.
    noise
        The noise that was subtracted.
    bias, bias_error
        Mean signed error, and its standard error.
    mean_absolute, largest
        Mean and largest absolute error, noise included.
    level
        Mean of the lit pixels of the whole reference, in its unit.
    pixels
        Number of pixels; all errors are 0 if there are none.
    """

    rms: float
    rms_interval: tuple[float, float]
    noise: float
    bias: float
    bias_error: float
    mean_absolute: float
    largest: float
    level: float
    pixels: int


@dataclass(frozen=True, eq=False)
class OcclusionError:
    """Difference of two retinal images, inside and outside the strips along depth edges.

    Attributes
    ----------
    difference : xarray.DataArray, (wavelength, y, x)
        Image minus reference, W m^-2 nm^-1.
    photopic_difference : xarray.DataArray, (y, x)
        Image minus reference, lux; for a single wavelength its irradiance.
    relative_difference : xarray.DataArray, (wavelength, y, x)
        The difference over the reference, NaN where the reference is dark.
    photopic_relative_difference : xarray.DataArray, (y, x)
        The same for the photopic difference.
    photopic_noise : xarray.DataArray, (y, x)
        Standard error of the photopic difference.
    strip : ndarray of bool, (y, x)
        Pixels within a |D1 - D2| of a depth edge.
    photopic : dict of RegionError
        Photopic errors with keys "strip", "outside" and "all".
    spectral : dict of list of RegionError
        The same for every wavelength.
    freedom
        Degrees of freedom of the noise: replicates less one, 1 if they are not known.
    """

    difference: xarray.DataArray
    photopic_difference: xarray.DataArray
    relative_difference: xarray.DataArray
    photopic_relative_difference: xarray.DataArray
    photopic_noise: xarray.DataArray
    strip: np.ndarray
    photopic: dict[str, RegionError]
    spectral: dict[str, list[RegionError]]
    freedom: int = 1

    def photopic_over(self, mask: np.ndarray) -> RegionError:
        """Photopic errors over pixels of your own choice, a mask (y, x).

        Raises
        ------
        InvalidInputError
            If the mask has another shape than the images.
        """
        mask = np.asarray(mask, dtype=bool)
        if mask.shape != self.strip.shape:
            raise InvalidInputError(
                f"mask must have the images' shape {self.strip.shape}, got {mask.shape}"
            )
        noise2 = self.photopic_noise.values.astype(np.float64) ** 2
        level = self.photopic["all"].level
        return region_error(self.photopic_difference.values, noise2, level, mask, self.freedom)


def occlusion_error(
    image: RetinalImage, reference: RetinalImage, *, noise_is_error: bool = False
) -> OcclusionError:
    """The error of an image against a reference, by wavelength and photopic.

    Parameters
    ----------
    image
        The approximation, on the grid of the reference.
    reference
        Usually ray-traced; its depth map shows where depth edges are.
    noise_is_error
        Count the image's own noise as error and subtract only that of the reference, which must
        then be independent of it.

    Raises
    ------
    InvalidInputError
        If grids or wavelengths differ, a pixel is not finite, or neither image has a depth map.
    """
    check_type("image", image, RetinalImage)
    check_type("reference", reference, RetinalImage)
    check_one_grid(image, reference)
    check_finite_pixels("image", image)
    check_finite_pixels("reference", reference)
    depth = reference if reference.vergence_dpt is not None else image
    if depth.vergence_dpt is None:
        raise InvalidInputError(
            "occlusion_error needs the depth map 'vergence_dpt' in one of the images; "
            "render them with isetcl, or add the variable to the dataset"
        )
    strip = occlusion_strip(
        depth.vergence_dpt.values, _pitch_deg(depth), depth.entrance_pupil_diameter_mm
    )
    difference = image.irradiance.copy(data=image.irradiance.values - reference.irradiance.values)
    noisy = (reference,) if noise_is_error else (reference, image)
    noise2 = sum(np.square(each.standard_error.values, dtype=np.float64) for each in noisy)
    freedom = min(
        (noise_freedom(each) for each in noisy if each.standard_error.values.any()), default=1
    )
    truth, off, off_noise2 = _photopic(image, reference, noisy)
    photopic_difference = difference.isel(wavelength=0, drop=True).copy(data=off)
    regions = {"strip": strip, "outside": ~strip, "all": np.ones_like(strip)}
    spectral = {
        name: [
            region_error(
                difference.values[i],
                noise2[i],
                _level(reference.irradiance.values[i]),
                mask,
                freedom,
            )
            for i in range(len(reference.wavelengths_nm))
        ]
        for name, mask in regions.items()
    }
    return OcclusionError(
        difference,
        photopic_difference,
        difference.copy(data=_relative(difference.values, reference.irradiance.values)),
        photopic_difference.copy(data=_relative(off, truth)),
        photopic_difference.copy(data=np.sqrt(off_noise2)),
        strip,
        {
            name: region_error(off, off_noise2, _level(truth), mask, freedom)
            for name, mask in regions.items()
        },
        spectral,
        freedom,
    )


def region_error(
    difference: np.ndarray,
    noise2: np.ndarray,
    level: float,
    mask: np.ndarray,
    freedom: int = 1,
) -> RegionError:
    """Errors over the pixels of a mask; `noise2` is the variance of the difference.

    With e = b + n, n of variance s^2 that is known from nu + 1 replicates, e^2 - s^2 has mean b^2
    and variance 4 b^2 s^2 + 2 s^4 (1 + 1 / nu), pixels being independent of each other.

    Parameters
    ----------
    freedom
        nu; with several noisy images that of the least known.
    """
    count = int(np.sum(mask))
    if count == 0 or level == 0.0:
        return RegionError(0.0, (0.0, 0.0), 0.0, 0.0, 0.0, 0.0, 0.0, level, count)
    off = difference[mask].astype(np.float64) / level
    variance = noise2[mask].astype(np.float64) / level**2
    noise, square = float(np.mean(variance)), float(np.mean(off * off))
    # Of what is measured e^2 s^2 has mean (b^2 + s^2) s^2, and the fourth power of the noise found
    # has 1 + 2 / nu times that of the true one.
    fourth = variance**2 / (1.0 + 2.0 / freedom)
    spread = np.sum(4.0 * off**2 * variance - 2.0 * (1.0 - 1.0 / freedom) * fourth)
    wide = _NORMAL_95 * float(np.sqrt(max(float(spread), 0.0))) / count
    low, middle, high = (
        float(np.sqrt(max(square - noise + step, 0.0))) for step in (-wide, 0.0, wide)
    )
    return RegionError(
        rms=middle,
        rms_interval=(low, high),
        noise=float(np.sqrt(noise)),
        bias=float(np.mean(off)),
        bias_error=float(np.sqrt(noise / count)),
        mean_absolute=float(np.mean(np.abs(off))),
        largest=float(np.max(np.abs(off))),
        level=level,
        pixels=count,
    )


def noise_freedom(image: RetinalImage) -> int:
    """Degrees of freedom of an image's standard error; 1, the least, if they are not known."""
    replicates = image.provenance.get("replicates")
    return max(replicates - 1, 1) if isinstance(replicates, int) else 1


def _photopic(
    image: RetinalImage, reference: RetinalImage, noisy: tuple[RetinalImage, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Photopic reference, difference and variance of the noisy images, each (y, x)."""
    truth = reference.brightness()[0].astype(np.float64)
    errors = [each.brightness()[1] for each in noisy]
    off = image.brightness()[0] - truth
    return truth, off, np.sum([np.square(e, dtype=np.float64) for e in errors], axis=0)


def _relative(difference: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Difference over truth, NaN where it is dark."""
    dark = np.full_like(difference, np.nan)
    return np.divide(difference, truth, out=dark, where=truth > 0)


def _level(truth: np.ndarray) -> float:
    lit = truth > 0
    return float(np.mean(truth[lit], dtype=np.float64)) if np.any(lit) else 0.0


def _pitch_deg(image: RetinalImage) -> tuple[float, float]:
    """Width and height of a pixel; along an axis of one pixel those of the other axis."""
    steps = [
        abs(float(v[1] - v[0])) if len(v) > 1 else None
        for v in (image.dataset["x"].values, image.dataset["y"].values)
    ]
    width, height = (own if own is not None else other for own, other in (steps, steps[::-1]))
    if width is None or height is None:
        raise InvalidInputError(
            "occlusion_error needs an image of more than one pixel, got 1 x 1; raise resolution"
        )
    return width, height
