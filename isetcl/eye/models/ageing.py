"""An eye of any age and accommodation with a gradient-index lens.

Faces, thickness and indices of the lens follow Navarro 2014. What joins them to an eye is a choice
made here: the lens is a core inside ellipsoidal shells of equal index whose index falls with the
square of the distance from the centre, and the curvature of the shells keeps its proportion to that
of the faces. The proportion, about 0.44, is set so that the relaxed eye of every age is emmetropic:
the lens paradox is assumed, not explained.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass

from isetcl.errors import check_between, check_pair, check_type
from isetcl.eye import paraxial
from isetcl.eye.gradient import ShellMedium
from isetcl.eye.media import Medium, PowerDispersion
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye, FocusCriterion, PupilPlane
from isetcl.eye.models.accommodation import accommodated
from isetcl.eye.models.liou_brennan import gradient_lens
from isetcl.eye.models.parts import Face, PupilSpec, cornea_surfaces
from isetcl.eye.retina import Retina
from isetcl.eye.shapes.biconic import Biconic
from isetcl.eye.stop import Stop
from isetcl.eye.surface import Surface

_CAUCHY = (0, -2, -4, -6)

# Cauchy's series, l in nm: Navarro 2014, as in the public program gkaModelEye.
CORNEA = PowerDispersion((1.362994, 6.009687e3, -6.760760e8, 5.908450e13), _CAUCHY)
AQUEOUS = PowerDispersion((1.323031, 6.070796e3, -7.062305e8, 6.147861e13), _CAUCHY)
LENS_EDGE = PowerDispersion((1.356086, 6.428455e3, -6.023738e8, 5.824149e13), _CAUCHY)
VITREOUS = PowerDispersion((1.323757, 5.560240e3, -5.817391e8, 5.036810e13), _CAUCHY)

KERATOMETER_DPT_MM = 337.5
"""A keratometer's power times the radius: (1.3375 - 1) / R."""
MEAN_KERATOMETRY_DPT = (43.868, 43.868)
"""Mean of the meridians 43.399 and 44.337 dpt of gkaModelEye."""
CORNEA_AXIAL_MM = 14.26
"""Axial semi-axis of the ellipsoid of the corneal front (Navarro et al. 2006)."""
CORNEA_BACK_MM = (13.7716, 9.3027)
"""Semi-axes of the corneal back, along and across the axis (gkaModelEye)."""

LENS_CENTRE_MM = 5.2
"""Equator of the lens behind the cornea (gkaModelEye); it stays during accommodation."""
LENS_SEMI_DIAMETER_MM = 4.5
FRONT_SHARE = 0.4
"""Part of the thickness in front of the equator (Navarro 2014)."""

AXIAL_LENGTH_MM = 23.58
RETINA_SEMI_AXES_MM = (11.41, 11.41, 10.148)
"""Atchison's emmetropic retina, the horizontal and vertical axes at their mean."""

AGES = (18.0, 70.0)
MOST_ACCOMMODATED = 10.0


@dataclass(frozen=True)
class AgeingModel:
    """The eye of one age as a function of Navarro's accommodation parameter D.

    One unit of D changes the focus of the whole eye by about 0.7 dpt.

    Parameters
    ----------
    pupil
        Diameter and plane of the pupil.
    age_years
        18 to 70.
    keratometry_dpt
        Powers of the corneal front in the horizontal and the vertical meridian, as a keratometer
        reads them (337.5 / R).
    """

    pupil: PupilSpec
    age_years: float = 30.0
    keratometry_dpt: tuple[float, float] = MEAN_KERATOMETRY_DPT

    def __post_init__(self) -> None:
        check_type("pupil", self.pupil, PupilSpec)
        age = check_between("age_years", self.age_years, *AGES, "years")
        object.__setattr__(self, "age_years", age)
        powers = check_pair("keratometry_dpt", self.keratometry_dpt, "dpt")
        for power in powers:
            check_between("keratometry_dpt", power, 30.0, 60.0, "dpt")
        object.__setattr__(self, "keratometry_dpt", powers)

    @property
    def parameter_range(self) -> tuple[float, float]:
        """D from 0 to 10 at any age; how much an eye of an age can do is not modelled."""
        return (0.0, MOST_ACCOMMODATED)

    def eye(self, parameter: float) -> Eye:
        """The eye at Navarro's parameter D."""
        d = check_between("the ageing eye's parameter D", parameter, *self.parameter_range)
        surfaces = (*_cornea(self.keratometry_dpt), *_lens(self.age_years, d))
        eye = Eye(
            name="ageing",
            surfaces=surfaces,
            stop=Stop(surfaces[2].vertex_z_mm, self.pupil.diameter_mm),
            retina=Retina.ellipsoid(AXIAL_LENGTH_MM, RETINA_SEMI_AXES_MM),
            accommodation_model=self,
            accommodation_parameter=d,
        )
        return self.pupil.apply(eye)


def ageing(
    pupil_diameter_mm: float = 4.0,
    accommodation_dpt: float | None = None,
    *,
    age_years: float = 30.0,
    keratometry_dpt: tuple[float, float] = MEAN_KERATOMETRY_DPT,
    pupil_plane: PupilPlane = "stop",
    focus_wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
    focus_criterion: FocusCriterion = "rms_spot",
    accommodation_parameter: float | None = None,
) -> Eye:
    """An eye of an age, with a gradient-index lens that accommodates.

    Parameters
    ----------
    pupil_diameter_mm, accommodation_dpt, pupil_plane, focus_wavelength_nm, focus_criterion
        As in `navarro`.
    age_years
        18 to 70. With age the lens becomes thicker and rounder and its core less dense.
    keratometry_dpt
        Powers of the corneal front in the horizontal and the vertical meridian (337.5 / R). Two
        different numbers make an astigmatic eye; gkaModelEye has (43.399, 44.337).
    accommodation_parameter
        Navarro's parameter D, 0 to 10, instead of `accommodation_dpt`; about 0.7 dpt each.

    Warnings
    --------
    UNVERIFIED: this is no published eye as a whole. The faces, thickness and indices of the lens
    are Navarro's 2014 as public programs have them; the age term of the core is -7.5e-6 age^2 by
    what is likely meant. The semi-axes of the shells are chosen so that every relaxed eye is
    emmetropic at 550 nm (paraxial), the equator of the lens is Atchison's, and the amplitude of
    accommodation does not fall with age.

    Raises
    ------
    FocusError, InvalidInputError
        As in `navarro`.

    References
    ----------
    Navarro 2014, J Vis 14(13):21; Navarro et al. 2006, J Opt Soc Am A 23:219; gkaModelEye.
    """
    model = AgeingModel(PupilSpec(pupil_diameter_mm, pupil_plane), age_years, keratometry_dpt)
    return accommodated(
        model, accommodation_dpt, accommodation_parameter, focus_wavelength_nm, focus_criterion
    )


def lens_core(age_years: float) -> PowerDispersion:
    """Dispersion of the core of the lens (Navarro 2014)."""
    constant = 1.40965 + 3.55e-4 * age_years - 7.5e-6 * age_years**2
    return PowerDispersion((constant, 6.521218e3, -6.110660e8, 5.908191e13), _CAUCHY)


def lens_geometry(age_years: float, d: float) -> tuple[float, Face, Face]:
    """Thickness in mm, front and back of the lens (Navarro 2014, table 2)."""
    thickness = 2.93 + 0.0236 * age_years + (0.058 - 0.0005 * age_years) * d
    front = Face(1.0 / (1.0 / (12.7 - 0.058 * age_years) + 0.0077 * d), -4.0 - 0.5 * d)
    back = Face(-1.0 / (1.0 / (5.9 - 0.013 * age_years) + 0.0043 * d), -3.0)
    return thickness, front, back


def _cornea(keratometry_dpt: tuple[float, float]) -> tuple[Surface, Surface]:
    in_x, in_y = (power / KERATOMETER_DPT_MM for power in keratometry_dpt)
    along, across = CORNEA_BACK_MM
    # An ellipsoid of axial semi-axis a has (1 + k) c = 1 / a in every meridian.
    faces = (
        Face(1.0 / in_y, 1.0 / (CORNEA_AXIAL_MM * in_y) - 1.0),
        Face(across**2 / along, (across / along) ** 2 - 1.0),
    )
    media = (Medium("cornea", CORNEA), Medium("aqueous", AQUEOUS))
    front, back = cornea_surfaces(0.55, faces, media)
    if in_x != in_y:
        shape = Biconic(in_x, 1.0 / (CORNEA_AXIAL_MM * in_x) - 1.0)
        front = dataclasses.replace(front, shape=shape)
    return front, back


def _lens(age_years: float, d: float, share: float | None = None) -> tuple[Surface, ...]:
    """The lens at D; `share` is the curvature of the shells over that of the faces."""
    share = _emmetropic_share(age_years) if share is None else share
    thickness, front, back = lens_geometry(age_years, d)
    halves = (FRONT_SHARE * thickness, (1.0 - FRONT_SHARE) * thickness)
    # Shells with the faces' own curvature have semi_r^2 = R semi_z in each half; one semi_r for
    # both, with the same power, is t / (1/Rf + 1/Rb).
    bend = 1.0 / front.radius_mm - 1.0 / back.radius_mm
    shells = ShellMedium(
        "lens",
        lens_core(age_years),
        edge=LENS_EDGE,
        centre_z_mm=halves[0],
        semi_z_mm=halves[0],
        semi_r_mm=math.sqrt(thickness / (share * bend)),
        power=1.0,
    )
    before, behind = shells.halves(halves[1], ("lens front half", "lens rear half"))
    return gradient_lens(
        LENS_CENTRE_MM - halves[0],
        halves,
        (front, back),
        (before, behind, Medium("vitreous", VITREOUS)),
        LENS_SEMI_DIAMETER_MM,
    )


@functools.lru_cache(maxsize=256)
def _emmetropic_share(age_years: float) -> float:
    """The share at which the relaxed eye of an age, with a mean cornea, focuses infinity."""
    from scipy.optimize import brentq

    cornea = _cornea(MEAN_KERATOMETRY_DPT)

    def far_point_dpt(share: float) -> float:
        surfaces = (*cornea, *_lens(age_years, 0.0, share))
        eye = Eye(
            "ageing",
            surfaces,
            Stop(surfaces[2].vertex_z_mm, 1.0),
            Retina.ellipsoid(AXIAL_LENGTH_MM, RETINA_SEMI_AXES_MM),
        )
        return paraxial.object_vergence_dpt(eye, REFERENCE_WAVELENGTH_NM)

    return float(brentq(far_point_dpt, 0.3, 0.6, xtol=1e-12))
