"""The Arizona eye: Schwiegerling 2004, Field Guide to Visual and Ophthalmic Optics; paper, table 2.

Here the model's parameter A is close to dioptres of accommodation.
"""

from __future__ import annotations

from dataclasses import dataclass

from isetcl.errors import check_between, check_choice, check_type
from isetcl.eye.media import AbbeDispersion, AbbeInterpolation, Medium
from isetcl.eye.model import Eye
from isetcl.eye.models.parts import Face, PupilSpec, cornea_surfaces, lens_surfaces
from isetcl.eye.retina import Retina
from isetcl.eye.stop import Stop


@dataclass(frozen=True)
class ArizonaModel:
    """The Arizona eye as a function of its accommodation parameter A.

    Parameters
    ----------
    pupil
        Diameter and plane of the pupil.
    interpolation
        How n_d and the Abbe numbers become dispersion curves; see `AbbeDispersion`.
    """

    pupil: PupilSpec
    interpolation: AbbeInterpolation = "shifted_cauchy"

    def __post_init__(self) -> None:
        check_type("pupil", self.pupil, PupilSpec)
        check_choice("interpolation", self.interpolation, ("shifted_cauchy", "cauchy", "linear"))

    @property
    def parameter_range(self) -> tuple[float, float]:
        """A from 0 to 10."""
        return (0.0, 10.0)

    def eye(self, parameter: float) -> Eye:
        """The eye at parameter A (Schwiegerling 2004)."""
        a = check_between("the Arizona eye's parameter A", parameter, *self.parameter_range)
        lens_front_z = 0.55 + 2.97 - 0.04 * a
        thickness = 3.767 + 0.04 * a
        cornea = self._medium("cornea", 1.377, 57.1)
        aqueous = self._medium("aqueous", 1.337, 61.3)
        lens = self._medium("lens", 1.42 + 0.00256 * a - 0.00022 * a * a, 51.9)
        vitreous = self._medium("vitreous", 1.336, 61.1)
        cornea_faces = (Face(7.8, -0.25), Face(6.5, -0.25))
        lens_faces = (
            Face(12.0 - 0.4 * a, -7.518749 + 1.285720 * a),
            Face(-5.224557 + 0.2 * a, -1.353971 - 0.431762 * a),
        )
        eye = Eye(
            name="arizona",
            surfaces=(
                *cornea_surfaces(0.55, cornea_faces, (cornea, aqueous)),
                *lens_surfaces(lens_front_z, thickness, lens_faces, (lens, vitreous)),
            ),
            stop=Stop(lens_front_z, self.pupil.diameter_mm),
            retina=Retina.from_radius(lens_front_z + thickness + 16.713, -13.4),
            accommodation_model=self,
            accommodation_parameter=a,
        )
        return self.pupil.apply(eye)

    def _medium(self, name: str, n_d: float, abbe_number: float) -> Medium:
        return Medium(name, AbbeDispersion(n_d, abbe_number, self.interpolation))
