"""Intraocular lenses in place of the natural one: a change of an eye."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_between,
    check_pair,
    check_positive,
    check_type,
)
from isetcl.eye.media import ConstantIndex, Medium
from isetcl.eye.model import Eye
from isetcl.eye.placement import Placement
from isetcl.eye.worn.surfaces import (
    POWER_WAVELENGTH_NM,
    lens_surface,
    radius_of_curvature,
)
from isetcl.units import MM_PER_M

ACRYLIC = Medium("acrylic", ConstantIndex(1.47))
"""A foldable acrylic intraocular lens; 1.46 to 1.55 by maker: state that of your lens."""


@dataclass(frozen=True)
class IntraocularLens:
    """A lens in place of the natural one. The eye then no longer accommodates.

    Parameters
    ----------
    power_dpt
        Power in the eye, between its aqueous and its vitreous.
    front_z_mm
        Place of its front vertex behind the cornea, mm; None puts its middle where that of the
        natural lens was.
    centre_thickness_mm
        Thickness, mm.
    shape_factor
        Coddington's (c1 + c2) / (c1 - c2): 0 is equiconvex, +1 has a flat back.
    conics
        Conic constants of front and back.
    medium
        What it is made of.
    diameter_mm
        Of the optic, mm.
    decentre_mm, tilt_deg
        As in `Placement`, of both surfaces, about the front vertex.
    """

    power_dpt: float
    front_z_mm: float | None = None
    centre_thickness_mm: float = 0.8
    shape_factor: float = 0.0
    conics: tuple[float, float] = (0.0, 0.0)
    medium: Medium = ACRYLIC
    diameter_mm: float = 6.0
    decentre_mm: tuple[float, float] = (0.0, 0.0)
    tilt_deg: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        check_between("intraocular lens: power_dpt", self.power_dpt, -20.0, 60.0, "dpt")
        if self.front_z_mm is not None:
            check_positive("intraocular lens: front_z_mm", self.front_z_mm, "mm")
        for name in ("centre_thickness_mm", "diameter_mm"):
            check_positive(f"intraocular lens: {name}", getattr(self, name), "mm")
        check_between("intraocular lens: shape_factor", self.shape_factor, -10.0, 10.0)
        check_pair("intraocular lens: conics", self.conics)
        check_type("intraocular lens: medium", self.medium, Medium)
        Placement(self.decentre_mm, self.tilt_deg)

    def apply(self, eye: Eye) -> Eye:
        """The eye with this lens instead of its own."""
        first = _lens_index(eye)
        natural = eye.surfaces[first:]
        aqueous = eye.media()[first]
        vitreous = natural[-1].medium_after
        middle = (natural[0].vertex_z_mm + natural[-1].vertex_z_mm) / 2.0
        front_z = self.front_z_mm
        if front_z is None:
            front_z = middle - self.centre_thickness_mm / 2.0
        curvatures = self._curvatures(aqueous, vitreous)
        turn = Placement(self.decentre_mm, self.tilt_deg).rotation
        front_mm = np.array([*self.decentre_mm, front_z])
        places = (front_mm, front_mm + turn @ np.array([0.0, 0.0, self.centre_thickness_mm]))
        media = (self.medium, vitreous)
        names = ("intraocular lens front", "intraocular lens back")
        lens = tuple(
            lens_surface(
                names[i],
                places[i],
                turn,
                (radius_of_curvature(curvatures[i]),) * 2,
                0.0,
                self.diameter_mm / 2.0,
                media[i],
                self.conics[i],
            )
            for i in range(2)
        )
        return dataclasses.replace(
            eye,
            surfaces=(*eye.surfaces[:first], *lens),
            accommodation_model=None,
            accommodation_parameter=None,
        )

    def _curvatures(self, aqueous: Medium, vitreous: Medium) -> tuple[float, float]:
        """Curvatures of front and back, 1/mm, that have the power and the shape factor."""
        n, before, after = (
            float(m.index(POWER_WAVELENGTH_NM)) for m in (self.medium, aqueous, vitreous)
        )
        # c1 = s (1 + q), c2 = -s (1 - q);  P = P1 + P2 - (t / n) P1 P2 is a quadratic in s.
        first = (n - before) * (1.0 + self.shape_factor)
        second = (n - after) * (1.0 - self.shape_factor)
        wanted = self.power_dpt / MM_PER_M
        quadratic = -self.centre_thickness_mm / n * first * second
        linear = first + second
        root = linear**2 + 4.0 * quadratic * wanted
        if root < 0 or linear == 0:
            raise InvalidInputError(
                f"intraocular lens: no lens of shape factor {self.shape_factor:g} and "
                f"{self.centre_thickness_mm:g} mm has power_dpt {self.power_dpt:g}; make it thinner"
            )
        scale = 2.0 * wanted / (linear + math.copysign(math.sqrt(root), linear))
        return scale * (1.0 + self.shape_factor), -scale * (1.0 - self.shape_factor)


def _lens_index(eye: Eye) -> int:
    """Index of the first surface of the natural lens."""
    for i, surface in enumerate(eye.surfaces):
        if surface.name.lower().startswith(("lens", "intraocular lens")):
            return i
    if eye.stop_index == len(eye.surfaces):
        raise InvalidInputError(
            f"eye {eye.name!r} has no surface behind its stop and none named 'lens', so it has no "
            "lens to replace"
        )
    return eye.stop_index
