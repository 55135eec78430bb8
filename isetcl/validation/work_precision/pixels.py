"""Images as plain numbers, checked before anything is made of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_choice
from isetcl.retina.image import RetinalImage
from isetcl.validation.work_precision.method import ImageLike

Quantity = Literal["photopic", "spectral"]
QUANTITIES: tuple[Quantity, ...] = ("photopic", "spectral")


@dataclass(frozen=True, eq=False)
class Pixels:
    """The values of an image and where they lie.

    Attributes
    ----------
    values : ndarray
        As they were given: (y, x), (wavelength, y, x) or any shape of a plain array.
    variance : ndarray
        Squared standard errors, of the same shape; 0 where none is known.
    axes : dict of ndarray
        Coordinates by name; empty for a plain array.
    brightness, brightness_variance : ndarray
        The same of `RetinalImage.brightness`; a plain array is taken as brightness itself.
    """

    values: np.ndarray
    variance: np.ndarray
    axes: dict[str, np.ndarray]
    brightness: np.ndarray
    brightness_variance: np.ndarray

    def grid(self) -> str:
        """The grid in words."""
        if not self.axes:
            return f"an array of shape {self.values.shape}"
        texts = [
            f"{len(v)} {name} from {v[0]:.6g} to {v[-1]:.6g} {'nm' if name[0] == 'w' else 'deg'}"
            for name, v in self.axes.items()
        ]
        return ", ".join(texts)


def pixels_of(image: ImageLike, what: str, quantity: Quantity) -> Pixels:
    """The values of an image: photopic or by wavelength.

    Raises
    ------
    InvalidInputError
        If it is no image, has no pixels, or holds NaN or infinite values.
    """
    check_choice("quantity", quantity, QUANTITIES)
    axes: dict[str, np.ndarray] = {}
    if isinstance(image, RetinalImage):
        axes = {name: np.asarray(image.dataset[name].values) for name in ("wavelength", "y", "x")}
        brightness, variance_of_brightness = _squared(*image.brightness())
        values, variance = brightness, variance_of_brightness
        if quantity == "spectral":
            values, variance = _squared(image.irradiance.values, image.standard_error.values)
    else:
        values = brightness = check_array(what, image)
        variance = variance_of_brightness = np.zeros_like(values)
    if values.size == 0:
        raise InvalidInputError(f"{what} must have pixels, got an array of shape {values.shape}")
    wrong = int(np.sum(~np.isfinite(values)))
    if wrong:
        raise InvalidInputError(
            f"{what} must be finite in every pixel, got {wrong} NaN or infinite of {values.size}; "
            "mask them or mend the method"
        )
    return Pixels(values, variance, axes, brightness, variance_of_brightness)


def _squared(values: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.asarray(values, dtype=np.float64), np.square(np.asarray(error, dtype=np.float64))


def check_same_grid(one: Pixels, what: str, reference: Pixels) -> None:
    """Refuse pixels that do not lie where those of the reference do, and print both grids."""
    is_same = one.values.shape == reference.values.shape
    if is_same and one.axes and reference.axes:
        is_same = all(
            one.axes[name].shape == axis.shape
            and np.allclose(one.axes[name], axis, rtol=0, atol=1e-9)
            for name, axis in reference.axes.items()
        )
    if not is_same:
        raise InvalidInputError(
            f"{what} must lie on the grid of the reference; it has {one.grid()}, the reference "
            f"{reference.grid()}; make both with the same arguments"
        )
