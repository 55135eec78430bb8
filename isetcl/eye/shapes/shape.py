"""What a surface shape has to know of itself.

The vertex is the origin and z the axis. A surface has a curvature c (1/mm) and a conic constant k
of its own; the shape says what is made of them. Rays are met by Newton's method on an implicit
equation S(x, y, z) = 0 of slope g = -grad S / 2, started on the nearest quadric; S is scaled like
the quadric's.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from isetcl.eye.quadric import Quadric


class SurfaceShape(Protocol):
    """A shape; `curvature` and `conic` are those of the surface that has it."""

    @property
    def is_rotational(self) -> bool:
        """Whether it is a surface of revolution about its axis."""

    def quadric(self, curvature: float, conic: float) -> Quadric:
        """The quadric on which searches start."""

    def is_quadric(self, curvature: float, conic: float) -> bool:
        """Whether that quadric is the surface itself."""

    def sag_mm(
        self, curvature: float, conic: float, x_mm: np.ndarray, y_mm: np.ndarray
    ) -> np.ndarray:
        """z at (x, y), mm; NaN where the surface does not exist."""

    def implicit(
        self, curvature: float, conic: float, x: np.ndarray, y: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """S, (n,) mm, and g, (n, 3); something smooth or NaN where the surface does not exist."""

    def vertex_curvatures(self, curvature: float) -> tuple[float, float, float]:
        """Second derivatives (zxx, zxy, zyy) of the sag at the vertex, 1/mm."""


class Departure:
    """A shape whose sag is that of the conic plus h(x, y): the conic, sheared along its axis.

    Subclasses give `departure`, h and its slopes.
    """

    def departure(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """h in mm, dh/dx and dh/dy at points in mm."""
        raise NotImplementedError

    def quadric(self, curvature: float, conic: float) -> Quadric:
        """The conic without its departure."""
        return Quadric(curvature, curvature, (1.0 + conic) * curvature)

    def is_quadric(self, curvature: float, conic: float) -> bool:
        """False."""
        return False

    def sag_mm(
        self, curvature: float, conic: float, x_mm: np.ndarray, y_mm: np.ndarray
    ) -> np.ndarray:
        """z at (x, y), mm; NaN beyond the rim of the conic."""
        x, y = np.broadcast_arrays(
            np.asarray(x_mm, dtype=np.float64), np.asarray(y_mm, dtype=np.float64)
        )
        return self.quadric(curvature, conic).sag_mm(x, y) + self.departure(x, y)[0]

    def implicit(
        self, curvature: float, conic: float, x: np.ndarray, y: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """S of the conic at z - h, and g."""
        height, slope_x, slope_y = self.departure(x, y)
        value, g = self.quadric(curvature, conic).implicit(x, y, z - height)
        along = g[..., 2]
        return value, np.stack(
            [g[..., 0] - along * slope_x, g[..., 1] - along * slope_y, along], axis=-1
        )
