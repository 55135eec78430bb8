"""Gullstrand's two schematic eyes: the exact No. 1 and Emsley's simplification of No. 2.

Both are paraxial models: all surfaces are spheres, and one index per medium (sodium light) is all
that is published. An Abbe number can be asked for to give the media a dispersion.
"""

from __future__ import annotations

from typing import Literal

from isetcl.errors import check_choice
from isetcl.eye.media import Medium
from isetcl.eye.model import Eye, PupilPlane
from isetcl.eye.models.parts import (
    CORNEA_SEMI_DIAMETERS_MM,
    Face,
    PupilSpec,
    cornea_surfaces,
    lens_semi_diameter_mm,
    lens_surfaces,
    medium,
)
from isetcl.eye.retina import Retina
from isetcl.eye.stop import Stop
from isetcl.eye.surface import Surface

GullstrandState = Literal["relaxed", "accommodated"]
STATES = ("relaxed", "accommodated")

RETINA_RADIUS_MM = -12.0
"""Radius of the retina, mm, that is assumed where a paraxial model gives none."""


def gullstrand(
    pupil_diameter_mm: float = 4.0,
    *,
    pupil_plane: PupilPlane = "stop",
    state: GullstrandState = "relaxed",
    abbe_number: float | None = None,
) -> Eye:
    """Gullstrand's exact eye (No. 1): a lens core of index 1.406 inside a cortex of 1.386.

    Parameters
    ----------
    pupil_diameter_mm, pupil_plane
        As in `navarro`. Rays must pass the core, which reaches 3.7 mm from the axis (2.2 mm when
        accommodated), so a wide pupil is vignetted.
    state
        ``"relaxed"`` (58.64 dpt) or ``"accommodated"`` (70.57 dpt); the model has nothing between.
    abbe_number
        None: the indices do not depend on the wavelength, as published. A number (ocular media lie
        near 50) gives every medium that dispersion about its published index.

    Warnings
    --------
    UNVERIFIED: the single radii, thicknesses and indices were not compared with a print of
    Gullstrand 1909. Together they reproduce his powers, 58.64 and 70.57 dpt, to 0.02 dpt. The
    axial length of 24.0 mm (a hyperopia of 1 dpt) is UNVERIFIED too, and the radius of the
    retina, -12 mm, is an assumption.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule.

    References
    ----------
    Gullstrand 1909, appendix to Helmholtz, Handbuch der physiologischen Optik, 3rd ed., vol. 1.
    """
    check_choice("state", state, STATES)
    relaxed = state == "relaxed"
    front_z = 3.6 if relaxed else 3.2
    # Radii of the four faces of the lens and the thicknesses of its three layers, mm.
    radii = (10.0, 7.911, -5.76, -6.0) if relaxed else (5.33, 2.655, -2.655, -5.33)
    layers = (0.546, 2.419, 0.635) if relaxed else (0.6725, 2.655, 0.6725)
    cortex = medium("lens cortex", 1.386, abbe_number)
    media = (cortex, medium("lens core", 1.406, abbe_number), cortex)
    cornea_media = (medium("cornea", 1.376, abbe_number), medium("aqueous", 1.336, abbe_number))
    eye = Eye(
        name="gullstrand",
        surfaces=(
            *cornea_surfaces(0.5, (Face(7.7), Face(6.8)), cornea_media),
            *_shells(front_z, radii, layers, (*media, medium("vitreous", 1.336, abbe_number))),
        ),
        stop=Stop(front_z, pupil_diameter_mm),
        retina=Retina.from_radius(24.0, RETINA_RADIUS_MM),
    )
    return PupilSpec(pupil_diameter_mm, pupil_plane).apply(eye)


def _shells(
    front_z: float,
    radii: tuple[float, ...],
    layers: tuple[float, ...],
    media: tuple[Medium, ...],
) -> tuple[Surface, ...]:
    """The four faces of a lens whose core lies inside a cortex."""
    outer = lens_semi_diameter_mm(Face(radii[0]), Face(radii[3]), sum(layers))
    core = lens_semi_diameter_mm(Face(radii[1]), Face(radii[2]), layers[1])
    names = ("lens front", "lens core front", "lens core back", "lens back")
    z = [front_z + sum(layers[:i]) for i in range(4)]
    semi_diameters = (outer, core, core, outer)
    return tuple(
        Surface.from_radius(
            names[i],
            z[i],
            radii[i],
            semi_diameter_mm=semi_diameters[i],
            medium_after=media[i],
        )
        for i in range(4)
    )


def gullstrand_emsley(
    pupil_diameter_mm: float = 4.0,
    *,
    pupil_plane: PupilPlane = "stop",
    state: GullstrandState = "relaxed",
    abbe_number: float | None = None,
) -> Eye:
    """The simplified eye of Gullstrand and Emsley: a cornea of one surface and a uniform lens.

    Parameters
    ----------
    pupil_diameter_mm, pupil_plane, state, abbe_number
        As in `gullstrand`. The accommodated form is focused at 8.6 dpt (paraxial).

    Warnings
    --------
    UNVERIFIED: the single radii and thicknesses were not compared with a print of Emsley 1952.
    Together they reproduce the published nodal and focal points of both states (N, N' and F' at
    7.06, 7.36 and 23.89 mm relaxed; 6.56, 6.91 and 21.25 mm accommodated) to 0.01 mm. The radius
    of the retina, -12 mm, is an assumption.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule.

    References
    ----------
    Emsley 1952, Visual Optics, 5th ed., vol. 1.
    """
    check_choice("state", state, STATES)
    relaxed = state == "relaxed"
    front_z = 3.6 if relaxed else 3.2
    faces = (Face(10.0), Face(-6.0)) if relaxed else (Face(5.0), Face(-5.0))
    aqueous = medium("aqueous", 4.0 / 3.0, abbe_number)
    vitreous = medium("vitreous", 4.0 / 3.0, abbe_number)
    cornea = Surface.from_radius(
        "cornea",
        0.0,
        7.8,
        semi_diameter_mm=CORNEA_SEMI_DIAMETERS_MM[0],
        medium_after=aqueous,
    )
    lens = lens_surfaces(
        front_z,
        3.6 if relaxed else 4.0,
        faces,
        (medium("lens", 1.416, abbe_number), vitreous),
    )
    eye = Eye(
        name="gullstrand_emsley",
        surfaces=(cornea, *lens),
        stop=Stop(front_z, pupil_diameter_mm),
        retina=Retina.from_radius(23.89, RETINA_RADIUS_MM),
    )
    return PupilSpec(pupil_diameter_mm, pupil_plane).apply(eye)
