"""A refractive index from a table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.spectrum import check_wavelengths


@dataclass(frozen=True)
class TabulatedIndex:
    """Dispersion from measured indices at ascending wavelengths, interpolated linearly.

    Parameters
    ----------
    wavelengths_nm
        Ascending wavelengths, nm.
    indices
        Refractive index at each, >= 1.

    Raises
    ------
    InvalidInputError
        If the lists differ in length or a value breaks its rule.
    """

    wavelengths_nm: tuple[float, ...]
    indices: tuple[float, ...]

    def __post_init__(self) -> None:
        grid = check_wavelengths(self.wavelengths_nm)
        values = np.asarray(self.indices, dtype=np.float64)
        if values.shape != grid.shape or not np.isfinite(values).all() or np.any(values < 1.0):
            raise InvalidInputError(
                "tabulated index: indices must be finite and >= 1, one a wavelength "
                f"({len(grid)}), got {len(values)} from {values.min(initial=np.inf):g}"
            )
        object.__setattr__(self, "wavelengths_nm", tuple(grid.tolist()))
        object.__setattr__(self, "indices", tuple(values.tolist()))

    @property
    def range_nm(self) -> tuple[float, float]:
        """The span of the table, nm."""
        return (self.wavelengths_nm[0], self.wavelengths_nm[-1])

    def evaluate(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """Refractive index, shape of the input."""
        return np.interp(wavelength_nm, self.wavelengths_nm, self.indices)
