"""Refracting surfaces: a conic of revolution, or another shape, in its place in the eye.

Eye frame: mm, origin at the corneal vertex, +z from the cornea to the retina, +y superior. The
radius of a surface is > 0 when its centre of curvature lies at larger z; the curvature c = 1/R is
what is stored, so that a plane is c = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_finite,
    check_number,
    check_positive,
    check_type,
)
from isetcl.eye.media import Medium
from isetcl.eye.placement import Placement
from isetcl.eye.quadric import Quadric
from isetcl.eye.shapes.biconic import Biconic
from isetcl.eye.shapes.height_map import HeightMap
from isetcl.eye.shapes.shape import SurfaceShape
from isetcl.eye.shapes.toric import Toric

_RIM_POINTS = 64
_REMEDY = "pass a shape such as Biconic(...), or None for a conic of revolution"


def conic_sag(rho_mm: np.ndarray | float, curvature: float, conic: float) -> np.ndarray:
    """Sag z(rho) of a conic of revolution, mm: c rho^2 / (1 + sqrt(1 - (1 + k) c^2 rho^2)).

    NaN beyond the rim. For building geometry only; ray hits are never re-projected on it, because
    they may lie behind the equator.
    """
    rho2 = np.square(rho_mm)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(1.0 - (1.0 + conic) * curvature**2 * rho2)
    return curvature * rho2 / (1.0 + root)


@dataclass(frozen=True)
class Surface:
    """A refracting surface, by default the conic c (x^2 + y^2 + (1 + k) z^2) - 2 z = 0.

    Parameters
    ----------
    name
        For messages and drawings, "cornea front".
    vertex_z_mm
        Where the surface meets the axis, mm behind the corneal vertex.
    curvature
        c = 1/R, 1/mm; 0 is a plane; > 0 if the centre lies at larger z.
    conic
        k: 0 sphere, -1 paraboloid, < -1 hyperboloid.
    semi_diameter_mm
        Largest distance from its axis at which the surface exists, mm.
    medium_after
        The medium on the retinal side.
    shape
        What is made of curvature and conic: `Biconic`, `Toric`, `EvenAsphere`, `ZernikeSag`,
        `HeightMap`, or None for the conic of revolution itself.
    placement
        Decentration, tilt and axis; None if it lies on the axis of the eye.
    """

    name: str
    vertex_z_mm: float
    curvature: float
    conic: float
    semi_diameter_mm: float
    medium_after: Medium
    shape: SurfaceShape | None = None
    placement: Placement | None = None

    def __post_init__(self) -> None:
        label = f"surface {self.name!r}"
        check_type("surface: name", self.name, str)
        for name, unit in (("vertex_z_mm", "mm"), ("curvature", "1/mm"), ("conic", "")):
            value = check_finite(f"{label}: {name}", getattr(self, name), unit)
            object.__setattr__(self, name, value)
        check_positive(f"{label}: semi_diameter_mm", self.semi_diameter_mm, "mm")
        check_type(f"{label}: medium_after", self.medium_after, Medium)
        check_form(label, self.shape, self.placement)
        if self.shape is None:
            self._check_conic(label)
        else:
            self._check_shape(label, self.shape)

    def _check_conic(self, label: str) -> None:
        bend = self.curvature * self.semi_diameter_mm
        rim2 = (1.0 + self.conic) * bend * bend  # a power would overflow with an exception
        if rim2 >= 1.0:
            reach = 1.0 / (abs(self.curvature) * math.sqrt(1.0 + self.conic))
            raise InvalidInputError(
                f"{label}: semi_diameter_mm must be < {reach:.6g} mm, where this conic ends, "
                f"got {self.semi_diameter_mm:g}"
            )

    def _check_shape(self, label: str, shape: SurfaceShape) -> None:
        turn = 2.0 * np.pi * np.arange(_RIM_POINTS) / _RIM_POINTS
        rho = self.semi_diameter_mm * np.linspace(0.0, 1.0, 33)[:, None]
        sag = shape.sag_mm(self.curvature, self.conic, rho * np.cos(turn), rho * np.sin(turn))
        ended = ~np.isfinite(sag).all(axis=1)
        if ended.any():
            raise InvalidInputError(
                f"{label}: semi_diameter_mm must be less than the place where this "
                f"{type(shape).__name__} ends, about {float(rho[np.argmax(ended), 0]):.3g} mm, "
                f"got {self.semi_diameter_mm:g}"
            )
        if isinstance(shape, HeightMap):
            half = min(shape.width_mm, shape.height_mm) / 2.0
            if half < self.semi_diameter_mm:
                raise InvalidInputError(
                    f"{label}: semi_diameter_mm must lie within the height map, {half:g} mm from "
                    f"its middle, got {self.semi_diameter_mm:g}; measure a larger map"
                )

    @classmethod
    def from_radius(
        cls,
        name: str,
        vertex_z_mm: float,
        radius_mm: float,
        *,
        conic: float = 0.0,
        semi_diameter_mm: float,
        medium_after: Medium,
        shape: SurfaceShape | None = None,
        placement: Placement | None = None,
    ) -> Surface:
        """A surface given by its vertex radius of curvature in mm; `inf` is a plane.

        Raises
        ------
        InvalidInputError
            If the radius is zero or NaN.
        """
        curvature = curvature_of(f"surface {name!r}: radius_mm", radius_mm)
        return cls(
            name, vertex_z_mm, curvature, conic, semi_diameter_mm, medium_after, shape, placement
        )

    @classmethod
    def biconic(
        cls,
        name: str,
        vertex_z_mm: float,
        radii_mm: tuple[float, float],
        *,
        conics: tuple[float, float] = (0.0, 0.0),
        axis_deg: float = 0.0,
        semi_diameter_mm: float,
        medium_after: Medium,
    ) -> Surface:
        """A biconic given by the radii (x, y) in mm and conic constants of its sections.

        `axis_deg` is the direction of its x section, from +x towards +y.
        """
        label = f"surface {name!r}: radii_mm"
        in_x, in_y = (curvature_of(label, radius) for radius in radii_mm)
        placement = Placement(axis_deg=axis_deg) if axis_deg != 0.0 else None
        shape = Biconic(in_x, conics[0])
        return cls(
            name, vertex_z_mm, in_y, conics[1], semi_diameter_mm, medium_after, shape, placement
        )

    @classmethod
    def toric(
        cls,
        name: str,
        vertex_z_mm: float,
        radii_mm: tuple[float, float],
        *,
        axis_deg: float = 0.0,
        semi_diameter_mm: float,
        medium_after: Medium,
    ) -> Surface:
        """A torus given by its radii (x, y) in mm; see `biconic`."""
        label = f"surface {name!r}: radii_mm"
        in_x, in_y = (curvature_of(label, radius) for radius in radii_mm)
        placement = Placement(axis_deg=axis_deg) if axis_deg != 0.0 else None
        return cls(
            name, vertex_z_mm, in_y, 0.0, semi_diameter_mm, medium_after, Toric(in_x), placement
        )

    @property
    def radius_mm(self) -> float:
        """Vertex radius of curvature (of the y section), mm; `inf` for a plane."""
        return math.inf if self.curvature == 0 else 1.0 / self.curvature

    @property
    def is_rotational(self) -> bool:
        """Whether it is a surface of revolution about the axis of the eye."""
        return is_rotational(self.shape, self.placement)

    def sag_mm(self, x_mm: np.ndarray | float, y_mm: np.ndarray | float = 0.0) -> np.ndarray:
        """z at (x, y), mm, all in the surface's own frame; NaN where it does not exist."""
        return form_sag(self.curvature, self.conic, self.shape, x_mm, y_mm)

    def vertex_curvatures(self) -> tuple[float, float, float]:
        """Second derivatives (zxx, zxy, zyy) of the sag at the vertex along the eye's x and y.

        1/mm. A tilt is left out.
        """
        if self.shape is None:
            return self.curvature, 0.0, self.curvature
        xx, xy, yy = self.shape.vertex_curvatures(self.curvature)
        if self.placement is None or self.placement.axis_deg == 0.0:
            return xx, xy, yy
        turn = math.radians(self.placement.axis_deg)
        axes = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
        turned = axes @ np.array([[xx, xy], [xy, yy]]) @ axes.T
        return float(turned[0, 0]), float(turned[0, 1]), float(turned[1, 1])


def form_quadric(curvature: float, conic: float, shape: SurfaceShape | None) -> Quadric:
    """The quadric of a form, or the one nearest to it."""
    if shape is None:
        return Quadric(curvature, curvature, (1.0 + conic) * curvature)
    return shape.quadric(curvature, conic)


def form_sag(
    curvature: float,
    conic: float,
    shape: SurfaceShape | None,
    x_mm: np.ndarray | float,
    y_mm: np.ndarray | float,
) -> np.ndarray:
    """Sag of a form at (x, y) in its own frame, mm."""
    if shape is None:
        return conic_sag(np.hypot(x_mm, y_mm), curvature, conic)
    x, y = np.broadcast_arrays(
        np.asarray(x_mm, dtype=np.float64), np.asarray(y_mm, dtype=np.float64)
    )
    return shape.sag_mm(curvature, conic, x, y)


def is_rotational(shape: SurfaceShape | None, placement: Placement | None) -> bool:
    """Whether a form in its place is a surface of revolution about the axis of the eye."""
    return (shape is None or shape.is_rotational) and (placement is None or placement.is_centred)


def check_form(label: str, shape: object, placement: object) -> None:
    """Refuse what is no shape or no placement."""
    if shape is not None and not hasattr(shape, "implicit"):
        raise InvalidInputError(
            f"{label}: shape must be a surface shape, got {type(shape).__name__}; {_REMEDY}"
        )
    if placement is not None:
        check_type(f"{label}: placement", placement, Placement, "or None for none")


def curvature_of(name: str, radius_mm: float) -> float:
    """1/R of a radius in mm; `inf` gives 0. Raises InvalidInputError for 0 and NaN."""
    radius = check_number(name, radius_mm)
    if math.isnan(radius) or radius == 0:
        raise InvalidInputError(f"{name} must be a non-zero number (inf is a plane), got {radius}")
    return 0.0 if math.isinf(radius) else 1.0 / radius
