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

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class RegionError:
    """Errors over a set of pixels, relative to `level`; times `level` they are absolute.

    Attributes
    ----------
    rms
        Root mean square, with the noise of both images subtracted in quadrature.
    noise
        The noise that was subtracted.
    bias
        Mean signed error.
    mean_absolute, largest
        Mean and largest absolute error, noise included.
    level
        Mean of the lit pixels of the whole reference, in its unit.
    pixels
        Number of pixels; all errors are 0 if there are none.
    """

    rms: float
    noise: float
    bias: float
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
    strip : ndarray of bool, (y, x)
        Pixels within a |D1 - D2| of a depth edge.
    photopic : dict of RegionError
        Photopic errors with keys "strip", "outside" and "all".
    spectral : dict of list of RegionError
        The same for every wavelength.
    """

    difference: xarray.DataArray
    photopic_difference: xarray.DataArray
    relative_difference: xarray.DataArray
    photopic_relative_difference: xarray.DataArray
    strip: np.ndarray
    photopic: dict[str, RegionError]
    spectral: dict[str, list[RegionError]]


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
        If grids or wavelengths differ, or neither image has a depth map.
    """
    check_type("image", image, RetinalImage)
    check_type("reference", reference, RetinalImage)
    _check_same_grid(image, reference)
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
    truth, off, off_noise2 = _photopic(image, reference, noisy)
    photopic_difference = difference.isel(wavelength=0, drop=True).copy(data=off)
    regions = {"strip": strip, "outside": ~strip, "all": np.ones_like(strip)}
    spectral = {
        name: [
            region_error(
                difference.values[i], noise2[i], _level(reference.irradiance.values[i]), mask
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
        strip,
        {
            name: region_error(off, off_noise2, _level(truth), mask)
            for name, mask in regions.items()
        },
        spectral,
    )


def region_error(
    difference: np.ndarray, noise2: np.ndarray, level: float, mask: np.ndarray
) -> RegionError:
    """Errors over the pixels of a mask; `noise2` is the variance of the difference."""
    count = int(np.sum(mask))
    if count == 0 or level == 0.0:
        return RegionError(0.0, 0.0, 0.0, 0.0, 0.0, level, count)
    off = difference[mask].astype(np.float64)
    noise = float(np.mean(noise2[mask], dtype=np.float64))
    square = float(np.mean(off * off))
    return RegionError(
        float(np.sqrt(max(square - noise, 0.0))) / level,
        float(np.sqrt(noise)) / level,
        float(np.mean(off)) / level,
        float(np.mean(np.abs(off))) / level,
        float(np.max(np.abs(off))) / level,
        level,
        count,
    )


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


def _check_same_grid(image: RetinalImage, reference: RetinalImage) -> None:
    for name in ("wavelength", "y", "x"):
        one, other = image.dataset[name].values, reference.dataset[name].values
        if one.shape != other.shape or not np.allclose(one, other, rtol=0, atol=1e-9):
            raise InvalidInputError(
                f"both images must lie on the same grid, but their {name!r} differ "
                f"({len(one)} and {len(other)} values); render both with the same arguments"
            )
