"""An eye at one wavelength, flattened to the list of elements a ray meets.

Both tracers, the float64 one on the host and the OpenCL one, work from this list.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from isetcl.eye.gradient import GradientMedium
from isetcl.eye.gradient_path import PlacedGradient
from isetcl.eye.placement import Placement
from isetcl.eye.quadric import Quadric
from isetcl.eye.shapes.shape import SurfaceShape
from isetcl.eye.surface import Surface, form_quadric, form_sag

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
    inside if x^2 + (y / aspect)^2 <= semi_diameter^2 in the element's own frame. Where a medium has
    a gradient, `gradient_before` or `gradient_after` is it, and the index is that at the vertex.
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
    gradient_before: PlacedGradient | None = None
    gradient_after: PlacedGradient | None = None

    @property
    def is_bending(self) -> bool:
        """Whether it changes directions: a surface with one index on both sides does not."""
        return self.kind is ElementKind.REFRACT and (
            self.gradient_before is not None
            or self.gradient_after is not None
            or self.n_before != self.n_after
        )

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
    gradients = placed_gradients(eye, wavelength_nm)
    sequence = []
    for i, surface in enumerate(eye.surfaces):
        before, n_before = gradients[i], float(index[i])
        if before is not None:
            vertex = np.array([[0.0, 0.0, surface.vertex_z_mm]])
            if surface.placement is not None:
                vertex[0, :2] = surface.placement.decentre_mm
            n_before = float(before.index_at(vertex)[0])
        sequence.append(
            Element(
                ElementKind.REFRACT,
                surface.name,
                surface.vertex_z_mm,
                surface.curvature,
                surface.conic,
                surface.semi_diameter_mm,
                n_before,
                float(index[i + 1]),
                surface.shape,
                surface.placement,
                gradient_before=before,
                gradient_after=gradients[i + 1],
            )
        )
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


def placed_gradients(eye: Eye, wavelength_nm: float) -> list[PlacedGradient | None]:
    """The gradient of every medium of `Eye.media` at a wavelength in nm; None if homogeneous."""
    found: list[PlacedGradient | None] = [None] * (len(eye.surfaces) + 1)
    for i, (front, back) in enumerate(zip(eye.surfaces, eye.surfaces[1:], strict=False)):
        medium = front.medium_after
        if isinstance(medium, GradientMedium):
            found[i + 1] = PlacedGradient(
                medium.gradient(wavelength_nm),
                front.vertex_z_mm,
                front.placement,
                _chords(front, back),
            )
    return found


_CHORDS = (0.0, 0.25, 0.5, 0.75, 1.0)


def _chords(front: Surface, back: Surface) -> tuple[tuple[float, float, float], ...]:
    """(r, z in front, z behind) of lines through a lens in its front surface's frame, mm.

    The outermost lies on the rim. Decentration and tilt of one surface against the other are left
    out.
    """
    rim = max(front.semi_diameter_mm, back.semi_diameter_mm)
    apart = back.vertex_z_mm - front.vertex_z_mm
    chords = []
    for part in _CHORDS:
        r = part * rim
        start, end = (
            float(form_sag(s.curvature, s.conic, s.shape, min(r, s.semi_diameter_mm), 0.0))
            for s in (front, back)
        )
        chords.append((r, start, apart + end))
    return tuple(chords)


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
