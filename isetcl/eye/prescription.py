"""An eye at one wavelength, flattened to the list of elements a ray meets.

Both tracers, the float64 one on the host and the OpenCL one, work from this list.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from isetcl.eye.placement import Placement
from isetcl.eye.quadric import Quadric
from isetcl.eye.shapes.shape import SurfaceShape
from isetcl.eye.surface import form_quadric

if TYPE_CHECKING:
    from isetcl.eye.model import Eye


class ElementKind(IntEnum):
    """What an element does to a ray. The same numbers are compiled into the kernels."""

    REFRACT = 0
    STOP = 1
    RETINA = 2


@dataclass(frozen=True)
class Element:
    """One element in the order light meets it, with the indices on both sides at one wavelength.

    `n_before` is on the scene side and `n_after` on the retinal side; they are equal at the stop
    and at the retina. Lengths in mm, eye frame. `shape` and `placement` as in `Surface`. A ray is
    inside if x^2 + (y / aspect)^2 <= semi_diameter^2 in the element's own frame.
    """

    kind: ElementKind
    name: str
    vertex_z_mm: float
    curvature: float
    conic: float
    semi_diameter_mm: float
    n_before: float
    n_after: float
    shape: SurfaceShape | None = None
    placement: Placement | None = None
    aspect: float = 1.0

    @property
    def quadric(self) -> Quadric:
        """The surface, or the quadric from which rays are searched on it."""
        return form_quadric(self.curvature, self.conic, self.shape)

    @property
    def origin_mm(self) -> np.ndarray:
        """The vertex in the eye frame, mm, (3,)."""
        x, y = (0.0, 0.0) if self.placement is None else self.placement.decentre_mm
        return np.array([x, y, self.vertex_z_mm])

    def enter(self, position: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rays of the eye frame in the element's own, both (n, 3)."""
        local = position - self.origin_mm
        if self.placement is None:
            return local, direction
        return local @ self.placement.rotation, direction @ self.placement.rotation

    def leave(self, position: np.ndarray, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points and vectors of the element's own frame in the eye frame, both (n, 3)."""
        if self.placement is None:
            return position + self.origin_mm, vector
        turned = self.placement.rotation.T
        return position @ turned + self.origin_mm, vector @ turned


def elements(eye: Eye, wavelength_nm: float) -> tuple[Element, ...]:
    """The elements of an eye at one wavelength in nm: surfaces and stop in order, retina last.

    Raises
    ------
    InvalidInputError
        If the wavelength lies outside the range of a medium.
    """
    index = eye.indices(wavelength_nm)
    sequence = [
        Element(
            ElementKind.REFRACT,
            surface.name,
            surface.vertex_z_mm,
            surface.curvature,
            surface.conic,
            surface.semi_diameter_mm,
            float(index[i]),
            float(index[i + 1]),
            surface.shape,
            surface.placement,
        )
        for i, surface in enumerate(eye.surfaces)
    ]
    sequence.insert(eye.stop_index, _stop(eye, float(index[eye.stop_index])))
    n_vitreous = float(index[-1])
    retina = eye.retina
    sequence.append(
        Element(
            ElementKind.RETINA,
            "retina",
            retina.vertex_z_mm,
            retina.curvature,
            retina.conic,
            float("inf"),
            n_vitreous,
            n_vitreous,
            retina.shape,
            retina.placement,
        )
    )
    return tuple(sequence)


def _stop(eye: Eye, index: float) -> Element:
    stop = eye.stop
    placement = None
    if not stop.is_rotational:
        placement = Placement(stop.decentre_mm, axis_deg=stop.axis_deg)
    return Element(
        ElementKind.STOP,
        "stop",
        stop.z_mm,
        0.0,
        0.0,
        stop.radius_mm,
        index,
        index,
        None,
        placement,
        stop.aspect,
    )
