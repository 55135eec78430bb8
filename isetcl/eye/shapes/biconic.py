"""Biconics: a conic section in x and another in y, joined in the manner of Zemax and of ISET3d."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isetcl.errors import check_finite
from isetcl.eye.quadric import Quadric


@dataclass(frozen=True)
class Biconic:
    """z = N / (1 + sqrt(1 - A)), N = cx x^2 + cy y^2, A = (1 + kx) cx^2 x^2 + (1 + ky) cy^2 y^2.

    The surface's own `curvature` and `conic` are those of its y section, cy and ky.

    Parameters
    ----------
    curvature_x
        cx = 1/Rx, 1/mm.
    conic_x
        kx.

    Source: Lian et al. 2019, J Vis 19(13):23, equation 1 (which is Zemax's "Biconic").
    """

    curvature_x: float
    conic_x: float = 0.0

    def __post_init__(self) -> None:
        for name, unit in (("curvature_x", "1/mm"), ("conic_x", "")):
            value = check_finite(f"biconic: {name}", getattr(self, name), unit)
            object.__setattr__(self, name, value)

    @property
    def is_rotational(self) -> bool:
        """False; use a plain conic for a surface of revolution."""
        return False

    def quadric(self, curvature: float, conic: float) -> Quadric:
        """The quadric with both vertex curvatures and the mean of both axial factors."""
        both = (1.0 + self.conic_x) * self.curvature_x + (1.0 + conic) * curvature
        return Quadric(self.curvature_x, curvature, both / 2.0)

    def is_quadric(self, curvature: float, conic: float) -> bool:
        """Whether (1 + kx) cx = (1 + ky) cy."""
        first, second = (1.0 + self.conic_x) * self.curvature_x, (1.0 + conic) * curvature
        return abs(first - second) <= 4e-16 * max(abs(first), abs(second))

    def sag_mm(
        self, curvature: float, conic: float, x_mm: np.ndarray, y_mm: np.ndarray
    ) -> np.ndarray:
        """z at (x, y), mm; NaN beyond the rim."""
        bend = self.curvature_x * np.square(x_mm) + curvature * np.square(y_mm)
        return np.asarray(bend / (1.0 + self._root(curvature, conic, x_mm, y_mm)))

    def implicit(
        self, curvature: float, conic: float, x: np.ndarray, y: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """S = N - z (1 + sqrt(1 - A)), and g; beyond the rim the root is taken to be 0."""
        cx, cy = self.curvature_x, curvature
        root = np.nan_to_num(self._root(curvature, conic, x, y))
        value = cx * x * x + cy * y * y - z * (1.0 + root)
        lean = np.where(root > 0.0, z / (2.0 * np.where(root > 0.0, root, 1.0)), 0.0)
        g = np.stack(
            [
                -cx * x * (1.0 + lean * (1.0 + self.conic_x) * cx),
                -cy * y * (1.0 + lean * (1.0 + conic) * cy),
                (1.0 + root) / 2.0,
            ],
            axis=-1,
        )
        return value, g

    def vertex_curvatures(self, curvature: float) -> tuple[float, float, float]:
        """(cx, 0, cy)."""
        return self.curvature_x, 0.0, curvature

    def _root(
        self, curvature: float, conic: float, x: np.ndarray | float, y: np.ndarray | float
    ) -> np.ndarray:
        a = (1.0 + self.conic_x) * np.square(self.curvature_x * np.asarray(x))
        a = a + (1.0 + conic) * np.square(curvature * np.asarray(y))
        with np.errstate(invalid="ignore"):
            return np.sqrt(1.0 - a)
