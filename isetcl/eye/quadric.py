"""Quadrics through their vertex: cx x^2 + cy y^2 + q z^2 - 2 z = 0.

A conic of revolution has cx = cy = c and q = (1 + k) c; an ellipsoid with semi-axes (a, b, d) met
at the end of its third axis has cx = d/a^2, cy = d/b^2, q = 1/d. Other surfaces are searched from
the quadric nearest to them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Quadric:
    """Vertex curvatures in the two sections and the factor q of z^2, all 1/mm."""

    curvature_x: float
    curvature_y: float
    axial: float

    def sag_mm(self, x_mm: np.ndarray | float, y_mm: np.ndarray | float) -> np.ndarray:
        """z at (x, y), mm; NaN beyond the rim."""
        bend = self.curvature_x * np.square(x_mm) + self.curvature_y * np.square(y_mm)
        with np.errstate(invalid="ignore"):
            return np.asarray(bend / (1.0 + np.sqrt(1.0 - self.axial * bend)))

    def implicit(
        self, x: np.ndarray, y: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The left side S of the equation, (n,) mm, and g = -grad S / 2, (n, 3)."""
        cx, cy, q = self.curvature_x, self.curvature_y, self.axial
        value = cx * x * x + cy * y * y + q * z * z - 2.0 * z
        return value, np.stack([-cx * x, -cy * y, 1.0 - q * z], axis=-1)

    def intersect(
        self, position: np.ndarray, direction: np.ndarray, sense: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Lengths along unit directions, mm, to where rays cross it in their sense of travel.

        From the point of closest approach to the vertex, and by the root with g . d =
        sense sqrt(F^2 - A G) in the form that does not cancel (Feder 1951, J Opt Soc Am 41:630).

        Parameters
        ----------
        position, direction
            (n, 3), mm and unit vectors, in the frame of the vertex.
        sense
            +1 towards larger z, -1 towards smaller z.

        Returns
        -------
        length : (n,) mm; missed : (n,) bool
        """
        cx, cy, q = self.curvature_x, self.curvature_y, self.axial
        approach = -np.einsum("ij,ij->i", position, direction)
        x, y, z = (position + approach[:, None] * direction).T
        dx, dy, dz = direction.T
        f = dz - (cx * x * dx + cy * y * dy + q * z * dz)
        g = cx * x * x + cy * y * y + q * z * z - 2.0 * z
        a = cx * dx * dx + cy * dy * dy + q * dz * dz
        discriminant = f * f - a * g
        missed = ~(discriminant >= 0.0)
        root = sense * np.sqrt(np.where(missed, 0.0, discriminant))
        far = f * root < 0.0
        numerator = np.where(far, f - root, g)
        denominator = np.where(far, a, f + root)
        null = denominator == 0.0
        missed = missed | (null & (numerator != 0.0))
        return approach + numerator / np.where(null, 1.0, denominator), missed
