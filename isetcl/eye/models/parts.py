"""What all model eyes share when they are built: the pupil's plane and the clear apertures."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from isetcl.errors import check_between, check_choice, check_finite, check_pair, check_positive
from isetcl.eye import paraxial
from isetcl.eye.media import LINE_D_NM, AbbeDispersion, ConstantIndex, Dispersion, Medium
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye, PupilPlane
from isetcl.eye.stop import Stop
from isetcl.eye.surface import Surface, conic_sag

CORNEA_SEMI_DIAMETERS_MM = (7.0, 6.0)
"""Semi-diameters of the corneal surfaces, mm, of the eyes in this folder.

The papers give none. ISET3d's 4.820 and 4.341 mm (and 3.750 mm for the lens) clip oblique rays and
large stops; these let chief rays from beyond 100 deg pass, so that only the stop clips.
"""

LENS_SEMI_DIAMETER_MM = 5.2
"""Largest semi-diameter given to a lens, mm; see `lens_semi_diameter_mm`."""


@dataclass(frozen=True)
class Face:
    """One face of a cornea or lens: vertex radius in mm and conic constant."""

    radius_mm: float
    conic: float = 0.0


def lens_semi_diameter_mm(front: Face, back: Face, thickness_mm: float) -> float:
    """The largest semi-diameter up to 5.2 mm at which both faces exist and do not cross, mm.

    Strong accommodation makes some model lenses end early: the front of the Arizona eye at A = 10
    has its rim at 3.2 mm.
    """
    rho = np.linspace(0.0, LENS_SEMI_DIAMETER_MM, 521)
    gap = (
        thickness_mm
        + conic_sag(rho, 1.0 / back.radius_mm, back.conic)
        - conic_sag(rho, 1.0 / front.radius_mm, front.conic)
    )
    closed = ~(gap > 0)
    return float(rho[-1] if not closed.any() else rho[np.argmax(closed) - 2])


@dataclass(frozen=True)
class PupilSpec:
    """A pupil diameter in mm and the plane it is meant in.

    ``"stop"`` is the physical iris (the paper's and ISET3d's meaning). ``"entrance"`` is the image
    of the iris seen from outside, which clinicians measure: the stop is then about 1.13 times
    smaller, by the paraxial magnification at 550 nm. The middle of the stop, its shorter diameter
    over the longer one, and the direction of that are those of the eye where they are None.
    """

    diameter_mm: float
    plane: PupilPlane = "stop"
    decentre_mm: tuple[float, float] | None = None
    aspect: float | None = None
    axis_deg: float | None = None

    def __post_init__(self) -> None:
        check_positive("pupil_diameter_mm", self.diameter_mm, "mm")
        check_choice("pupil_plane", self.plane, ("stop", "entrance"))
        if self.decentre_mm is not None:
            check_pair("pupil: decentre_mm", self.decentre_mm, "mm")
        if self.aspect is not None:
            check_between("pupil: aspect", self.aspect, 0.01, 1.0)
        if self.axis_deg is not None:
            check_finite("pupil: axis_deg", self.axis_deg, "deg")

    def apply(self, eye: Eye) -> Eye:
        """The eye with its stop set so that this pupil has its diameter in its plane."""
        if self.plane == "stop":
            diameter = self.diameter_mm
        else:
            magnification = paraxial.entrance_pupil(eye, REFERENCE_WAVELENGTH_NM).magnification
            diameter = self.diameter_mm / magnification
        now = eye.stop
        aspect = now.aspect if self.aspect is None else self.aspect
        stop = Stop(
            now.z_mm,
            diameter,
            now.decentre_mm if self.decentre_mm is None else self.decentre_mm,
            None if aspect == 1.0 else diameter * aspect,
            now.axis_deg if self.axis_deg is None else self.axis_deg,
        )
        return dataclasses.replace(eye, stop=stop)


def medium(
    name: str, index: float, abbe_number: float | None = None, index_nm: float = LINE_D_NM
) -> Medium:
    """A medium of which one index is published; achromatic unless it is given an Abbe number.

    `index_nm` is the wavelength of that index.
    """
    return Medium(name, dispersion(index, abbe_number, index_nm))


def dispersion(
    index: float, abbe_number: float | None = None, index_nm: float = LINE_D_NM
) -> Dispersion:
    """The dispersion of `medium`."""
    if abbe_number is None:
        return ConstantIndex(index)
    # n - 1 is proportional to n_d - 1 at any wavelength.
    ratio = float(AbbeDispersion(2.0, abbe_number).evaluate(np.array(index_nm))) - 1.0
    return AbbeDispersion(1.0 + (index - 1.0) / ratio, abbe_number)


def lens_surfaces(
    front_z_mm: float,
    thickness_mm: float,
    faces: tuple[Face, Face],
    media: tuple[Medium, Medium],
) -> tuple[Surface, Surface]:
    """The two surfaces of a lens whose front vertex lies at `front_z_mm`; media lens, vitreous."""
    semi_diameter = lens_semi_diameter_mm(*faces, thickness_mm)
    names = ("lens front", "lens back")
    z = (front_z_mm, front_z_mm + thickness_mm)
    front, back = (
        Surface.from_radius(
            names[i],
            z[i],
            faces[i].radius_mm,
            conic=faces[i].conic,
            semi_diameter_mm=semi_diameter,
            medium_after=media[i],
        )
        for i in range(2)
    )
    return front, back


def cornea_surfaces(
    thickness_mm: float, faces: tuple[Face, Face], media: tuple[Medium, Medium]
) -> tuple[Surface, Surface]:
    """The two surfaces of a cornea whose front vertex is the origin; media cornea, aqueous."""
    names = ("cornea front", "cornea back")
    front, back = (
        Surface.from_radius(
            names[i],
            i * thickness_mm,
            faces[i].radius_mm,
            conic=faces[i].conic,
            semi_diameter_mm=CORNEA_SEMI_DIAMETERS_MM[i],
            medium_after=media[i],
        )
        for i in range(2)
    )
    return front, back
