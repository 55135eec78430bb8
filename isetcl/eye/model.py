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

from isetcl.errors import InvalidInputError, check_choice, check_pair, check_positive, check_type
from isetcl.eye.media import AIR, Medium
from isetcl.eye.retina import Retina
from isetcl.eye.stop import Stop
from isetcl.eye.surface import Surface
from isetcl.eye.variants import EyeVariants

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.eye.field import FieldMap
    from isetcl.eye.field_plane import FieldPlane
    from isetcl.eye.paraxial import CardinalPoints, Pupil
    from isetcl.eye.waves.wavefront import Reference, Wavefront

FocusCriterion = Literal["rms_spot", "paraxial"]
PupilPlane = Literal["stop", "entrance"]

REFERENCE_WAVELENGTH_NM = 550.0
"""Wavelength, nm, of focus and of the retinal grid unless another is named (the paper's)."""

_SAME_PLANE_MM = 1e-9


class AccommodationModel(Protocol):
    """How an eye changes shape: a family of eyes over one parameter."""

    @property
    def parameter_range(self) -> tuple[float, float]:
        """Smallest and largest legal value of the model's own parameter."""

    def eye(self, parameter: float) -> Eye:
        """The eye at a value of the model's own parameter."""


@dataclass(frozen=True)
class Eye(EyeVariants):
    """A sequential model eye.

    Parameters
    ----------
    name
        Name of the model.
    surfaces
        Refracting surfaces in the order light meets them. The front of the cornea has its vertex at
        z = 0; lenses in front of it, as spectacles, come before it.
    stop
        The iris. It acts before the first surface whose vertex is at or behind its plane.
    retina
        The image surface.
    medium_before
        The medium in front of the first surface, air by default.
    accommodation_model, accommodation_parameter
        The family this eye belongs to and its place in it; None for an eye that cannot accommodate.
    fovea_deg
        Field angles (x, y) of the direction that the fovea sees, degrees from the optical axis. In
        human eyes about 5 degrees nasally: to the left (x < 0) for a right eye.

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
    fovea_deg: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        self._check_types()
        if not self.surfaces:
            raise InvalidInputError(f"eye {self.name!r} needs at least one refracting surface")
        z = [surface.vertex_z_mm for surface in self.surfaces]
        if z[0] > 0.0 or 0.0 not in z:
            raise InvalidInputError(
                f"eye {self.name!r}: the front of the cornea must have vertex_z_mm = 0 (the origin "
                f"of the eye frame), with nothing but lenses in front of it, got {z[0]:g} mm for "
                f"the first surface, {self.surfaces[0].name!r}"
            )
        self._check_order()
        from isetcl.eye.gradient_check import check_gradients

        check_gradients(self, REFERENCE_WAVELENGTH_NM)

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
        object.__setattr__(
            self, "fovea_deg", check_pair(f"{label}: fovea_deg", self.fovea_deg, "deg")
        )
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
            gap = smallest_gap_mm(front, back, rho)
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
            if _rearmost_mm(surface, self.stop) > self.stop.z_mm:
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
    def is_rotational(self) -> bool:
        """Whether everything is a surface of revolution about the axis of the eye."""
        return (
            all(surface.is_rotational for surface in self.surfaces)
            and self.stop.is_rotational
            and self.retina.is_rotational
        )

    def asymmetries(self) -> list[str]:
        """What keeps the eye from being a figure of revolution, by name."""
        names = [surface.name for surface in self.surfaces if not surface.is_rotational]
        names += ["stop"] * (not self.stop.is_rotational)
        return names + ["retina"] * (not self.retina.is_rotational)

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
        ranges = [m.range_nm for m in self.media()]
        return max(r[0] for r in ranges), min(r[1] for r in ranges)

    def power_dpt(self, wavelength_nm: float = REFERENCE_WAVELENGTH_NM) -> float:
        """Equivalent power in dioptres at a wavelength in nm (paraxial).

        Of an astigmatic eye the mean of its principal meridians; see `isetcl.eye.astigmatism`.

        Raises
        ------
        InvalidInputError
            If the wavelength lies outside the range of a medium.
        """
        if not self.is_rotational:
            from isetcl.eye import astigmatism

            return astigmatism.principal_meridians(self, wavelength_nm).mean_dpt
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

    def field_map(self, wavelength_nm: float = REFERENCE_WAVELENGTH_NM) -> FieldMap | FieldPlane:
        """The chief-ray map between field angle and retinal position at a wavelength in nm.

        A `FieldPlane`, of two field angles, where the eye is not a figure of revolution.

        Raises
        ------
        InvalidInputError
            If the wavelength lies outside the range of a medium, or no chief ray passes the eye.
        """
        from isetcl.eye import field, field_plane

        wavelength = check_positive("wavelength_nm", wavelength_nm, "nm")
        if self.is_rotational:
            return field.field_map(self, wavelength)
        return field_plane.field_plane(self, wavelength)

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
        from isetcl.eye.waves import wavefront_trace

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
        """Draw the section of the eye with rays; returns the axes.

        Parameters
        ----------
        ax
            Matplotlib axes; None makes a new figure.
        options
            Those of `isetcl.eye.pictures.drawing.draw_eye`.
        """
        from isetcl.eye.pictures import drawing

        for name in options:
            check_choice("option of plot", name, drawing.OPTIONS)
        return drawing.draw_eye(self, ax, **options)

    def describe(self) -> dict[str, Any]:
        """The whole prescription as plain JSON-ready values, for provenance."""
        from isetcl.eye.files.values import to_values

        alone = dataclasses.replace(self, accommodation_model=None)
        description: dict[str, Any] = to_values(alone, "eye", strict=False)
        del description["accommodation_model"]
        return description


def check_eye_wavelengths(eye: Eye, wavelengths_nm: np.ndarray) -> None:
    """Raise InvalidInputError unless every medium of an eye is defined at all wavelengths, nm."""
    low, high = eye.wavelength_range_nm()
    if wavelengths_nm[0] < low or wavelengths_nm[-1] > high:
        raise InvalidInputError(
            f"wavelengths_nm must lie between {low:g} and {high:g} nm, where the media of eye "
            f"{eye.name!r} are defined, got {wavelengths_nm[0]:g} to {wavelengths_nm[-1]:g} nm"
        )


_GAP_AZIMUTHS = 24


def smallest_gap_mm(front: Surface, back: Surface, rho_mm: np.ndarray) -> np.ndarray:
    """Distance along z from one surface to the next at distances from the axis, mm, (n,).

    The smallest over all azimuths; places where one of them does not reach count as open.
    """
    if front.is_rotational and back.is_rotational:
        return back.vertex_z_mm + back.sag_mm(rho_mm) - front.vertex_z_mm - front.sag_mm(rho_mm)
    from isetcl.eye.sequential import heights_mm

    turn = 2.0 * np.pi * np.arange(_GAP_AZIMUTHS) / _GAP_AZIMUTHS
    x, y = rho_mm[:, None] * np.cos(turn), rho_mm[:, None] * np.sin(turn)
    gap = heights_mm(back, x, y) - heights_mm(front, x, y)
    return np.asarray(np.min(np.where(np.isfinite(gap), gap, np.inf), axis=1))


def _rearmost_mm(surface: Surface, stop: Stop) -> float:
    """Largest z of a surface within the rim of the stop, as far as it reaches, mm."""
    turn = np.linspace(0.0, 2.0 * np.pi, 33)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    if surface.is_rotational and stop.is_rotational:
        edge = min(stop.radius_mm, surface.semi_diameter_mm)
        return surface.vertex_z_mm + float(np.max(surface.sag_mm(*(edge * circle.T))))
    from isetcl.eye.sequential import heights_mm

    points = stop.rim_mm(np.linspace(0.0, 1.0, 9)[:, None, None] * circle)
    z = heights_mm(surface, points[..., 0], points[..., 1])
    return float(np.max(z[np.isfinite(z)], initial=-math.inf))
