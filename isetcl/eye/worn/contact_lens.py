"""Contact lenses: a change of an eye."""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass
from typing import Literal

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_choice,
    check_finite,
    check_positive,
    check_type,
)
from isetcl.eye.media import ConstantIndex, Medium
from isetcl.eye.model import Eye, smallest_gap_mm
from isetcl.eye.surface import Surface
from isetcl.eye.worn.surfaces import (
    POWER_WAVELENGTH_NM,
    check_prescription,
    lens_surface,
    radius_mm_of,
    radius_of_curvature,
)
from isetcl.units import MM_PER_M

HYDROGEL = Medium("hydrogel", ConstantIndex(1.42))
"""A soft contact lens. Its index falls with its water, 1.38 to 1.44: state that of your lens."""

TEAR = Medium("tear film", ConstantIndex(1.336))
"""Tears: Gullstrand's index of aqueous and vitreous, customary in contact lens optics."""

ContactLensFit = Literal["soft", "rigid"]


@dataclass(frozen=True)
class ContactLens:
    """A lens on the cornea.

    A soft lens drapes: its back takes the shape of the cornea, which it touches. A rigid lens keeps
    its own back, and tears fill the gap.

    Parameters
    ----------
    sphere_dpt, cylinder_dpt, axis_deg
        The prescription of the contact lens itself, as a back vertex power in air.
    fit
        ``"soft"`` or ``"rigid"``.
    centre_thickness_mm
        Of the lens, mm.
    medium
        What it is made of.
    base_curve_mm
        Radius of the spherical back of a rigid lens, mm; None takes the cornea's radius and conic
        constant. A soft lens has none.
    tear_thickness_mm
        Of the tears behind a rigid lens on the axis, mm.
    front_conic
        Conic constant of the front.
    diameter_mm
        Of the optical zone, mm; smaller where the lens would touch the cornea or come to an edge.
    """

    sphere_dpt: float
    cylinder_dpt: float = 0.0
    axis_deg: float = 0.0
    fit: ContactLensFit = "soft"
    centre_thickness_mm: float = 0.1
    medium: Medium = HYDROGEL
    base_curve_mm: float | None = None
    tear_thickness_mm: float = 0.02
    front_conic: float = 0.0
    diameter_mm: float = 9.0

    def __post_init__(self) -> None:
        check_prescription("contact lens", self.sphere_dpt, self.cylinder_dpt, self.axis_deg)
        check_choice("contact lens: fit", self.fit, ("soft", "rigid"))
        for name in ("centre_thickness_mm", "tear_thickness_mm", "diameter_mm"):
            check_positive(f"contact lens: {name}", getattr(self, name), "mm")
        check_type("contact lens: medium", self.medium, Medium)
        check_finite("contact lens: front_conic", self.front_conic)
        if self.base_curve_mm is not None:
            check_positive("contact lens: base_curve_mm", self.base_curve_mm, "mm")
            if self.fit == "soft":
                raise InvalidInputError(
                    "contact lens: base_curve_mm must be None for a soft lens, which takes the "
                    f"shape of the cornea, got {self.base_curve_mm:g} mm; use fit='rigid'"
                )

    def apply(self, eye: Eye) -> Eye:
        """The eye with this lens on its cornea."""
        cornea = eye.surfaces[0]
        if cornea.vertex_z_mm != 0.0:
            raise InvalidInputError(
                f"eye {eye.name!r} has {cornea.name!r} in front of its cornea; put the contact "
                "lens on first"
            )
        index = float(self.medium.index(POWER_WAVELENGTH_NM))
        bend_x, _, bend_y = cornea.vertex_curvatures()
        back_curvature, back_conic = (bend_x + bend_y) / 2.0, cornea.conic
        if self.base_curve_mm is not None:
            back_curvature, back_conic = 1.0 / self.base_curve_mm, 0.0
        back_power = (1.0 - index) * back_curvature * MM_PER_M
        reduced = self.centre_thickness_mm / MM_PER_M / index
        radii = []
        for wanted in (self.sphere_dpt, self.sphere_dpt + self.cylinder_dpt):
            leaving = wanted - back_power
            radii.append(radius_mm_of(index - 1.0, leaving / (1.0 + reduced * leaving)))
        axis = (180.0 - self.axis_deg) if self.cylinder_dpt != 0.0 else 0.0
        behind = 0.0 if self.fit == "soft" else self.tear_thickness_mm
        half = self.diameter_mm / 2.0
        front = lens_surface(
            "contact lens front",
            np.array([0.0, 0.0, -behind - self.centre_thickness_mm]),
            np.eye(3),
            (radii[0], radii[1]),
            axis,
            half,
            self.medium,
            self.front_conic,
        )
        worn: tuple[Surface, ...] = (front,)
        if self.fit == "rigid":
            place = np.array([0.0, 0.0, -behind])
            radius = radius_of_curvature(back_curvature)
            back = lens_surface(
                "contact lens back",
                place,
                np.eye(3),
                (radius, radius),
                0.0,
                half,
                TEAR,
                back_conic,
            )
            worn = (front, back)
        return dataclasses.replace(eye, surfaces=(*_trimmed(worn, cornea), *eye.surfaces))


def _trimmed(worn: tuple[Surface, ...], behind: Surface) -> tuple[Surface, ...]:
    """Surfaces with their semi-diameters cut to where none lies behind the next one."""
    stack = (*worn, behind)
    rho = np.linspace(0.0, min(s.semi_diameter_mm for s in stack), 257)
    open_to = rho[-1]
    for one, other in itertools.pairwise(stack):
        closed = smallest_gap_mm(one, other, rho) < 0
        if closed.any():
            open_to = min(open_to, rho[max(int(np.argmax(closed)) - 1, 1)])
    return tuple(
        dataclasses.replace(s, semi_diameter_mm=min(s.semi_diameter_mm, float(open_to)))
        for s in worn
    )
