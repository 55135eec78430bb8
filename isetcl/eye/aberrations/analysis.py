"""What an eye does to light, as methods of `Eye`: the curves of this package, by name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from isetcl.errors import check_choice

if TYPE_CHECKING:
    from isetcl.eye.aberrations.chromatic import Plane
    from isetcl.eye.aberrations.geometric import Spot
    from isetcl.eye.aberrations.polychromatic import Model
    from isetcl.eye.aberrations.refraction_error import (
        FocusMetric,
        ObliqueFoci,
        Refraction,
        RefractionDefinition,
    )
    from isetcl.eye.astigmatism import PrincipalMeridians
    from isetcl.eye.model import Eye, FocusCriterion
    from isetcl.eye.pictures.ray_fan import RayFan
    from isetcl.eye.waves.wavefront import Wavefront

_REFERENCE_NM = 550.0
_MOST_SAMPLES = 512


class EyeAnalysis:
    """Methods of `Eye`; each is short for a function of another module, which its text names."""

    def _as_eye(self) -> Eye:
        return cast("Eye", self)

    def lca_dpt(
        self,
        wavelengths_nm: np.ndarray | Sequence[float],
        reference_nm: float = 589.3,
        criterion: FocusCriterion = "paraxial",
        plane: Plane = "cornea",
    ) -> np.ndarray:
        """Longitudinal chromatic aberration, dpt, (n,); see `chromatic.lca_dpt`."""
        from isetcl.eye.aberrations import chromatic

        return chromatic.lca_dpt(self._as_eye(), wavelengths_nm, reference_nm, criterion, plane)

    def tca_arcmin(
        self,
        field_deg: tuple[float, float] | float,
        wavelengths_nm: np.ndarray | Sequence[float],
        reference_nm: float = 589.3,
        object_distance_m: float = math.inf,
    ) -> np.ndarray:
        """Transverse chromatic aberration, (n, 2); see `chromatic.tca_arcmin`."""
        from isetcl.eye.aberrations import chromatic

        return chromatic.tca_arcmin(
            self._as_eye(), field_deg, wavelengths_nm, reference_nm, object_distance_m
        )

    def spot(
        self,
        field_deg: tuple[float, float] | float = (0.0, 0.0),
        wavelength_nm: float = _REFERENCE_NM,
        *,
        object_distance_m: float = math.inf,
        rings: int = 40,
        scale_wavelength_nm: float | None = None,
    ) -> Spot:
        """Where the rays of an object point meet the retina; see `geometric.spot`."""
        from isetcl.eye.aberrations import geometric

        return geometric.spot(
            self._as_eye(),
            field_deg,
            wavelength_nm,
            object_distance_m=object_distance_m,
            rings=rings,
            scale_wavelength_nm=scale_wavelength_nm,
        )

    def spots(
        self,
        field_deg: tuple[float, float] | float,
        wavelengths_nm: Sequence[float],
        *,
        reference_nm: float | None = None,
        object_distance_m: float = math.inf,
        rings: int = 40,
    ) -> list[Spot]:
        """The spots of an object point at several wavelengths, about one point of the retina.

        That point is where the chief ray of `reference_nm` lands (None: the middle wavelength of
        the list), so that the transverse chromatic aberration shows.
        """
        from isetcl.eye.aberrations import geometric

        middle = wavelengths_nm[len(wavelengths_nm) // 2]
        origin = float(middle if reference_nm is None else reference_nm)
        found = []
        for wavelength in wavelengths_nm:
            one = self.spot(
                field_deg,
                float(wavelength),
                object_distance_m=object_distance_m,
                rings=rings,
                scale_wavelength_nm=origin,
            )
            moved = self.tca_arcmin(field_deg, [float(wavelength)], origin, object_distance_m)[0]
            found.append(geometric.shifted(one, moved))
        return found

    def ray_fan(
        self, field_deg: float = 0.0, wavelength_nm: float = _REFERENCE_NM, **options: Any
    ) -> RayFan:
        """The ray fan of an object point; see `isetcl.eye.pictures.ray_fan.ray_fan`."""
        from isetcl.eye.pictures import ray_fan

        allowed = ("reference_nm", "object_distance_m", "rays")
        for name in options:
            check_choice("option of ray_fan", name, allowed)
        return ray_fan.ray_fan(self._as_eye(), field_deg, wavelength_nm, **options)

    def mtf(
        self,
        frequency_cpd: np.ndarray | Sequence[float],
        field_deg: tuple[float, float] | float = (0.0, 0.0),
        wavelength_nm: float = _REFERENCE_NM,
        *,
        orientation_deg: float = 0.0,
        model: Model = "diffraction",
        object_distance_m: float = math.inf,
    ) -> np.ndarray:
        """Modulation transfer in light of one wavelength, (n,).

        Parameters
        ----------
        frequency_cpd
            Frequencies, cycles/degree.
        field_deg, wavelength_nm, object_distance_m
            As in `Eye.wavefront`.
        orientation_deg
            Direction across the stripes, anticlockwise from the horizontal: 0 is for vertical
            stripes.
        model
            ``"diffraction"`` or ``"geometric"``.
        """
        check_choice("model", model, ("diffraction", "geometric"))
        if model == "geometric":
            rays = self.spot(field_deg, wavelength_nm, object_distance_m=object_distance_m)
            return rays.mtf(frequency_cpd, orientation_deg)
        front = self._as_eye().wavefront(
            field_deg, wavelength_nm, object_distance_m=object_distance_m
        )
        return front.otf().mtf(frequency_cpd, orientation_deg)

    def polychromatic_mtf(
        self, frequency_cpd: np.ndarray | Sequence[float], **options: Any
    ) -> np.ndarray:
        """Modulation transfer in light of many wavelengths, (n,).

        Takes the options of `isetcl.eye.aberrations.polychromatic.polychromatic_otf`: `field_deg`,
        `orientation_deg`, `wavelengths_nm`, `weights` (None is V(lambda)), `model` and others.
        """
        from isetcl.eye.aberrations import polychromatic

        allowed = polychromatic.polychromatic_otf.__kwdefaults__ or {}
        for name in options:
            check_choice("option of polychromatic_mtf", name, allowed)
        return polychromatic.polychromatic_mtf(self._as_eye(), frequency_cpd, **options)

    def refraction(
        self,
        field_deg: tuple[float, float] | float = (0.0, 0.0),
        wavelength_nm: float = _REFERENCE_NM,
        definition: RefractionDefinition = "minimum_rms",
    ) -> Refraction:
        """The lens that corrects the eye for infinity; see `refraction_error`."""
        return self._as_eye().wavefront(field_deg, wavelength_nm).refraction(definition)

    def oblique_foci(
        self,
        field_deg: np.ndarray | Sequence[float] | float,
        wavelength_nm: float = _REFERENCE_NM,
    ) -> ObliqueFoci:
        """Tangential and sagittal refraction over the field; see `refraction_error`."""
        from isetcl.eye.aberrations import refraction_error

        return refraction_error.oblique_foci(self._as_eye(), field_deg, wavelength_nm)

    def pencil_refraction(
        self,
        field_deg: tuple[float, float] | float = (0.0, 0.0),
        wavelength_nm: float = _REFERENCE_NM,
    ) -> Refraction:
        """The refraction of a narrow pencil anywhere in the field; see `isetcl.eye.astigmatism`."""
        from isetcl.eye import astigmatism

        return astigmatism.pencil_refraction(self._as_eye(), field_deg, wavelength_nm)

    def principal_meridians(self, wavelength_nm: float = _REFERENCE_NM) -> PrincipalMeridians:
        """Powers and directions of the principal meridians; see `isetcl.eye.astigmatism`."""
        from isetcl.eye import astigmatism

        return astigmatism.principal_meridians(self._as_eye(), wavelength_nm)

    def longitudinal_spherical_aberration_dpt(
        self,
        heights_mm: np.ndarray | Sequence[float],
        wavelength_nm: float = _REFERENCE_NM,
    ) -> np.ndarray:
        """Power for rays at heights less that on the axis, dpt, (n,); see `refraction_error`."""
        from isetcl.eye.aberrations import refraction_error

        return refraction_error.longitudinal_spherical_aberration_dpt(
            self._as_eye(), heights_mm, wavelength_nm
        )

    def through_focus(
        self,
        vergences_dpt: np.ndarray | Sequence[float],
        metric: FocusMetric = "strehl",
        field_deg: tuple[float, float] | float = (0.0, 0.0),
        wavelength_nm: float = _REFERENCE_NM,
        *,
        frequency_cpd: float = 10.0,
    ) -> np.ndarray:
        """Image quality for objects at vergences in 1/m, (n,).

        The wavefront of an object at infinity, with thin lenses in the entrance pupil; it has as
        many samples as the largest defocus needs. See `refraction_error.through_focus`.

        Parameters
        ----------
        vergences_dpt
            Vergences of the object, 1/m; 0 is infinity.
        metric
            ``"strehl"``, ``"rms"`` (um; smaller is better) or ``"mtf"`` (mean over directions at
            `frequency_cpd`).
        field_deg, wavelength_nm
            As in `Eye.wavefront`.
        frequency_cpd
            Frequency for ``"mtf"``, cycles/degree.

        Raises
        ------
        InvalidInputError
            If a defocus needs more than 512 samples across the pupil.
        """
        from isetcl.eye.aberrations import refraction_error

        front = self._sampled_for(vergences_dpt, field_deg, wavelength_nm)
        return refraction_error.through_focus(front, vergences_dpt, metric, frequency_cpd)

    def best_focus_dpt(
        self,
        metric: FocusMetric = "strehl",
        field_deg: tuple[float, float] | float = (0.0, 0.0),
        wavelength_nm: float = _REFERENCE_NM,
        *,
        frequency_cpd: float = 10.0,
    ) -> float:
        """Vergence of the object that is seen best, 1/m; see `refraction_error.best_focus_dpt`."""
        from isetcl.eye.aberrations import refraction_error

        front = self._as_eye().wavefront(field_deg, wavelength_nm)
        return refraction_error.best_focus_dpt(front, metric, frequency_cpd)

    def _sampled_for(
        self,
        vergences_dpt: np.ndarray | Sequence[float],
        field_deg: tuple[float, float] | float,
        wavelength_nm: float,
    ) -> Wavefront:
        """The wavefront of an object at infinity, sampled for any of these defoci."""
        eye = self._as_eye()
        front = eye.wavefront(field_deg, wavelength_nm)
        extremes = (float(np.min(vergences_dpt)), float(np.max(vergences_dpt)))
        needed = max(front.defocused(v).samples_needed() for v in extremes)
        if needed <= front.samples:
            return front
        return eye.wavefront(field_deg, wavelength_nm, samples=min(needed, _MOST_SAMPLES))
