"""Transfer functions in light of many wavelengths."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_choice
from isetcl.eye.aberrations import geometric
from isetcl.eye.aberrations.chromatic import tca_arcmin
from isetcl.eye.model import Eye, check_eye_wavelengths
from isetcl.eye.waves.otf import check_frequencies
from isetcl.eye.waves.wavefront_trace import wavefront
from isetcl.spectrum import check_wavelengths, luminous_efficiency
from isetcl.units import ARCMIN_PER_DEG

Model = Literal["diffraction", "geometric"]

PEAK_NM = 555.0
"""Peak of V(lambda), nm: the wavelength of the scale and of the chief ray that is the origin."""


def polychromatic_otf(
    eye: Eye,
    frequency_cpd: np.ndarray | Sequence[float],
    *,
    field_deg: tuple[float, float] | float = (0.0, 0.0),
    orientation_deg: float = 0.0,
    wavelengths_nm: np.ndarray | Sequence[float] | None = None,
    weights: np.ndarray | Sequence[float] | None = None,
    model: Model = "diffraction",
    object_distance_m: float = math.inf,
    stiles_crawford: float | None = None,
    defocus_dpt: float = 0.0,
) -> np.ndarray:
    """Complex OTF of an eye for light of many wavelengths, (n,).

    The weighted mean of the OTFs of all wavelengths about one point of the retina, phases and the
    transverse chromatic aberration included.

    Parameters
    ----------
    frequency_cpd
        Frequencies, cycles/degree.
    field_deg, object_distance_m, stiles_crawford
        As in `Eye.wavefront`. The geometric model takes no Stiles-Crawford effect.
    orientation_deg
        Direction across the stripes; see `OpticalTransfer.mtf`.
    wavelengths_nm
        Ascending wavelengths; None is 410 to 700 nm in steps of 10 nm.
    weights
        Weight of every wavelength; None is V(lambda), for light of equal energy.
    model
        ``"diffraction"`` or ``"geometric"``.
    defocus_dpt
        How much nearer the object is, 1/m; see `Wavefront.defocused`. Diffraction only.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule.
    """
    frequency = check_frequencies(frequency_cpd)
    check_choice("model", model, ("diffraction", "geometric"))
    grid = check_wavelengths(
        np.arange(410.0, 701.0, 10.0) if wavelengths_nm is None else wavelengths_nm
    )
    check_eye_wavelengths(eye, grid)
    share = luminous_efficiency(grid) if weights is None else check_array("weights", weights)
    if share.shape != grid.shape or not np.all(share >= 0) or not share.sum() > 0:
        raise InvalidInputError(
            f"weights must be one number >= 0 per wavelength, not all 0, got {share.tolist()}"
        )
    if model == "geometric" and (stiles_crawford is not None or defocus_dpt != 0.0):
        raise InvalidInputError(
            "the geometric model takes neither stiles_crawford nor defocus_dpt; use "
            "model='diffraction' or object_distance_m"
        )
    angle = math.radians(orientation_deg)
    across = np.array([math.cos(angle), math.sin(angle)])
    shifts = tca_arcmin(eye, field_deg, grid, PEAK_NM, object_distance_m) / ARCMIN_PER_DEG @ across
    total = np.zeros(len(frequency), dtype=complex)
    for wavelength, part, shift in zip(grid, share / share.sum(), shifts, strict=True):
        if model == "geometric":
            rays = geometric.spot(
                eye,
                field_deg,
                float(wavelength),
                object_distance_m=object_distance_m,
                scale_wavelength_nm=PEAK_NM,
            )
            values = rays.otf(frequency, orientation_deg)
        else:
            front = wavefront(
                eye,
                field_deg,
                float(wavelength),
                object_distance_m=object_distance_m,
                stiles_crawford=stiles_crawford,
                scale_wavelength_nm=PEAK_NM,
            )
            front = front.defocused(defocus_dpt) if defocus_dpt else front
            values = front.otf().along(frequency, orientation_deg)
        total += part * values * np.exp(-2j * np.pi * frequency * shift)
    return total


def polychromatic_mtf(
    eye: Eye, frequency_cpd: np.ndarray | Sequence[float], **options: object
) -> np.ndarray:
    """Modulus of `polychromatic_otf`, which takes the same arguments, (n,)."""
    return np.abs(polychromatic_otf(eye, frequency_cpd, **options))  # type: ignore[arg-type]
