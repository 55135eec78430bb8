"""Even aspheres: a conic and even powers of the distance from the axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_array
from isetcl.eye.shapes.shape import Departure

MAX_TERMS = 8
"""Most coefficients, to the 16th power, as in Zemax's "Even Asphere"."""


@dataclass(frozen=True)
class EvenAsphere(Departure):
    """The conic plus a1 rho^2 + a2 rho^4 + ... + a8 rho^16.

    Parameters
    ----------
    coefficients
        a1, a2, ...; the i-th in mm^(1 - 2i). At most 8.
    """

    coefficients: Sequence[float]

    def __post_init__(self) -> None:
        values = check_array("even asphere: coefficients", self.coefficients)
        if values.ndim != 1 or not 1 <= values.size <= MAX_TERMS or not np.all(np.isfinite(values)):
            raise InvalidInputError(
                f"even asphere: coefficients must be 1 to {MAX_TERMS} finite numbers (of rho^2, "
                f"rho^4, ...), got {values.tolist()}"
            )
        object.__setattr__(self, "coefficients", tuple(values.tolist()))

    @property
    def is_rotational(self) -> bool:
        """True."""
        return True

    def departure(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The sum of powers and its slopes."""
        s = x * x + y * y
        series = np.polynomial.Polynomial((0.0, *self.coefficients))
        slope = 2.0 * series.deriv()(s)
        return np.asarray(series(s)), np.asarray(slope * x), np.asarray(slope * y)

    def vertex_curvatures(self, curvature: float) -> tuple[float, float, float]:
        """c + 2 a1 in every section."""
        bent = curvature + 2.0 * self.coefficients[0]
        return bent, 0.0, bent
