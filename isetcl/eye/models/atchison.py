"""Atchison's 2006 eyes (Model 1), rotationally symmetric but for the retina, by refraction."""

from __future__ import annotations

from isetcl.errors import check_between
from isetcl.eye.gradient import PolynomialGradient, PolynomialMedium
from isetcl.eye.model import Eye, PupilPlane
from isetcl.eye.models.liou_brennan import gradient_lens
from isetcl.eye.models.parts import Face, PupilSpec, cornea_surfaces, dispersion, medium
from isetcl.eye.retina import Retina
from isetcl.eye.stop import Stop

INDEX_NM = 555.0
"""Wavelength of the published indices, nm."""

# Rows are powers of z from the front of each half, columns powers of r^2; mm, 555 nm.
FRONT_GRADIENT = PolynomialGradient(((1.371, -0.0020399), (0.0652778,), (-0.0226659,)))
REAR_GRADIENT = PolynomialGradient(((1.418, -0.0020399), (0.0,), (-0.0100737,)))
FRONT_MM, REAR_MM = 1.44, 2.16

MOST_MYOPIC_DPT = -10.0


def atchison(
    pupil_diameter_mm: float = 4.0,
    spectacle_refraction_dpt: float = 0.0,
    *,
    pupil_plane: PupilPlane = "stop",
    abbe_number: float | None = None,
    is_retina_round: bool = False,
) -> Eye:
    """Atchison's Model 1: a gradient-index eye whose shape follows its spectacle refraction.

    With myopia the cornea becomes steeper, the vitreous longer, and the retina, an ellipsoid of
    three different axes, larger.

    Parameters
    ----------
    pupil_diameter_mm, pupil_plane
        As in `navarro`.
    spectacle_refraction_dpt
        Refraction, dpt, -10 to 0.
    abbe_number
        None: the indices do not depend on the wavelength (555 nm). A number (ocular media lie near
        50) gives every medium that dispersion about its published index.
    is_retina_round
        True makes the retina's horizontal and vertical axes equal, their mean, so that the whole
        eye is a body of revolution.

    Warnings
    --------
    UNVERIFIED: the coefficients of the gradient were not compared with a print. They are continuous
    at the equator of the lens and make the eye of 0 dpt emmetropic to 0.03 dpt.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule.

    References
    ----------
    Atchison 2006, Vision Res 46:2236; semi-axes of the retina as in the public program gkaModelEye.
    """
    refraction = check_between(
        "spectacle_refraction_dpt", spectacle_refraction_dpt, MOST_MYOPIC_DPT, 0.0, "dpt"
    )
    front_z = 0.55 + 3.15
    back_z = front_z + FRONT_MM + REAR_MM
    cornea = cornea_surfaces(
        0.55,
        (Face(7.77 + 0.022 * refraction, -0.15), Face(6.40, -0.275)),
        (
            medium("cornea", 1.376, abbe_number, INDEX_NM),
            medium("aqueous", 1.3374, abbe_number, INDEX_NM),
        ),
    )
    lens = gradient_lens(
        front_z,
        (FRONT_MM, REAR_MM),
        (Face(11.48, -5.0), Face(-5.90, -2.0)),
        (
            PolynomialMedium(
                "lens front half", dispersion(1.371, abbe_number, INDEX_NM), FRONT_GRADIENT
            ),
            PolynomialMedium(
                "lens rear half", dispersion(1.418, abbe_number, INDEX_NM), REAR_GRADIENT
            ),
            medium("vitreous", 1.336, abbe_number, INDEX_NM),
        ),
    )
    eye = Eye(
        name="atchison",
        surfaces=(*cornea, *lens),
        stop=Stop(front_z, pupil_diameter_mm),
        retina=_retina(back_z + 16.28 - 0.299 * refraction, refraction, is_retina_round),
    )
    return PupilSpec(pupil_diameter_mm, pupil_plane).apply(eye)


def _retina(vertex_z_mm: float, refraction: float, is_round: bool) -> Retina:
    horizontal, vertical = 11.455 - 0.043 * refraction, 11.365 - 0.090 * refraction
    if is_round:
        horizontal = vertical = (horizontal + vertical) / 2.0
    return Retina.ellipsoid(vertex_z_mm, (horizontal, vertical, 10.148 - 0.163 * refraction))
