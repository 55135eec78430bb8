"""Toric surfaces: an arc turned about an axis that does not pass through its centre."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isetcl.errors import check_finite
from isetcl.eye.quadric import Quadric


@dataclass(frozen=True)
class Toric:
    """The y section, a conic of sag s(y), turned about an axis parallel to y at z = 1/cx.

    cx (x^2 + z^2 - s^2) - 2 (z - s) = 0; cx = 0 is a cylinder. The surface's own `curvature` and
    `conic` are those of its y section (Zemax's "Toroidal" without polynomial terms).

    Parameters
    ----------
    curvature_x
        cx = 1/Rx, 1/mm, of the section in x.
    """

    curvature_x: float

    def __post_init__(self) -> None:
        value = check_finite("toric: curvature_x", self.curvature_x, "1/mm")
        object.__setattr__(self, "curvature_x", value)

    @property
    def is_rotational(self) -> bool:
        """False; use a plain conic for a surface of revolution."""
        return False

    def quadric(self, curvature: float, conic: float) -> Quadric:
        """The quadric with both vertex curvatures and the mean of both axial factors."""
        axial = (self.curvature_x + (1.0 + conic) * curvature) / 2.0
        return Quadric(self.curvature_x, curvature, axial)

    def is_quadric(self, curvature: float, conic: float) -> bool:
        """Whether both sections are one circle."""
        return conic == 0.0 and curvature == self.curvature_x

    def sag_mm(
        self, curvature: float, conic: float, x_mm: np.ndarray, y_mm: np.ndarray
    ) -> np.ndarray:
        """z at (x, y), mm; NaN beyond the rim."""
        arc, _ = _arc(curvature, conic, np.asarray(y_mm, dtype=np.float64))
        # z solves cx z^2 - 2 z + N = 0 with N = cx (x^2 - s^2) + 2 s.
        n = self.curvature_x * (np.square(x_mm) - arc * arc) + 2.0 * arc
        with np.errstate(invalid="ignore"):
            return np.asarray(n / (1.0 + np.sqrt(1.0 - self.curvature_x * n)))

    def implicit(
        self, curvature: float, conic: float, x: np.ndarray, y: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """S = cx (x^2 + z^2 - s^2) - 2 (z - s), and g."""
        cx = self.curvature_x
        arc, slope = _arc(curvature, conic, y)
        value = cx * (x * x + z * z - arc * arc) - 2.0 * (z - arc)
        return value, np.stack([-cx * x, -(1.0 - cx * arc) * slope, 1.0 - cx * z], axis=-1)

    def vertex_curvatures(self, curvature: float) -> tuple[float, float, float]:
        """(cx, 0, cy)."""
        return self.curvature_x, 0.0, curvature


def _arc(curvature: float, conic: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sag s(y) of the conic section, mm, and its slope."""
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(1.0 - (1.0 + conic) * np.square(curvature * y))
        return curvature * y * y / (1.0 + root), curvature * y / root
