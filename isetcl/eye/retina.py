"""The surface that receives the image."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_finite, check_positive
from isetcl.eye.placement import Placement
from isetcl.eye.shapes.biconic import Biconic
from isetcl.eye.shapes.shape import SurfaceShape
from isetcl.eye.surface import check_form, curvature_of, form_sag, is_rotational


@dataclass(frozen=True)
class Retina:
    """The surface that receives the image, concave towards the lens.

    Parameters
    ----------
    vertex_z_mm
        Where it meets the axis, mm behind the corneal vertex (the axial length).
    curvature
        c = 1/R, 1/mm, <= 0: the centre of curvature lies in front of the retina.
    conic
        k of the conic, 0 for a sphere.
    shape
        What is made of them, as for a `Surface`: a `Biconic` for an ellipsoid with three different
        axes (see `ellipsoid`), a `HeightMap` for a relief of drusen or a staphyloma; None for the
        conic of revolution.
    placement
        Decentration, tilt and axis; None if it lies on the axis of the eye.
    """

    vertex_z_mm: float
    curvature: float
    conic: float = 0.0
    shape: SurfaceShape | None = None
    placement: Placement | None = None

    def __post_init__(self) -> None:
        check_positive("retina: vertex_z_mm", self.vertex_z_mm, "mm")
        check_finite("retina: conic", self.conic)
        if check_finite("retina: curvature", self.curvature, "1/mm") > 0:
            raise InvalidInputError(
                "retina: curvature must be <= 0 1/mm (centre of curvature in front of the "
                f"retina), got {self.curvature:g}; pass a negative radius"
            )
        check_form("retina", self.shape, self.placement)

    @classmethod
    def from_radius(cls, vertex_z_mm: float, radius_mm: float, conic: float = 0.0) -> Retina:
        """A retina given by its radius of curvature, mm, negative (Navarro: -12)."""
        return cls(vertex_z_mm, curvature_of("retina: radius_mm", radius_mm), conic)

    @classmethod
    def ellipsoid(
        cls,
        vertex_z_mm: float,
        semi_axes_mm: tuple[float, float, float],
        placement: Placement | None = None,
    ) -> Retina:
        """The rear half of an ellipsoid with semi-axes (x, y, z) in mm."""
        a, b, d = (check_positive("retina: semi_axes_mm", s, "mm") for s in semi_axes_mm)
        in_x, in_y = -d / a**2, -d / b**2
        # (1 + k) c = -1/d in both sections makes the biconic the ellipsoid itself.
        if a == b:
            return cls(vertex_z_mm, in_y, -1.0 / (d * in_y) - 1.0, None, placement)
        shape = Biconic(in_x, -1.0 / (d * in_x) - 1.0)
        return cls(vertex_z_mm, in_y, -1.0 / (d * in_y) - 1.0, shape, placement)

    @property
    def radius_mm(self) -> float:
        """Vertex radius of curvature (of the y section), mm (negative); `-inf` for a plane."""
        return -math.inf if self.curvature == 0 else 1.0 / self.curvature

    @property
    def is_rotational(self) -> bool:
        """Whether it is a surface of revolution about the axis of the eye."""
        return is_rotational(self.shape, self.placement)

    def sag_mm(self, x_mm: np.ndarray | float, y_mm: np.ndarray | float = 0.0) -> np.ndarray:
        """z at (x, y), mm, all in its own frame, of the half behind the equator's rim; or NaN."""
        return form_sag(self.curvature, self.conic, self.shape, x_mm, y_mm)
