"""Eyes of few surfaces: the chromatic reduced eye of Thibos, the wide-field eye of Drasdo & Fowler.

A reduced eye has one refracting surface and one ocular medium.
"""

from __future__ import annotations

from isetcl.eye.media import CornuDispersion, Medium
from isetcl.eye.model import Eye, PupilPlane
from isetcl.eye.models.parts import (
    CORNEA_SEMI_DIAMETERS_MM,
    Face,
    PupilSpec,
    lens_surfaces,
    medium,
)
from isetcl.eye.retina import Retina
from isetcl.eye.stop import Stop
from isetcl.eye.surface import Surface

CHROMATIC_MEDIUM = Medium("ocular medium", CornuDispersion(1.320535, 4.685, 214.102))
"""n = 1.320535 + 4.685 / (l - 214.102), l in nm (Thibos et al. 1992, Appl Opt 31:3594)."""

CHROMATIC_RADIUS_MM = 5.55
CHROMATIC_SHAPE = 0.437
"""p = 1 + k of the refracting surface."""
CHROMATIC_FOCUS_NM = 589.99
"""Wavelength, nm, at which the published refraction is zero."""


def thibos(pupil_diameter_mm: float = 4.0, *, pupil_plane: PupilPlane = "stop") -> Eye:
    """The chromatic reduced eye ("Indiana eye"): one ellipsoid, one chromatic medium.

    It was made for chromatic aberration: its refraction follows Rx = 1.68524 - 633.46 / (l -
    214.102) dpt, l in nm. The pupil lies 1.91 mm behind the apex.

    Parameters
    ----------
    pupil_diameter_mm, pupil_plane
        As in `navarro`.

    Warnings
    --------
    UNVERIFIED: the radius of 5.55 mm is from no print. The published refraction divided by the
    published index, (n_D - n) / (R n_D), asks for 5.548 mm. The retina, at the paraxial focus for
    589.99 nm and of radius -12 mm, is an assumption.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule.

    References
    ----------
    Thibos, Ye, Zhang & Bradley 1992, Appl Opt 31:3594; shape p = 0.437: Thibos, Ye, Zhang & Bradley
    1997, Optom Vis Sci 74:548 (the Indiana eye).
    """
    index = float(CHROMATIC_MEDIUM.index(CHROMATIC_FOCUS_NM))
    apex = Surface.from_radius(
        "cornea",
        0.0,
        CHROMATIC_RADIUS_MM,
        conic=CHROMATIC_SHAPE - 1.0,
        semi_diameter_mm=CORNEA_SEMI_DIAMETERS_MM[1],
        medium_after=CHROMATIC_MEDIUM,
    )
    eye = Eye(
        name="thibos",
        surfaces=(apex,),
        stop=Stop(1.91, pupil_diameter_mm),
        retina=Retina.from_radius(index * CHROMATIC_RADIUS_MM / (index - 1.0), -12.0),
    )
    return PupilSpec(pupil_diameter_mm, pupil_plane).apply(eye)


def drasdo_fowler(
    pupil_diameter_mm: float = 4.0,
    *,
    pupil_plane: PupilPlane = "stop",
    abbe_number: float | None = None,
) -> Eye:
    """The wide-field eye of Drasdo & Fowler, made to map the visual field onto the retina.

    An ellipsoidal cornea, a lens of two spheres, a spherical retina. By these numbers it is
    hyperopic by 0.62 dpt (paraxial).

    Parameters
    ----------
    pupil_diameter_mm, pupil_plane
        As in `navarro`.
    abbe_number
        As in `bennett_rabbetts`.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule.

    References
    ----------
    Drasdo & Fowler 1974, Br J Ophthalmol 58:709; numbers as in the public program gkaModelEye.
    """
    cornea = Surface.from_radius(
        "cornea",
        0.0,
        7.8,
        conic=-0.5,
        semi_diameter_mm=CORNEA_SEMI_DIAMETERS_MM[0],
        medium_after=medium("aqueous", 1.336, abbe_number),
    )
    lens = lens_surfaces(
        3.6,
        7.375 - 3.6,
        (Face(10.0), Face(-6.0)),
        (medium("lens", 1.430, abbe_number), medium("vitreous", 1.336, abbe_number)),
    )
    eye = Eye(
        name="drasdo_fowler",
        surfaces=(cornea, *lens),
        stop=Stop(3.6, pupil_diameter_mm),
        retina=Retina.from_radius(23.01, -11.06),
    )
    return PupilSpec(pupil_diameter_mm, pupil_plane).apply(eye)
