"""Le Grand's full theoretical eye: Le Grand & El Hage 1980; paper, table 3. All surfaces spherical.

Dispersion by Cornu's formula with the constants of Atchison & Smith 2005, J Opt Soc Am A 22:29.
"""

from __future__ import annotations

from typing import Literal

from isetcl.errors import check_choice
from isetcl.eye.media import CornuDispersion, Dispersion, Medium
from isetcl.eye.model import Eye
from isetcl.eye.models.parts import Face, PupilSpec, cornea_surfaces, lens_surfaces
from isetcl.eye.retina import Retina
from isetcl.eye.stop import Stop

LeGrandState = Literal["relaxed", "accommodated"]

CORNEA = Medium("cornea", CornuDispersion(1.3610, 7.4147))
AQUEOUS = Medium("aqueous", CornuDispersion(1.3221, 7.0096))
LENS = CornuDispersion(1.3999, 9.2492)
VITREOUS = Medium("vitreous", CornuDispersion(1.3208, 6.9806))
ACCOMMODATED_LENS_RISE = 1.427 - 1.42
"""The accommodated lens has n = 1.427 where the relaxed one has 1.42."""


def legrand_eye(pupil: PupilSpec, state: LeGrandState = "relaxed") -> Eye:
    """Le Grand's eye, relaxed or in his accommodated form (about 7 dpt); nothing in between."""
    check_choice("state", state, ("relaxed", "accommodated"))
    if state == "relaxed":
        aqueous_mm, front_mm, back_mm, thickness_mm, vitreous_mm = 3.05, 10.2, -6.0, 4.0, 16.59655
        lens: Dispersion = LENS
    else:
        aqueous_mm, front_mm, back_mm, thickness_mm, vitreous_mm = 2.65, 6.0, -5.5, 4.5, 16.49655
        lens = CornuDispersion(LENS.n_infinity + ACCOMMODATED_LENS_RISE, LENS.k_nm)
    lens_front_z = 0.55 + aqueous_mm
    eye = Eye(
        name="legrand",
        surfaces=(
            *cornea_surfaces(0.55, (Face(7.8), Face(6.5)), (CORNEA, AQUEOUS)),
            *lens_surfaces(
                lens_front_z,
                thickness_mm,
                (Face(front_mm), Face(back_mm)),
                (Medium("lens", lens), VITREOUS),
            ),
        ),
        stop=Stop(lens_front_z, pupil.diameter_mm),
        retina=Retina.from_radius(lens_front_z + thickness_mm + vitreous_mm, -13.4),
    )
    return pupil.apply(eye)
