"""Whether two retinal images can be compared: on one grid, and finite."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from isetcl.errors import InvalidInputError

if TYPE_CHECKING:
    from isetcl.retina.image import RetinalImage


def check_one_grid(image: RetinalImage, reference: RetinalImage) -> None:
    """Raise InvalidInputError, with both grids, unless two retinal images lie on one."""
    for axis in ("wavelength", "y", "x"):
        one, other = image.dataset[axis].values, reference.dataset[axis].values
        if one.shape != other.shape or not np.allclose(one, other, rtol=1e-9, atol=1e-9):
            raise InvalidInputError(
                "image and reference must lie on one grid, got "
                f"{_grid(image)} and {_grid(reference)}; render both with the same fov_deg, "
                "resolution, centre_deg and wavelengths_nm"
            )


def check_finite_pixels(name: str, image: RetinalImage) -> None:
    """Raise InvalidInputError, with the first of them, if pixels are NaN or infinite."""
    bad = ~np.isfinite(image.dataset["irradiance"].values).all(axis=0)
    if np.any(bad):
        row, column = np.argwhere(bad)[0]
        raise InvalidInputError(
            f"pixels of the {name} must be finite, got {int(np.sum(bad))} that are not, the first "
            f"in row {row}, column {column}; cut them off or mend what made them"
        )


def _grid(image: RetinalImage) -> str:
    parts = []
    for axis, unit in (("x", "deg"), ("y", "deg"), ("wavelength", "nm")):
        values = image.dataset[axis].values
        parts.append(f"{len(values)} {axis} {values[0]:.6g} to {values[-1]:.6g} {unit}")
    return f"({', '.join(parts)})"
