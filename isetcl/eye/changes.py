"""Parametric changes of an eye: its length, chamber depth, cornea, refraction and pupil.

A change is a small value that turns one eye into another. An eye that accommodates keeps its
family: every member of it is changed in the same way, so that the changed eye can still be brought
into focus. Lengths are therefore stored as differences: an eye made 1 mm longer is 1 mm longer in
every state of accommodation.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Literal, Protocol

from isetcl.errors import (
    InvalidInputError,
    check_choice,
    check_finite,
    check_number,
    check_positive,
)
from isetcl.eye import paraxial
from isetcl.eye.clear_apertures import uncrossed
from isetcl.eye.model import (
    REFERENCE_WAVELENGTH_NM,
    AccommodationModel,
    Eye,
)
from isetcl.eye.surface import Surface
from isetcl.units import MM_PER_M

ChamberStart = Literal["epithelium", "endothelium"]
ShiftHold = Literal["axial_length", "vitreous_depth"]

VERTEX_DISTANCE_MM = 12.0
"""Distance from the back of a spectacle lens to the cornea, mm, where none is given."""

_WITHIN_RIM = 0.99


class EyeChange(Protocol):
    """Something that turns one eye into another."""

    def apply(self, eye: Eye) -> Eye:
        """The changed eye."""


@dataclass(frozen=True)
class VitreousChange:
    """The retina moved away from the lens by a length, mm (negative: towards it)."""

    elongation_mm: float

    def __post_init__(self) -> None:
        check_finite("elongation_mm", self.elongation_mm, "mm")

    def apply(self, eye: Eye) -> Eye:
        """The eye with a vitreous longer by that much."""
        z = eye.retina.vertex_z_mm + self.elongation_mm
        return dataclasses.replace(eye, retina=dataclasses.replace(eye.retina, vertex_z_mm=z))


@dataclass(frozen=True)
class LensShift:
    """The lens, with the stop in front of it, moved backwards by a length, mm.

    ``hold`` says whether the retina stays (``"axial_length"``) or moves too
    (``"vitreous_depth"``). A lens that would touch the cornea far from the axis gets a smaller
    semi-diameter.
    """

    shift_mm: float
    hold: ShiftHold = "axial_length"

    def __post_init__(self) -> None:
        check_finite("shift_mm", self.shift_mm, "mm")
        check_choice("hold", self.hold, ("axial_length", "vitreous_depth"))

    def apply(self, eye: Eye) -> Eye:
        """The eye with its lens moved."""
        first = lens_index(eye)
        surfaces = tuple(
            dataclasses.replace(s, vertex_z_mm=s.vertex_z_mm + self.shift_mm) if i >= first else s
            for i, s in enumerate(eye.surfaces)
        )
        surfaces = uncrossed(surfaces, [i < first for i in range(len(surfaces))])
        stop = dataclasses.replace(eye.stop, z_mm=eye.stop.z_mm + self.shift_mm)
        moved = 0.0 if self.hold == "axial_length" else self.shift_mm
        retina = dataclasses.replace(eye.retina, vertex_z_mm=eye.retina.vertex_z_mm + moved)
        return dataclasses.replace(eye, surfaces=surfaces, stop=stop, retina=retina)


@dataclass(frozen=True)
class CorneaChange:
    """Other radii, mm, or conic constants of the cornea; None leaves a number as it is.

    A surface that would end inside its semi-diameter gets a smaller one.
    """

    front_radius_mm: float | None = None
    back_radius_mm: float | None = None
    front_conic: float | None = None
    back_conic: float | None = None

    def __post_init__(self) -> None:
        for name in ("front_radius_mm", "back_radius_mm"):
            radius = getattr(self, name)
            if radius is not None and (math.isnan(check_number(name, radius)) or radius == 0):
                raise InvalidInputError(
                    f"{name} must be a non-zero number of mm (inf is a plane), got {radius}"
                )
        for name in ("front_conic", "back_conic"):
            if getattr(self, name) is not None:
                check_finite(name, getattr(self, name))

    def apply(self, eye: Eye) -> Eye:
        """The eye with that cornea."""
        front, back = cornea_indices(eye)
        surfaces = list(eye.surfaces)
        surfaces[front] = _bent(surfaces[front], self.front_radius_mm, self.front_conic)
        if self.back_radius_mm is not None or self.back_conic is not None:
            if back is None:
                raise InvalidInputError(
                    f"eye {eye.name!r} has a cornea of one surface, so back_radius_mm and "
                    f"back_conic must be left out, got {self.back_radius_mm} and {self.back_conic}"
                )
            surfaces[back] = _bent(surfaces[back], self.back_radius_mm, self.back_conic)
        return dataclasses.replace(eye, surfaces=tuple(surfaces))


@dataclass(frozen=True)
class AlteredModel:
    """A family of eyes, all of its members changed in the same way, in order."""

    base: AccommodationModel
    changes: tuple[EyeChange, ...]

    def __post_init__(self) -> None:
        changes = tuple(self.changes)
        object.__setattr__(self, "changes", changes)
        if not hasattr(self.base, "parameter_range"):
            raise InvalidInputError(
                f"altered model: base must be a family of eyes, got {type(self.base).__name__}"
            )
        for change in changes:
            if not hasattr(change, "apply"):
                raise InvalidInputError(
                    f"altered model: changes must have `apply`, got {type(change).__name__}"
                )

    @property
    def parameter_range(self) -> tuple[float, float]:
        """The range of the family's own parameter."""
        return self.base.parameter_range

    def eye(self, parameter: float) -> Eye:
        """The changed eye at a value of the family's own parameter."""
        eye = self.base.eye(parameter)
        for change in self.changes:
            eye = change.apply(eye)
        return dataclasses.replace(eye, accommodation_model=self)


def altered(eye: Eye, change: EyeChange) -> Eye:
    """The eye with a change, and with every eye that it can accommodate to changed alike.

    A change that takes the accommodation away, as another lens does, ends it.
    """
    changed = change.apply(eye)
    model = eye.accommodation_model
    if model is None or changed.accommodation_model is None:
        return changed
    if isinstance(model, AlteredModel):
        family = AlteredModel(model.base, (*model.changes, change))
    else:
        family = AlteredModel(model, (change,))
    return dataclasses.replace(changed, accommodation_model=family)


def with_axial_length(eye: Eye, axial_length_mm: float) -> Eye:
    """The eye with its retina moved so that it is this long now, mm; see `Eye.with_axial_length`.

    Raises
    ------
    InvalidInputError
        If the retina would lie inside the lens.
    """
    length = check_positive("axial_length_mm", axial_length_mm, "mm")
    return altered(eye, VitreousChange(length - eye.axial_length_mm))


def with_anterior_chamber_depth(
    eye: Eye,
    depth_mm: float,
    *,
    measured_from: ChamberStart = "epithelium",
    hold: ShiftHold = "axial_length",
) -> Eye:
    """The eye with its lens moved; see `Eye.with_anterior_chamber_depth`.

    Raises
    ------
    InvalidInputError
        If the lens would touch the cornea or the retina, or an argument breaks its rule.
    """
    depth = check_positive("anterior chamber depth", depth_mm, "mm")
    check_choice("measured_from", measured_from, ("epithelium", "endothelium"))
    front, back = cornea_indices(eye)
    if measured_from == "endothelium" and back is None:
        raise InvalidInputError(
            f"eye {eye.name!r} has a cornea of one surface, so measured_from must be 'epithelium', "
            "got 'endothelium'"
        )
    start = front if measured_from == "epithelium" or back is None else back
    surfaces = eye.surfaces
    now = surfaces[lens_index(eye)].vertex_z_mm - surfaces[start].vertex_z_mm
    return altered(eye, LensShift(depth - now, hold))


def with_spectacle_refraction(
    eye: Eye,
    refraction_dpt: float,
    *,
    vertex_distance_mm: float = VERTEX_DISTANCE_MM,
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
) -> Eye:
    """The eye with its retina moved to a refraction; see `Eye.with_spectacle_refraction`.

    Raises
    ------
    InvalidInputError
        If no length of the eye gives that refraction, or an argument breaks its rule.
    """
    refraction = check_finite("refraction_dpt", refraction_dpt, "dpt")
    distance_mm = check_finite("vertex_distance_mm", vertex_distance_mm, "mm")
    if distance_mm < 0:
        raise InvalidInputError(f"vertex_distance_mm must be >= 0 mm, got {distance_mm:g}")
    wavelength_nm = check_positive("wavelength_nm", wavelength_nm, "nm")
    toward_lens = 1.0 - refraction * distance_mm / MM_PER_M
    model = eye.accommodation_model
    relaxed = eye if model is None else model.eye(model.parameter_range[0])
    z = _retina_z_mm(relaxed, -refraction / toward_lens, wavelength_nm) if toward_lens > 0 else None
    if z is None:
        raise InvalidInputError(
            f"eye {eye.name!r} cannot have refraction_dpt {refraction:g} at {distance_mm:g} mm: "
            "its image would not lie behind the lens; ask for a weaker refraction"
        )
    return altered(eye, VitreousChange(z - relaxed.retina.vertex_z_mm))


def with_cornea(eye: Eye, change: CorneaChange) -> Eye:
    """The eye with another cornea; see `Eye.with_cornea`."""
    return altered(eye, change)


@dataclass(frozen=True)
class FoveaChange:
    """Another place of the fovea: the field angles (x, y) it sees, degrees."""

    fovea_deg: tuple[float, float]

    def apply(self, eye: Eye) -> Eye:
        """The eye with its fovea there."""
        return dataclasses.replace(eye, fovea_deg=self.fovea_deg)


def cornea_indices(eye: Eye) -> tuple[int, int | None]:
    """Indices of the front and the back surface of the cornea; None for a cornea of one surface.

    They are the surfaces whose names begin with "cornea", or else those in front of the stop.
    """
    named = [i for i, s in enumerate(eye.surfaces) if s.name.lower().startswith("cornea")]
    found = named if named else list(range(eye.stop_index))
    if not found:
        raise InvalidInputError(
            f"eye {eye.name!r} has no surface in front of its stop and none named 'cornea', so its "
            "cornea cannot be found; rename a surface"
        )
    return found[0], found[1] if len(found) > 1 else None


def lens_index(eye: Eye) -> int:
    """Index of the first surface of the lens.

    That is the first whose name begins with "lens", or else the first behind the stop.
    """
    for i, surface in enumerate(eye.surfaces):
        if surface.name.lower().startswith("lens"):
            return i
    if eye.stop_index == len(eye.surfaces):
        raise InvalidInputError(
            f"eye {eye.name!r} has no surface behind its stop and none named 'lens', so it has no "
            "anterior chamber; use a model with a lens"
        )
    return eye.stop_index


def _bent(surface: Surface, radius_mm: float | None, conic: float | None) -> Surface:
    """A surface with another radius, mm, and conic constant."""
    if surface.shape is not None:
        raise InvalidInputError(
            f"surface {surface.name!r} is no conic of revolution, so one radius does not describe "
            "it; replace the surface instead"
        )
    curvature = surface.curvature if radius_mm is None else 1.0 / radius_mm
    k = surface.conic if conic is None else conic
    semi_diameter = surface.semi_diameter_mm
    if (1.0 + k) * (curvature * semi_diameter) ** 2 >= 1.0:
        semi_diameter = _WITHIN_RIM / (abs(curvature) * math.sqrt(1.0 + k))
    return dataclasses.replace(
        surface, curvature=curvature, conic=k, semi_diameter_mm=semi_diameter
    )


def _retina_z_mm(eye: Eye, vergence_dpt: float, wavelength_nm: float) -> float | None:
    """Where an axial object at a vergence (1/m from the cornea) is imaged, mm; None if nowhere.

    Paraxial.
    """
    index = eye.indices(wavelength_nm)
    matrix = paraxial.system_matrix(eye, wavelength_nm)
    height, slope = matrix @ [1.0, index[0] * vergence_dpt / MM_PER_M]
    if slope >= 0 or height <= 0:
        return None
    return float(eye.surfaces[-1].vertex_z_mm - index[-1] * height / slope)
