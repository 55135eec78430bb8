"""The eye of Liou & Brennan 1997: a lens whose index varies as in anatomical measurements."""

from __future__ import annotations

import dataclasses

from isetcl.eye.gradient import PolynomialGradient, PolynomialMedium
from isetcl.eye.media import Medium, PowerDispersion
from isetcl.eye.model import Eye, PupilPlane
from isetcl.eye.models.parts import (
    LENS_SEMI_DIAMETER_MM,
    Face,
    PupilSpec,
    cornea_surfaces,
    lens_semi_diameter_mm,
)
from isetcl.eye.retina import Retina
from isetcl.eye.stop import Stop
from isetcl.eye.surface import Surface

# n = n_555 + 0.0512 - 0.1455 l + 0.0961 l^2, l in um, of every medium.
_OFFSET, _PER_NM, _PER_NM2 = 0.0512, -0.1455e-3, 0.0961e-6

# Rows are powers of z from the front of each half, columns powers of r^2; mm, 555 nm.
FRONT_GRADIENT = PolynomialGradient(((1.368, -0.001978), (0.049057,), (-0.015427,)))
REAR_GRADIENT = PolynomialGradient(((1.407, -0.001978), (0.0,), (-0.006605,)))

FRONT_MM, REAR_MM = 1.59, 2.43
"""Thickness of the two halves of the lens."""

NASAL_PUPIL_MM = (-0.5, 0.0)
NASAL_FOVEA_DEG = (-5.0, 0.0)


def liou_brennan(
    pupil_diameter_mm: float = 4.0, *, pupil_plane: PupilPlane = "stop", is_decentred: bool = False
) -> Eye:
    """The eye of Liou & Brennan, with a gradient-index lens of two halves.

    Parameters
    ----------
    pupil_diameter_mm, pupil_plane
        As in `navarro`.
    is_decentred
        True puts the pupil 0.5 mm nasally, and the direction of the fovea 5 deg nasally, as the
        paper does, for a right eye; False leaves both on the axis.

    Warnings
    --------
    UNVERIFIED: the dispersion (n_555 + 0.0512 - 0.1455 l + 0.0961 l^2 of every medium, l in um),
    the 5 deg of the fovea and the radius of the retina, -12 mm, are from no print. The dispersion
    gives 1.0 dpt of chromatic aberration from 400 to 700 nm, half of what eyes have.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule.

    References
    ----------
    Liou & Brennan 1997, J Opt Soc Am A 14:1684. Power 60.35 dpt, axial length 23.95 mm.
    """
    front_z = 0.50 + 3.16
    back_z = front_z + FRONT_MM + REAR_MM
    cornea = cornea_surfaces(
        0.50,
        (Face(7.77, -0.18), Face(6.40, -0.60)),
        (_medium("cornea", 1.376), _medium("aqueous", 1.336)),
    )
    lens = gradient_lens(
        front_z,
        (FRONT_MM, REAR_MM),
        (Face(12.40, -0.94), Face(-8.10, 0.96)),
        (
            PolynomialMedium("lens front half", _dispersion(1.368), FRONT_GRADIENT),
            PolynomialMedium("lens rear half", _dispersion(1.407), REAR_GRADIENT),
            _medium("vitreous", 1.336),
        ),
    )
    eye = Eye(
        name="liou_brennan",
        surfaces=(*cornea, *lens),
        stop=Stop(front_z, pupil_diameter_mm),
        retina=Retina.from_radius(back_z + 16.27, -12.0),
    )
    if is_decentred:
        stop = dataclasses.replace(eye.stop, decentre_mm=NASAL_PUPIL_MM)
        eye = dataclasses.replace(eye, stop=stop, fovea_deg=NASAL_FOVEA_DEG)
    return PupilSpec(pupil_diameter_mm, pupil_plane).apply(eye)


def gradient_lens(
    front_z_mm: float,
    thicknesses_mm: tuple[float, float],
    faces: tuple[Face, Face],
    media: tuple[Medium, Medium, Medium],
    semi_diameter_mm: float = LENS_SEMI_DIAMETER_MM,
) -> tuple[Surface, Surface, Surface]:
    """Front, equator (a plane) and back of a lens of two gradients.

    The faces end where they would meet the equator, at most at `semi_diameter_mm`; media: front
    half, rear half, vitreous.
    """
    plane = Face(float("inf"))
    semi = min(
        semi_diameter_mm,
        lens_semi_diameter_mm(faces[0], plane, thicknesses_mm[0]),
        lens_semi_diameter_mm(plane, faces[1], thicknesses_mm[1]),
    )
    front, middle, back = (
        Surface.from_radius(
            name,
            front_z_mm + sum(thicknesses_mm[:i]),
            face.radius_mm,
            conic=face.conic,
            semi_diameter_mm=semi,
            medium_after=media[i],
        )
        for i, (name, face) in enumerate(
            zip(
                ("lens front", "lens equator", "lens back"),
                (faces[0], plane, faces[1]),
                strict=True,
            )
        )
    )
    return front, middle, back


def _dispersion(n_555: float) -> PowerDispersion:
    return PowerDispersion((n_555 + _OFFSET, _PER_NM, _PER_NM2), (0, 1, 2))


def _medium(name: str, n_555: float) -> Medium:
    return Medium(name, _dispersion(n_555))
