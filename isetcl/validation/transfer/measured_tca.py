"""Transverse chromatic aberration as an image shows it: where a bright line lies, by colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_type
from isetcl.eye.model import Eye
from isetcl.retina.image import RetinalImage
from isetcl.units import ARCMIN_PER_DEG
from isetcl.validation.transfer.edge_line import turned
from isetcl.validation.transfer.pixel_scale import scale_of_image
from isetcl.validation.transfer.source import Region, check_region

_GAP = 0.05
_LEAST_ROWS = 4


@dataclass(frozen=True, eq=False)
class MeasuredTca:
    """Places of a line by wavelength; n wavelengths.

    Attributes
    ----------
    wavelengths_nm : ndarray, (n,)
        Wavelengths.
    shift_arcmin, standard_error_arcmin : ndarray, (n,)
        Where the centroid of the line lies across it, less that at the longest wavelength, and the
        standard error of each centroid, arcmin of visual angle; positive to the right, or upwards
        for a line nearer to the horizontal.
    field_deg
        Field angles (x, y) of the middle of the line at the longest wavelength.
    normal : tuple
        Unit vector across the line, right and up.
    """

    wavelengths_nm: np.ndarray
    shift_arcmin: np.ndarray
    standard_error_arcmin: np.ndarray
    field_deg: tuple[float, float]
    normal: tuple[float, float]

    @property
    def range_arcmin(self) -> float:
        """Distance between the wavelengths at the two ends."""
        return abs(float(self.shift_arcmin[0] - self.shift_arcmin[-1]))


def measured_tca(
    image: RetinalImage, *, region: Region | None = None, eye: Eye | None = None
) -> MeasuredTca:
    """Transverse chromatic aberration from an image of a bright line, such as of `scenes.tca_grid`.

    The centroid of the line is taken in every row (or column) and wavelength. It differs from the
    chief ray's point by the coma of the eye and by what changes it with wavelength; take a small
    pupil to compare with `Eye.tca_arcmin`.

    Parameters
    ----------
    image
        A retinal image of at least two wavelengths, in which one line stands on a dark ground.
    region
        Part of the image that holds one line: first row, row after the last, first column, column
        after the last. None takes the whole image.
    eye
        The eye of the image; None takes it from the image.

    Raises
    ------
    InvalidInputError
        If there is no such line, or it is cut off by the border.
    """
    check_type("image", image, RetinalImage)
    scale = scale_of_image(image, eye)
    values = np.asarray(image.irradiance.values, dtype=np.float64)
    errors = np.asarray(image.standard_error.values, dtype=np.float64)
    if len(values) < 2:
        raise InvalidInputError(
            "transverse chromatic aberration needs at least two wavelengths, got "
            f"{image.wavelengths_nm.tolist()} nm"
        )
    rows, columns = values.shape[1:]
    top, bottom, left, right = check_region(
        (0, rows, 0, columns) if region is None else region, rows, columns
    )
    values, errors = values[:, top:bottom, left:right], errors[:, top:bottom, left:right]
    if not np.all(np.isfinite(values)):
        raise InvalidInputError(
            "pixels of the image must be finite, got NaN; choose a region without them"
        )
    level = np.mean(values, axis=(1, 2))
    if not np.all(level > 0.0):
        raise InvalidInputError("every wavelength must have light, but one is black")
    shares = values / level[:, None, None]
    is_turned = np.ptp(shares.mean(axis=(0, 2))) > np.ptp(shares.mean(axis=(0, 1)))
    lines, noise = turned(shares, is_turned), turned(errors / level[:, None, None], is_turned)
    _check_line(lines)
    centre, variance = _centroids(lines, noise)
    height = np.arange(lines.shape[1]) - (lines.shape[1] - 1) / 2.0
    slope = float(np.polyfit(height, centre[-1], 1)[0])
    normal = np.array([1.0, -slope]) / np.hypot(1.0, slope)
    normal = normal[::-1] if is_turned else normal
    s, t = float(np.mean(centre[-1])), (lines.shape[1] - 1) / 2.0
    size = bottom - top
    row, column = (size - 1 - s, t) if is_turned else (size - 1 - t, s)
    field = scale.place(top + row, left + column)
    per_deg, _ = scale.cycles(normal, field)
    assert per_deg is not None
    step = ARCMIN_PER_DEG / (per_deg * np.hypot(1.0, slope))
    mean = centre.mean(axis=1)
    error = np.sqrt(variance.sum(axis=1)) / lines.shape[1]
    return MeasuredTca(
        image.wavelengths_nm,
        (mean - mean[-1]) * step,
        error * step,
        field,
        (float(normal[0]), float(normal[1])),
    )


def _check_line(lines: np.ndarray) -> None:
    """Refuse what is not one bright line on dark ground, in full."""
    profile = lines.mean(axis=1)
    ends = np.maximum(profile[:, 0], profile[:, -1])
    if lines.shape[1] < _LEAST_ROWS or np.any(ends > _GAP * profile.max(axis=1)):
        raise InvalidInputError(
            "the image (or region) must hold one bright line, dark on both sides and at least "
            f"{_LEAST_ROWS} pixels long, but at its border the brightness is "
            f"{float(np.max(ends / profile.max(axis=1))):.2g} of the highest; choose a region"
        )


def _centroids(lines: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centroid of every row and its variance, each (wavelengths, rows), pixels."""
    place = np.arange(lines.shape[2])
    mass = lines.sum(axis=2)
    centre = (lines * place).sum(axis=2) / mass
    away = place - centre[..., None]
    variance = np.sum((away * noise) ** 2, axis=2) / mass**2
    return centre, variance
