"""What an eye is: refracting surfaces, a stop, a retina, and how it accommodates.

Eye frame: mm, origin at the corneal vertex, +z from the cornea to the retina, +y superior. The
radius of a surface is > 0 when its centre of curvature lies at larger z; the curvature c = 1/R is
what is stored, so that a plane is c = 0.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_choice,
    check_finite,
    check_number,
    check_positive,
    check_type,
)
from isetcl.eye.media import AIR, Medium
from isetcl.eye.pictures import EyePictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.eye.field import FieldMap
    from isetcl.eye.paraxial import CardinalPoints, Pupil
    from isetcl.eye.wavefront import Reference, Wavefront

FocusCriterion = Literal["rms_spot", "paraxial"]
PupilPlane = Literal["stop", "entrance"]

REFERENCE_WAVELENGTH_NM = 550.0
"""Wavelength, nm, of focus and of the retinal grid unless another is named (the paper's)."""

_SAME_PLANE_MM = 1e-9


def conic_sag(rho_mm: np.ndarray | float, curvature: float, conic: float) -> np.ndarray:
    """Sag z(rho) of a conic of revolution, mm: c rho^2 / (1 + sqrt(1 - (1 + k) c^2 rho^2)).

    NaN beyond the rim. For building geometry only; ray hits are never re-projected on it, because
    they may lie behind the equator.
    """
    rho2 = np.square(rho_mm)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(1.0 - (1.0 + conic) * curvature**2 * rho2)
    return curvature * rho2 / (1.0 + root)


@dataclass(frozen=True)
class Surface:
    """A refracting conic of revolution, c (x^2 + y^2 + (1 + k) z^2) - 2 z = 0 from its vertex.

    Parameters
    ----------
    name
        For messages and drawings, "cornea front".
    vertex_z_mm
        Where the surface meets the axis, mm behind the corneal vertex.
    curvature
        c = 1/R, 1/mm; 0 is a plane; > 0 if the centre lies at larger z.
    conic
        k: 0 sphere, -1 paraboloid, < -1 hyperboloid.
    semi_diameter_mm
        Largest distance from the axis at which the surface exists, mm.
    medium_after
        The medium on the retinal side.
    """

    name: str
    vertex_z_mm: float
    curvature: float
    conic: float
    semi_diameter_mm: float
    medium_after: Medium

    def __post_init__(self) -> None:
        label = f"surface {self.name!r}"
        check_type("surface: name", self.name, str)
        for name, unit in (("vertex_z_mm", "mm"), ("curvature", "1/mm"), ("conic", "")):
            value = check_finite(f"{label}: {name}", getattr(self, name), unit)
            object.__setattr__(self, name, value)
        check_positive(f"{label}: semi_diameter_mm", self.semi_diameter_mm, "mm")
        check_type(f"{label}: medium_after", self.medium_after, Medium)
        rim2 = (1.0 + self.conic) * (self.curvature * self.semi_diameter_mm) ** 2
        if rim2 >= 1.0:
            reach = 1.0 / (abs(self.curvature) * math.sqrt(1.0 + self.conic))
            raise InvalidInputError(
                f"{label}: semi_diameter_mm must be < {reach:.6g} mm, where this conic ends, "
                f"got {self.semi_diameter_mm:g}"
            )

    @classmethod
    def from_radius(
        cls,
        name: str,
        vertex_z_mm: float,
        radius_mm: float,
        *,
        conic: float = 0.0,
        semi_diameter_mm: float,
        medium_after: Medium,
    ) -> Surface:
        """A surface given by its vertex radius of curvature in mm; `inf` is a plane.

        Raises
        ------
        InvalidInputError
            If the radius is zero or NaN.
        """
        curvature = _curvature(f"surface {name!r}: radius_mm", radius_mm)
        return cls(name, vertex_z_mm, curvature, conic, semi_diameter_mm, medium_after)

    @property
    def radius_mm(self) -> float:
        """Vertex radius of curvature, mm; `inf` for a plane."""
        return math.inf if self.curvature == 0 else 1.0 / self.curvature

    def sag_mm(self, rho_mm: np.ndarray | float) -> np.ndarray:
        """Position z - vertex_z at distance rho from the axis, mm."""
        return conic_sag(rho_mm, self.curvature, self.conic)


@dataclass(frozen=True)
class Stop:
    """The physical iris: a circular hole in an opaque plane.

    Parameters
    ----------
    z_mm
        Position of the plane behind the corneal vertex, mm.
    diameter_mm
        Diameter of the hole, mm. A ray that meets the edge exactly passes.
    """

    z_mm: float
    diameter_mm: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "z_mm", check_finite("stop: z_mm", self.z_mm, "mm"))
        diameter = check_positive("stop: diameter_mm", self.diameter_mm, "mm")
        object.__setattr__(self, "diameter_mm", diameter)

    @property
    def radius_mm(self) -> float:
        """Radius of the hole, mm."""
        return self.diameter_mm / 2.0


@dataclass(frozen=True)
class Retina:
    """The surface that receives the image: a conic of revolution, concave towards the lens.

    Parameters
    ----------
    vertex_z_mm
        Where it meets the axis, mm behind the corneal vertex (the axial length).
    curvature
        c = 1/R, 1/mm, <= 0: the centre of curvature lies in front of the retina.
    conic
        k of the conic, 0 for a sphere.
    """

    vertex_z_mm: float
    curvature: float
    conic: float = 0.0

    def __post_init__(self) -> None:
        check_positive("retina: vertex_z_mm", self.vertex_z_mm, "mm")
        check_finite("retina: conic", self.conic)
        if check_finite("retina: curvature", self.curvature, "1/mm") > 0:
            raise InvalidInputError(
                "retina: curvature must be <= 0 1/mm (centre of curvature in front of the "
                f"retina), got {self.curvature:g}; pass a negative radius"
            )

    @classmethod
    def from_radius(cls, vertex_z_mm: float, radius_mm: float, conic: float = 0.0) -> Retina:
        """A retina given by its radius of curvature, mm, negative (Navarro: -12)."""
        return cls(vertex_z_mm, _curvature("retina: radius_mm", radius_mm), conic)

    @property
    def radius_mm(self) -> float:
        """Vertex radius of curvature, mm (negative); `-inf` for a plane."""
        return -math.inf if self.curvature == 0 else 1.0 / self.curvature


class AccommodationModel(Protocol):
    """How an eye changes shape: a family of eyes over one parameter."""

    @property
    def parameter_range(self) -> tuple[float, float]:
        """Smallest and largest legal value of the model's own parameter."""

    def eye(self, parameter: float) -> Eye:
        """The eye at a value of the model's own parameter."""


@dataclass(frozen=True)
class Eye(EyePictures):
    """A sequential model eye.

    Parameters
    ----------
    name
        Name of the model.
    surfaces
        Refracting surfaces in the order light meets them, corneal front first (vertex at z = 0).
    stop
        The iris. It acts before the first surface whose vertex is at or behind its plane.
    retina
        The image surface.
    medium_before
        The medium in front of the first surface, air by default.
    accommodation_model, accommodation_parameter
        The family this eye belongs to and its place in it; None for an eye that cannot accommodate.

    Raises
    ------
    InvalidInputError
        If surfaces are missing, out of order or cut each other, or the retina lies inside the lens.
    """

    name: str
    surfaces: tuple[Surface, ...]
    stop: Stop
    retina: Retina
    medium_before: Medium = AIR
    accommodation_model: AccommodationModel | None = None
    accommodation_parameter: float | None = None

    def __post_init__(self) -> None:
        self._check_types()
        if not self.surfaces:
            raise InvalidInputError(f"eye {self.name!r} needs at least one refracting surface")
        if self.surfaces[0].vertex_z_mm != 0.0:
            raise InvalidInputError(
                f"eye {self.name!r}: the first surface must have vertex_z_mm = 0 (the origin of "
                f"the eye frame), got {self.surfaces[0].vertex_z_mm:g}"
            )
        self._check_order()

    def _check_types(self) -> None:
        """Refuse parts that are no parts of an eye."""
        label = f"eye {self.name!r}"
        check_type("eye: name", self.name, str)
        check_type(f"{label}: surfaces", self.surfaces, (tuple, list), "pass a tuple of Surface")
        object.__setattr__(self, "surfaces", tuple(self.surfaces))
        for i, surface in enumerate(self.surfaces):
            check_type(f"{label}: surfaces[{i}]", surface, Surface)
        check_type(f"{label}: stop", self.stop, Stop)
        check_type(f"{label}: retina", self.retina, Retina)
        check_type(f"{label}: medium_before", self.medium_before, Medium)
        if self.accommodation_model is not None and not hasattr(self.accommodation_model, "eye"):
            raise InvalidInputError(
                f"{label}: accommodation_model must have `eye` and `parameter_range`, got "
                f"{type(self.accommodation_model).__name__}; pass None for an eye that cannot "
                "accommodate"
            )

    def _check_order(self) -> None:
        """Refuse surfaces that are out of order or cut each other inside their semi-diameters."""
        for front, back in zip(self.surfaces, self.surfaces[1:], strict=False):
            rho = np.linspace(0.0, min(front.semi_diameter_mm, back.semi_diameter_mm), 65)
            gap = back.vertex_z_mm + back.sag_mm(rho) - front.vertex_z_mm - front.sag_mm(rho)
            if np.min(gap) < 0:
                at = rho[np.argmax(gap < 0)]
                raise InvalidInputError(
                    f"eye {self.name!r}: surface {back.name!r} must lie behind {front.name!r} over "
                    f"their common semi-diameter, but they cross {at:.3g} mm from the axis; "
                    "change the thickness, the radii or the semi-diameters"
                )
        last = self.surfaces[-1]
        if self.retina.vertex_z_mm <= max(last.vertex_z_mm, self.stop.z_mm):
            raise InvalidInputError(
                f"eye {self.name!r}: the retina must lie behind the last surface and the stop, "
                f"got retina at {self.retina.vertex_z_mm:g} mm, {last.name!r} at "
                f"{last.vertex_z_mm:g} mm, stop at {self.stop.z_mm:g} mm"
            )
        for surface in self.surfaces[: self.stop_index]:
            edge = min(self.stop.radius_mm, surface.semi_diameter_mm)
            if surface.vertex_z_mm + float(surface.sag_mm(edge)) > self.stop.z_mm:
                raise InvalidInputError(
                    f"eye {self.name!r}: the stop (radius {self.stop.radius_mm:g} mm, at "
                    f"{self.stop.z_mm:g} mm) cuts surface {surface.name!r}; make the stop smaller "
                    "or move it back"
                )

    @property
    def stop_index(self) -> int:
        """Number of refracting surfaces in front of the stop.

        A vertex that lies in the plane of the stop, to rounding, is behind it.
        """
        return sum(s.vertex_z_mm < self.stop.z_mm - _SAME_PLANE_MM for s in self.surfaces)

    @property
    def axial_length_mm(self) -> float:
        """Corneal vertex to retinal vertex, mm."""
        return self.retina.vertex_z_mm

    def media(self) -> tuple[Medium, ...]:
        """The media in the order light meets them: in front of the eye first, vitreous last."""
        return (self.medium_before, *(s.medium_after for s in self.surfaces))

    def indices(self, wavelength_nm: float) -> np.ndarray:
        """Refractive indices of `media()` at one wavelength, shape (n_surfaces + 1,).

        Raises
        ------
        InvalidInputError
            If the wavelength, nm, lies outside the range of a medium.
        """
        check_positive("wavelength_nm", wavelength_nm, "nm")
        return np.array([float(m.index(wavelength_nm)) for m in self.media()])

    def wavelength_range_nm(self) -> tuple[float, float]:
        """The wavelengths at which every medium is defined, nm."""
        ranges = [m.dispersion.range_nm for m in self.media()]
        return max(r[0] for r in ranges), min(r[1] for r in ranges)

    def power_dpt(self, wavelength_nm: float = REFERENCE_WAVELENGTH_NM) -> float:
        """Equivalent power in dioptres at a wavelength in nm (paraxial).

        Raises
        ------
        InvalidInputError
            If the wavelength lies outside the range of a medium.
        """
        return self.cardinal_points(wavelength_nm).power_dpt

    def cardinal_points(self, wavelength_nm: float = REFERENCE_WAVELENGTH_NM) -> CardinalPoints:
        """Focal, principal and nodal points at a wavelength in nm (paraxial).

        Raises
        ------
        InvalidInputError
            If the wavelength lies outside the range of a medium.
        """
        from isetcl.eye import paraxial

        return paraxial.cardinal_points(self, wavelength_nm)

    def entrance_pupil(self, wavelength_nm: float = REFERENCE_WAVELENGTH_NM) -> Pupil:
        """The stop as seen from the scene (paraxial): position, magnification, diameter.

        Raises
        ------
        InvalidInputError
            If the wavelength lies outside the range of a medium.
        """
        from isetcl.eye import paraxial

        return paraxial.entrance_pupil(self, wavelength_nm)

    def exit_pupil(self, wavelength_nm: float = REFERENCE_WAVELENGTH_NM) -> Pupil:
        """The stop as seen from the retina (paraxial): position, magnification, diameter.

        Raises
        ------
        InvalidInputError
            If the wavelength lies outside the range of a medium.
        """
        from isetcl.eye import paraxial

        return paraxial.exit_pupil(self, wavelength_nm)

    def focus_vergence_dpt(
        self,
        wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
        criterion: FocusCriterion = "rms_spot",
    ) -> float:
        """Vergence (1/m from the corneal vertex) of the axial object the eye is focused on.

        0 is infinity; a negative value is a virtual object behind the eye (hyperopia).

        Raises
        ------
        InvalidInputError
            If the wavelength lies outside the range of a medium, or the criterion is unknown.
        FocusError
            If the rays of the stop do not reach the retina.
        """
        from isetcl.eye import focus

        return focus.focus_vergence_dpt(self, wavelength_nm, criterion)

    def focus_at(
        self,
        distance_m: float,
        wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
        criterion: FocusCriterion = "rms_spot",
    ) -> Eye:
        """The same eye, accommodated to an object `distance_m` from the corneal vertex.

        Parameters
        ----------
        distance_m
            Distance of the object, m; infinity is legal.
        wavelength_nm
            Wavelength that is in focus, nm.
        criterion
            ``"rms_spot"`` (smallest root-mean-square spot radius of the on-axis point at the
            present stop) or ``"paraxial"``.

        Raises
        ------
        FocusError
            If the eye cannot accommodate, or the object lies outside its range of clear vision.
        """
        from isetcl.eye import focus

        return focus.focus_at(self, distance_m, wavelength_nm, criterion)

    def field_map(self, wavelength_nm: float = REFERENCE_WAVELENGTH_NM) -> FieldMap:
        """The chief-ray map between field angle and retinal position at a wavelength in nm.

        Raises
        ------
        InvalidInputError
            If the wavelength lies outside the range of a medium, or no chief ray passes the eye.
        """
        from isetcl.eye import field

        return field.field_map(self, check_positive("wavelength_nm", wavelength_nm, "nm"))

    def wavefront(
        self,
        field_deg: tuple[float, float] | float = (0.0, 0.0),
        wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
        *,
        object_distance_m: float = math.inf,
        samples: int | None = None,
        reference: Reference = "chief",
        stiles_crawford: float | None = None,
        scale_wavelength_nm: float | None = None,
    ) -> Wavefront:
        """The wavefront that an object point makes in the eye, in float64; see `Wavefront`.

        Parameters
        ----------
        field_deg
            Field angles (x, y) of the point, degrees; a single number is (0, y).
        wavelength_nm
            Wavelength, nm.
        object_distance_m
            Distance of the object plane in front of the corneal vertex, m; infinity is legal.
        samples
            Samples across the pupil, 16 to 1024; None takes 64, or what the aberrations need (up to
            512).
        reference
            Centre of the reference sphere: ``"chief"`` (where the chief ray meets the retina) or
            ``"best_focus"`` (the point of the chief ray where the RMS is least; the image is then
            the one in the plane there).
        stiles_crawford
            rho in 1/mm^2 of an apodisation of the intensity by 10^(-rho r^2); None is even light.
        scale_wavelength_nm
            Wavelength of the chief rays that turn retinal positions into visual angles, nm; None is
            `wavelength_nm`.

        Raises
        ------
        InvalidInputError
            If no chief ray enters from there, most of the stop is vignetted, the wavelength lies
            outside the range of a medium, or an argument breaks its rule.
        """
        from isetcl.eye import wavefront_trace

        return wavefront_trace.wavefront(
            self,
            field_deg,
            wavelength_nm,
            object_distance_m=object_distance_m,
            samples=samples,
            reference=reference,
            stiles_crawford=stiles_crawford,
            scale_wavelength_nm=scale_wavelength_nm,
        )

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw the section of the eye with rays from infinity; returns the axes.

        Parameters
        ----------
        ax
            Matplotlib axes; None makes a new figure.
        options
            `fields_deg`, `wavelength_nm` and `rays` of `isetcl.eye.drawing.draw_eye`.
        """
        from isetcl.eye import drawing

        for name in options:
            check_choice("option of plot", name, ("fields_deg", "wavelength_nm", "rays"))
        return drawing.draw_eye(self, ax, **options)

    def describe(self) -> dict[str, Any]:
        """The whole prescription as plain JSON-ready values, for provenance."""
        description = dataclasses.asdict(
            dataclasses.replace(self, accommodation_model=None, accommodation_parameter=None)
        )
        del description["accommodation_model"]
        description["accommodation_parameter"] = self.accommodation_parameter
        for surface, described in zip(self.surfaces, description["surfaces"], strict=True):
            kind = type(surface.medium_after.dispersion).__name__
            described["medium_after"]["dispersion"]["kind"] = kind
        return description


def check_eye_wavelengths(eye: Eye, wavelengths_nm: np.ndarray) -> None:
    """Raise InvalidInputError unless every medium of an eye is defined at all wavelengths, nm."""
    low, high = eye.wavelength_range_nm()
    if wavelengths_nm[0] < low or wavelengths_nm[-1] > high:
        raise InvalidInputError(
            f"wavelengths_nm must lie between {low:g} and {high:g} nm, where the media of eye "
            f"{eye.name!r} are defined, got {wavelengths_nm[0]:g} to {wavelengths_nm[-1]:g} nm"
        )


def _curvature(name: str, radius_mm: float) -> float:
    radius = check_number(name, radius_mm)
    if math.isnan(radius) or radius == 0:
        raise InvalidInputError(f"{name} must be a non-zero number (inf is a plane), got {radius}")
    return 0.0 if math.isinf(radius) else 1.0 / radius
