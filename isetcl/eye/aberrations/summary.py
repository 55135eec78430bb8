"""The numbers by which an eye is known, gathered: for tables, files and pages."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from isetcl.errors import IsetclError
from isetcl.eye.aberrations.refraction_error import Refraction
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.paraxial import CardinalPoints, Pupil
from isetcl.eye.waves.wavefront import Wavefront
from isetcl.eye.waves.zernike import ZernikeFit

T = TypeVar("T")

LCA_RANGE_NM = (400.0, 700.0)
ZERNIKE_ORDER = 4


@dataclass(frozen=True, eq=False)
class FieldSummary:
    """What an eye does to light from one field angle; None where the eye does not allow it.

    Attributes
    ----------
    field_deg
        Field angle upwards, degrees.
    spot_rms_arcmin
        Root-mean-square radius of the spot, arcmin.
    rms_um, strehl
        Of the wavefront of the object, without tilt.
    zernike
        Its Zernike fit of order 4.
    refraction
        The lens that corrects the eye for infinity, by the least RMS.
    tangential_dpt, sagittal_dpt
        Refraction of narrow pencils, see `ObliqueFoci`.
    """

    field_deg: float
    spot_rms_arcmin: float | None
    rms_um: float | None
    strehl: float | None
    zernike: ZernikeFit | None
    refraction: Refraction | None
    tangential_dpt: float | None
    sagittal_dpt: float | None


@dataclass(frozen=True, eq=False)
class EyeSummary:
    """Numbers of an eye; None where the eye does not allow one.

    Attributes
    ----------
    name, wavelength_nm, object_distance_m
        The eye, the wavelength of all numbers but LCA, and where the object of wavefronts and spots
        lies (m from the corneal vertex).
    axial_length_mm
        Corneal to retinal vertex.
    cardinal, entrance_pupil, exit_pupil
        Paraxial optics.
    focus_paraxial_dpt, focus_rms_dpt
        Vergence of the axial object in focus, 1/m from the corneal vertex: paraxially, and by the
        smallest spot.
    max_field_deg
        The largest field angle whose chief ray reaches the retina.
    lca_dpt, lca_range_nm
        Longitudinal chromatic aberration between two wavelengths.
    fields
        What depends on the field angle.
    """

    name: str
    wavelength_nm: float
    object_distance_m: float
    axial_length_mm: float
    cardinal: CardinalPoints
    entrance_pupil: Pupil
    exit_pupil: Pupil
    focus_paraxial_dpt: float | None
    focus_rms_dpt: float | None
    max_field_deg: float | None
    lca_dpt: float | None
    lca_range_nm: tuple[float, float]
    fields: tuple[FieldSummary, ...]

    def as_dict(self) -> dict[str, Any]:
        """All numbers as plain JSON-ready values; an infinite distance is None."""
        values = dataclasses.asdict(self)
        if math.isinf(self.object_distance_m):
            values["object_distance_m"] = None
        values["lca_range_nm"] = list(self.lca_range_nm)
        for field, described in zip(self.fields, values["fields"], strict=True):
            if field.zernike is not None:
                described["zernike"]["coefficients_um"] = field.zernike.coefficients_um.tolist()
        return values


def summarise(
    eye: Eye,
    fields_deg: Sequence[float] = (0.0, 5.0, 10.0),
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
    *,
    object_distance_m: float = math.inf,
) -> EyeSummary:
    """The numbers of an eye.

    Parameters
    ----------
    fields_deg
        Field angles upwards, degrees.
    wavelength_nm
        Wavelength, nm.
    object_distance_m
        Distance of the object of wavefronts and spots from the corneal vertex, m.

    Raises
    ------
    InvalidInputError
        If the wavelength lies outside the range of a medium.
    """
    low, high = eye.wavelength_range_nm()
    ends = (max(LCA_RANGE_NM[0], low), min(LCA_RANGE_NM[1], high))
    return EyeSummary(
        name=eye.name,
        wavelength_nm=wavelength_nm,
        object_distance_m=object_distance_m,
        axial_length_mm=eye.axial_length_mm,
        cardinal=eye.cardinal_points(wavelength_nm),
        entrance_pupil=eye.entrance_pupil(wavelength_nm),
        exit_pupil=eye.exit_pupil(wavelength_nm),
        focus_paraxial_dpt=_or_none(lambda: eye.focus_vergence_dpt(wavelength_nm, "paraxial")),
        focus_rms_dpt=_or_none(lambda: eye.focus_vergence_dpt(wavelength_nm)),
        max_field_deg=_or_none(lambda: eye.field_map(wavelength_nm).max_field_deg),
        lca_dpt=_or_none(lambda: float(np.ptp(eye.lca_dpt(ends)))),
        lca_range_nm=ends,
        fields=tuple(
            _field_summary(eye, float(field), wavelength_nm, object_distance_m)
            for field in fields_deg
        ),
    )


def _field_summary(
    eye: Eye, field_deg: float, wavelength_nm: float, object_distance_m: float
) -> FieldSummary:
    def spot_rms() -> float:
        rays = eye.spot(field_deg, wavelength_nm, object_distance_m=object_distance_m)
        return rays.rms_arcmin

    def wavefront() -> Wavefront:
        return eye.wavefront(field_deg, wavelength_nm, object_distance_m=object_distance_m)

    front = _or_none(wavefront)
    foci = _or_none(lambda: eye.oblique_foci(field_deg, wavelength_nm))
    return FieldSummary(
        field_deg,
        _or_none(spot_rms),
        None if front is None else front.rms_um,
        None if front is None else _or_none(front.strehl),
        None if front is None else _or_none(lambda: front.zernike(ZERNIKE_ORDER)),
        _or_none(lambda: eye.refraction(field_deg, wavelength_nm)),
        None if foci is None else float(foci.tangential_dpt[0]),
        None if foci is None else float(foci.sagittal_dpt[0]),
    )


def _or_none(compute: Callable[[], T]) -> T | None:
    """A value, or None where the eye does not allow it."""
    try:
        return compute()
    except IsetclError:
        return None
