"""The wide-angle eye of Navarro: Escudero-Sanz & Navarro 1999, as in the paper's table 1.

Accommodation and dispersion follow Navarro, Santamaria & Bescos 1985, J Opt Soc Am A 2:1273.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from isetcl.errors import check_between, check_choice, check_type
from isetcl.eye.media import Medium, NavarroDispersion
from isetcl.eye.model import Eye
from isetcl.eye.models.parts import Face, PupilSpec, cornea_surfaces, lens_surfaces
from isetcl.eye.retina import Retina
from isetcl.eye.stop import Stop

Hold = Literal["vitreous_depth", "axial_length"]

# Navarro et al. 1985, table 2: indices at 365, 486.1, 656.3 and 1014 nm.
CORNEA = Medium("cornea", NavarroDispersion(1.3975, 1.3807, 1.37405, 1.3668))
AQUEOUS = Medium("aqueous", NavarroDispersion(1.3593, 1.3422, 1.3354, 1.3278))
LENS = NavarroDispersion(1.4492, 1.42625, 1.4175, 1.4097)
VITREOUS = Medium("vitreous", NavarroDispersion(1.3565, 1.3407, 1.3341, 1.3273))


@dataclass(frozen=True)
class NavarroModel:
    """Navarro's eye as a function of his accommodation parameter A (not dioptres in focus).

    Parameters
    ----------
    pupil
        Diameter and plane of the pupil.
    hold
        ``"vitreous_depth"`` keeps the 16.3203 mm between lens and retina, as the paper's tables and
        ISET3d do (the eye grows by 0.05 ln(A + 1) mm); ``"axial_length"`` keeps 23.9203 mm.
    """

    pupil: PupilSpec
    hold: Hold = "vitreous_depth"

    def __post_init__(self) -> None:
        check_type("pupil", self.pupil, PupilSpec)
        check_choice("hold", self.hold, ("vitreous_depth", "axial_length"))

    @property
    def parameter_range(self) -> tuple[float, float]:
        """A from 0 to 10, the range of the 1985 paper."""
        return (0.0, 10.0)

    def eye(self, parameter: float) -> Eye:
        """The eye at Navarro's parameter A (Navarro 1985, table 4)."""
        a = check_between("Navarro's accommodation parameter A", parameter, *self.parameter_range)
        growth = math.log(a + 1.0)
        lens_front_z = 0.55 + 3.05 - 0.05 * growth
        thickness = 4.0 + 0.1 * growth
        lens = Medium("lens", LENS.shifted(9e-5 * (10.0 * a + a * a)))
        cornea_faces = (Face(7.72, -0.26), Face(6.5))
        lens_faces = (
            Face(10.2 - 1.75 * growth, -3.1316 - 0.34 * growth),
            Face(-6.0 + 0.2294 * growth, -1.0 - 0.125 * growth),
        )
        lens_back_z = lens_front_z + thickness
        retina_z = lens_back_z + 16.3203 if self.hold == "vitreous_depth" else 23.9203
        eye = Eye(
            name="navarro",
            surfaces=(
                *cornea_surfaces(0.55, cornea_faces, (CORNEA, AQUEOUS)),
                *lens_surfaces(lens_front_z, thickness, lens_faces, (lens, VITREOUS)),
            ),
            stop=Stop(lens_front_z, self.pupil.diameter_mm),
            retina=Retina.from_radius(retina_z, -12.0),
            accommodation_model=self,
            accommodation_parameter=a,
        )
        return self.pupil.apply(eye)
