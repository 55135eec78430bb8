"""What a slanted edge is measured in: pixel values, their errors, wavelengths and scale."""

from __future__ import annotations

import dataclasses
import operator
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_type
from isetcl.eye.model import Eye
from isetcl.retina.image import RetinalImage
from isetcl.spectrum import check_wavelengths, photopic_weights
from isetcl.validation.transfer.pixel_scale import PixelScale, scale_of_image

_CLIPPED_SHARE = 0.1
_MOST_CUT = 0.7
_COUNT_STEP = 0.5

Region = tuple[int, int, int, int]


@dataclass(frozen=True, eq=False)
class EdgeSource:
    """An image with what is known of it.

    Attributes
    ----------
    name
        What it is, for messages.
    values : ndarray, (wavelengths, rows, columns)
        Pixels.
    errors : ndarray of the same shape, or None
        Their standard errors; None if they are to be estimated.
    brightness, brightness_error : ndarray, (rows, columns)
        The photopic image and its standard error, or None as before.
    wavelengths_nm : ndarray, (wavelengths,), or None
        Wavelengths.
    scale
        Size and place of the pixels.
    """

    name: str
    values: np.ndarray
    errors: np.ndarray | None
    brightness: np.ndarray
    brightness_error: np.ndarray | None
    wavelengths_nm: np.ndarray | None
    scale: PixelScale

    def __post_init__(self) -> None:
        bad = ~np.isfinite(self.values).all(axis=0)
        if np.any(bad):
            row, column = np.argwhere(bad)[0]
            raise InvalidInputError(
                f"pixels of {self.name} must be finite, got {int(np.sum(bad))} that are not, the "
                f"first in row {row}, column {column}; choose a region without them"
            )
        if self.errors is not None and not np.all(self.errors >= 0.0):
            raise InvalidInputError("standard_error must be >= 0 everywhere and not NaN")


def check_region(region: Region, rows: int, columns: int) -> Region:
    """The four borders of a region; raise InvalidInputError unless they lie in the image."""
    try:
        top, bottom, left, right = (operator.index(i) for i in region)
    except (TypeError, ValueError):
        top, bottom, left, right = 0, -1, 0, -1
    if not (0 <= top < bottom <= rows and 0 <= left < right <= columns):
        raise InvalidInputError(
            "region must be first row, row after the last, first column, column after the last "
            f"within {rows} x {columns} pixels, got {region!r}"
        )
    return top, bottom, left, right


def source_of(
    image: RetinalImage | np.ndarray,
    *,
    pitch_deg: float | None,
    pitch_mm: float | None,
    wavelengths_nm: np.ndarray | Sequence[float] | None,
    standard_error: np.ndarray | float | None,
    weights: np.ndarray | Sequence[float] | None,
    eye: Eye | None,
    region: Region | None,
) -> EdgeSource:
    """The pixels of a retinal image or an array; see `slanted_edge_mtf`.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule, pixels are not square, not finite or saturated.
    """
    if eye is not None:
        check_type("eye", eye, Eye)
    if isinstance(image, RetinalImage):
        given = (pitch_deg, pitch_mm, wavelengths_nm, standard_error)
        if any(each is not None for each in given):
            raise InvalidInputError(
                "a retinal image knows its pitch, wavelengths and standard error; leave out "
                "pitch_deg, pitch_mm, wavelengths_nm and standard_error"
            )
        values = np.asarray(image.irradiance.values, dtype=np.float64)
        errors: np.ndarray | None = np.asarray(image.standard_error.values, dtype=np.float64)
        grid: np.ndarray | None = image.wavelengths_nm
        scale = scale_of_image(image, eye)
        visible = photopic_weights(image.wavelengths_nm)
    else:
        values, errors = _arrays(image, standard_error, region)
        visible = np.zeros(len(values))
        grid = None if wavelengths_nm is None else check_wavelengths(wavelengths_nm)
        if grid is not None and len(grid) != len(values):
            raise InvalidInputError(
                f"wavelengths_nm must be one per image, {len(values)}, got {len(grid)}"
            )
        scale = PixelScale(pitch_deg, pitch_mm)
    share = _shares(grid, len(values), weights)
    name, part = "the image", (slice(None), slice(None))
    if region is not None:
        borders = check_region(region, *values.shape[-2:])
        name, part = f"region {borders}", (slice(*borders[:2]), slice(*borders[2:]))
        corner = scale.place(float(borders[0]), float(borders[2]))
        scale = dataclasses.replace(scale, left_top=corner)
    # Only now, so that pixels outside the region may be anything.
    inside = (slice(None), *part)
    values = values[inside]
    errors = None if errors is None else errors[inside]
    brightness = values[0] if len(values) == 1 else np.tensordot(share, values, axes=1)
    if errors is None or len(values) == 1:
        noise = None if errors is None else errors[0]
    elif isinstance(image, RetinalImage) and weights is None and np.any(visible > 0):
        noise = np.asarray(image.dataset["illuminance_standard_error"].values, dtype=np.float64)
        noise = noise[part] / np.sum(visible)
    else:
        # Wavelengths may share their samples: the errors of the worst case add.
        noise = np.tensordot(share, errors, axes=1)
    return EdgeSource(name, values, errors, brightness, noise, grid, scale)


def _arrays(
    image: np.ndarray, standard_error: np.ndarray | float | None, region: Region | None
) -> tuple[np.ndarray, np.ndarray | None]:
    """Pixels (wavelengths, rows, columns) of an array, and their errors if told."""
    if np.ma.isMaskedArray(image) and np.ma.is_masked(image):
        # Hidden pixels become NaN, which is refused where they lie in the region.
        image = np.ma.filled(image.astype(np.float64), np.nan)
    values = check_array("image", image)
    if values.ndim not in (2, 3) or min(values.shape) < 1:
        raise InvalidInputError(
            "image must be a RetinalImage or an array (rows, columns) or (wavelengths, rows, "
            f"columns), got shape {values.shape}"
        )
    kind = np.asarray(image).dtype
    if kind.kind in "iu":
        part = values
        if region is not None:
            top, bottom, left, right = check_region(region, *values.shape[-2:])
            part = values[..., top:bottom, left:right]
        _check_limits(part, kind)
    values = values[None] if values.ndim == 2 else values
    if standard_error is None:
        return values, None
    errors = check_array("standard_error", standard_error)
    if errors.ndim != 0 and errors.shape != np.shape(image):
        raise InvalidInputError(
            f"standard_error must be one number or have the shape of the image "
            f"{np.shape(image)}, got {errors.shape}"
        )
    return values, np.array(np.broadcast_to(errors, np.shape(image))).reshape(values.shape)


def _check_limits(values: np.ndarray, kind: np.dtype) -> None:
    limits = np.iinfo(kind)
    clipped = float(np.mean(values >= limits.max))
    if clipped > _CLIPPED_SHARE:
        raise InvalidInputError(
            f"the image is saturated: {100.0 * clipped:.0f} % of its pixels are at {limits.max}, "
            f"the limit of {kind}; expose less"
        )


def check_not_clipped(values: np.ndarray, name: str, is_noisy: bool) -> None:
    """Raise InvalidInputError if noisy pixels of the bright side stand at one value.

    Parameters
    ----------
    values : ndarray, (n,)
        Pixels of the bright side.
    is_noisy
        Whether pixels of the image scatter: without noise an even side is no sign of anything.
    """
    clipped = float(np.mean(values >= np.max(values)))
    if is_noisy and clipped > _CLIPPED_SHARE:
        raise InvalidInputError(
            f"the bright side of the edge in {name} is saturated: {100.0 * clipped:.0f} % of its "
            f"pixels are exactly {np.max(values):g}, while others scatter; expose less"
        )


def check_not_cut(values: np.ndarray, name: str) -> None:
    """Raise InvalidInputError if noise of the dark side is cut off at its lowest value.

    Counts of few photons are often 0 too, but they are whole steps apart.

    Parameters
    ----------
    values : ndarray, (n,)
        Pixels of the dark side.
    """
    lowest = np.min(values)
    above = values[values > lowest]
    cut = 1.0 - len(above) / len(values)
    if not _CLIPPED_SHARE < cut < _MOST_CUT:
        return
    step = float(np.min(above) - lowest)
    if step < _COUNT_STEP * float(np.std(values)):
        raise InvalidInputError(
            f"the dark side of the edge in {name} is cut off: {100.0 * cut:.0f} % of its pixels "
            f"are exactly {lowest:g}, while others scatter above; keep values below the black "
            "level, negative ones too"
        )


def _shares(
    grid: np.ndarray | None, count: int, weights: np.ndarray | Sequence[float] | None
) -> np.ndarray:
    """Weights of the wavelengths in the photopic image, (n,)."""
    if weights is not None:
        share = check_array("weights", weights)
        is_weight = np.isfinite(share) & (share >= 0)
        if share.shape != (count,) or not np.all(is_weight) or not np.sum(share) > 0:
            raise InvalidInputError(
                f"weights must be {count} numbers >= 0, one per wavelength, not all 0, got "
                f"{np.asarray(weights).tolist()}"
            )
        return share / np.sum(share)
    if grid is not None and np.any(photopic_weights(grid) > 0):
        return photopic_weights(grid) / np.sum(photopic_weights(grid))
    return np.full(count, 1.0 / count)
