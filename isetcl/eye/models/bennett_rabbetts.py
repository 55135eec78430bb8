"""The schematic eye of Bennett & Rabbetts, with its five published states of accommodation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isetcl.errors import check_between, check_positive, check_type
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye, FocusCriterion, PupilPlane
from isetcl.eye.models.accommodation import accommodated
from isetcl.eye.models.parts import CORNEA_SEMI_DIAMETERS_MM, Face, PupilSpec, lens_surfaces, medium
from isetcl.eye.retina import Retina
from isetcl.eye.stop import Stop
from isetcl.eye.surface import Surface

STATES = np.array(
    [
        # accommodation, dpt; chamber depth; lens front radius; lens back radius; lens thickness, mm
        [0.0, 3.600, 11.00, -6.47515, 3.700],
        [2.5, 3.475, 8.60, -5.909, 3.825],
        [5.0, 3.370, 7.00, -5.504, 3.930],
        [7.5, 3.280, 6.00, -5.063, 4.020],
        [10.0, 3.210, 5.20, -4.750, 4.090],
    ]
)
"""The published states (Rabbetts 2007, as in the public program visisipy)."""


@dataclass(frozen=True)
class BennettRabbettsModel:
    """The eye of Bennett & Rabbetts as a function of its accommodation in dioptres.

    Between the five published states the curvatures of the lens, its thickness and the depth of the
    anterior chamber follow shape-preserving cubics in the accommodation (PCHIP: once continuously
    differentiable, monotone, exact at the states). Curvatures, because they are nearly straight
    lines where the radii are hyperbolas.

    Parameters
    ----------
    pupil
        Diameter and plane of the pupil.
    abbe_number
        Dispersion given to every medium; None for indices that do not depend on the wavelength.
    """

    pupil: PupilSpec
    abbe_number: float | None = None

    def __post_init__(self) -> None:
        check_type("pupil", self.pupil, PupilSpec)
        if self.abbe_number is not None:
            check_positive("abbe_number", self.abbe_number)

    @property
    def parameter_range(self) -> tuple[float, float]:
        """Accommodation from 0 to 10 dpt, the published states."""
        return (0.0, 10.0)

    def eye(self, parameter: float) -> Eye:
        """The eye at an accommodation in dioptres (paraxial)."""
        what = "the accommodation of Bennett & Rabbetts' eye"
        a = check_between(what, parameter, *self.parameter_range, "dpt")
        depth, front_curvature, back_curvature, thickness = _state(a)
        faces = (Face(1.0 / front_curvature), Face(1.0 / back_curvature))
        vitreous = medium("vitreous", 1.336, self.abbe_number)
        cornea = Surface.from_radius(
            "cornea",
            0.0,
            7.80,
            semi_diameter_mm=CORNEA_SEMI_DIAMETERS_MM[0],
            medium_after=medium("aqueous", 1.336, self.abbe_number),
        )
        lens = lens_surfaces(
            depth, thickness, faces, (medium("lens", 1.422, self.abbe_number), vitreous)
        )
        eye = Eye(
            name="bennett_rabbetts",
            surfaces=(cornea, *lens),
            stop=Stop(depth, self.pupil.diameter_mm),
            retina=Retina.from_radius(depth + thickness + 16.79, -12.0),
            accommodation_model=self,
            accommodation_parameter=a,
        )
        return self.pupil.apply(eye)


def _state(a: float) -> tuple[float, float, float, float]:
    """Chamber depth, curvatures of front and back, thickness of the lens at `a` dpt; mm, 1/mm."""
    from scipy.interpolate import PchipInterpolator

    depth, front, back, thickness = STATES[:, 1:].T
    values = np.stack([depth, 1.0 / front, 1.0 / back, thickness], axis=1)
    at = PchipInterpolator(STATES[:, 0], values)(a)
    return float(at[0]), float(at[1]), float(at[2]), float(at[3])


def bennett_rabbetts(
    pupil_diameter_mm: float = 4.0,
    accommodation_dpt: float | None = None,
    *,
    pupil_plane: PupilPlane = "stop",
    focus_wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
    focus_criterion: FocusCriterion = "rms_spot",
    accommodation_parameter: float | None = None,
    abbe_number: float | None = None,
) -> Eye:
    """The eye of Bennett & Rabbetts: three spherical surfaces, accommodation up to 10 dpt.

    Parameters
    ----------
    pupil_diameter_mm, accommodation_dpt, pupil_plane, focus_wavelength_nm, focus_criterion
        As in `navarro`.
    accommodation_parameter
        The model's own accommodation, 0 to 10 dpt, instead of `accommodation_dpt`; see
        `BennettRabbettsModel` for what lies between its five published states.
    abbe_number
        None: the indices do not depend on the wavelength, as published. A number (ocular media lie
        near 50) gives every medium that dispersion about its published index.

    Warnings
    --------
    The radius of the retina, -12 mm, is an assumption (visisipy's).

    Raises
    ------
    FocusError, InvalidInputError
        As in `navarro`.

    References
    ----------
    Rabbetts 2007, Bennett & Rabbetts' Clinical Visual Optics, 4th ed.; numbers as in visisipy.
    """
    model = BennettRabbettsModel(PupilSpec(pupil_diameter_mm, pupil_plane), abbe_number)
    return accommodated(
        model, accommodation_dpt, accommodation_parameter, focus_wavelength_nm, focus_criterion
    )
