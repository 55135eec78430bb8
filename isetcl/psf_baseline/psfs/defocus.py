"""PSFs of simple lenses: what is known of the eye is its pupil and where it is focused."""

from __future__ import annotations

import math

import numpy as np

from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.psf_baseline.psf import Psf
from isetcl.psf_baseline.psfs.cells import (
    checked_half,
    cropped,
    disc_cells,
    gaussian_cells,
    psf_of,
)
from isetcl.psf_baseline.psfs.wave import MAX_SAMPLES, pupil_kernel
from isetcl.units import MM_PER_M, NM_PER_MM

# Marimont & Wandell 1994, J Opt Soc Am A 11:3113: q1 dpt, q2 dpt um, q3 um.
_Q1, _Q2, _Q3 = 1.7312, 0.63346, 0.21410

_GAUSSIAN_REACH = 5.3
_LARGEST_STEP_WAVES = 0.25
_LEAST_SAMPLES, _ENOUGH_SAMPLES = 64, 512


def disc_psf(
    eye: Eye,
    wavelength_nm: float,
    vergence_dpt: float,
    pitch_deg: float,
    field_deg: tuple[float, float] = (0.0, 0.0),
    *,
    reach_deg: float = 2.0,
) -> Psf:
    """The blur disc of a thin lens, of diameter pupil |dD| radians, in exact areas of squares.

    The defocus dD is counted at the entrance pupil, from the vergence of smallest spot at 550 nm.
    The lens has no colour, no aberration and the same blur all over the field.
    """
    radius_deg = _radius_deg(eye, vergence_dpt)
    kernel = _disc(radius_deg / pitch_deg)
    return psf_of(kernel, pitch_deg)


def _disc(radius: float) -> np.ndarray:
    if radius < 1e-9:
        return np.ones((1, 1))
    return disc_cells(checked_half(radius), radius)


def gaussian_psf(
    eye: Eye,
    wavelength_nm: float,
    vergence_dpt: float,
    pitch_deg: float,
    field_deg: tuple[float, float] = (0.0, 0.0),
    *,
    reach_deg: float = 2.0,
) -> Psf:
    """A Gaussian of the variance of `disc_psf`: a standard deviation of half its radius."""
    sigma = _radius_deg(eye, vergence_dpt) / 2.0 / pitch_deg
    if sigma < 1e-9:
        return psf_of(np.ones((1, 1)), pitch_deg)
    return psf_of(gaussian_cells(checked_half(_GAUSSIAN_REACH * sigma), sigma), pitch_deg)


def chromatic_defocus_psf(
    eye: Eye,
    wavelength_nm: float,
    vergence_dpt: float,
    pitch_deg: float,
    field_deg: tuple[float, float] = (0.0, 0.0),
    *,
    reach_deg: float = 2.0,
) -> Psf:
    """Diffraction and defocus of a reduced eye with the human longitudinal colour.

    A round pupil of the eye's size without aberration; the defocus is that of the object plus the
    chromatic difference of refraction from 550 nm, `chromatic_difference_dpt`. The published
    model multiplies the transfer further by a measured fall at high frequencies, which is left out
    here.

    Source: Marimont & Wandell 1994, J Opt Soc Am A 11:3113.
    """
    colour = chromatic_difference_dpt(wavelength_nm) - chromatic_difference_dpt(
        REFERENCE_WAVELENGTH_NM
    )
    # Where refraction is negative the eye is myopic: focused on what is nearer.
    defocus = _defocus_dpt(eye, vergence_dpt) + colour
    radius_mm = _pupil_radius_mm(eye)
    samples = _samples(radius_mm, defocus, wavelength_nm)
    while True:
        step_mm = 2.0 * radius_mm / (samples - 1)
        r = np.arange(samples) - (samples - 1) // 2
        step_cpd = step_mm * NM_PER_MM / wavelength_nm * math.pi / 180.0
        squared = (r[None, :] ** 2 + r[:, None] ** 2) * step_mm**2
        # mm^2 / m = um = 1000 nm.
        phase = math.pi * squared * defocus * 1000.0 / wavelength_nm
        cells = disc_cells(samples // 2, radius_mm / step_mm)
        pupil = cells * np.exp(1j * phase)
        kernel = pupil_kernel(pupil, step_cpd, pitch_deg)
        kept = cropped(kernel, reach_deg / pitch_deg)
        crowded = kept.shape[0] * pitch_deg > 0.5 / step_cpd
        if not crowded or samples >= _ENOUGH_SAMPLES:
            return psf_of(kept, pitch_deg)
        samples = 2 * samples - 1


def chromatic_difference_dpt(wavelength_nm: float) -> float:
    """Refraction of the reduced eye less that at 580 nm, dpt: q1 - q2 / (lambda - q3).

    Source: Marimont & Wandell 1994, J Opt Soc Am A 11:3113.
    """
    return _Q1 - _Q2 / (wavelength_nm / 1000.0 - _Q3)


def _samples(radius_mm: float, defocus_dpt: float, wavelength_nm: float) -> int:
    """Samples across the pupil (odd) at which the phase is resolved, as many as are allowed."""
    # W = dD r^2 / 2: its steepest step, at the rim, is dD r (2 r / n).
    waves = abs(defocus_dpt) * 2.0 * radius_mm**2 * 1000.0 / wavelength_nm
    wanted = max(_LEAST_SAMPLES, math.ceil(waves / _LARGEST_STEP_WAVES))
    return min(wanted, MAX_SAMPLES) // 2 * 2 + 1


def _pupil_radius_mm(eye: Eye) -> float:
    return eye.entrance_pupil(REFERENCE_WAVELENGTH_NM).radius_mm


def _defocus_dpt(eye: Eye, vergence_dpt: float) -> float:
    """Vergence of an object less that of the focus at 550 nm, at the entrance pupil, dpt."""
    depth_m = eye.entrance_pupil(REFERENCE_WAVELENGTH_NM).z_mm / MM_PER_M
    focus = eye.focus_vergence_dpt(REFERENCE_WAVELENGTH_NM)
    return vergence_dpt / (1.0 + vergence_dpt * depth_m) - focus / (1.0 + focus * depth_m)


def _radius_deg(eye: Eye, vergence_dpt: float) -> float:
    pupil_m = _pupil_radius_mm(eye) / MM_PER_M
    return math.degrees(pupil_m * abs(_defocus_dpt(eye, vergence_dpt)))
