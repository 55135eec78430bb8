"""An eye at one wavelength, flattened to the list of elements a ray meets.

Both tracers, the float64 one on the host and the OpenCL one, work from this list.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

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
    and at the retina. Lengths in mm, eye frame.
    """

    kind: ElementKind
    name: str
    vertex_z_mm: float
    curvature: float
    conic: float
    semi_diameter_mm: float
    n_before: float
    n_after: float


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
        )
        for i, surface in enumerate(eye.surfaces)
    ]
    n_stop = float(index[eye.stop_index])
    stop = Element(
        ElementKind.STOP, "stop", eye.stop.z_mm, 0.0, 0.0, eye.stop.radius_mm, n_stop, n_stop
    )
    sequence.insert(eye.stop_index, stop)
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
        )
    )
    return tuple(sequence)
