"""Eyes known by their Zernike coefficients alone: their wavefront and transfer function."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_count,
    check_positive,
    check_type,
)
from isetcl.eye.waves.otf import check_frequencies
from isetcl.eye.waves.wavefront import Wavefront
from isetcl.eye.waves.zernike import ZernikeFit
from isetcl.spectrum import check_wavelengths, luminous_efficiency

# A nominal eye behind the pupil; it scales nothing but Huygens integration.
_FOCAL_MM = 16.67
_VITREOUS_INDEX = 1.336
_RIM_SAMPLES = 16
_AZIMUTHS = 36
_AUTO_SAMPLES = (64, 512)

# Thibos, Ye, Zhang & Bradley 1992, Appl Opt 31:3594: index of the chromatic reduced eye, radius of
# its surface, and the index at 589 nm.
_CHROMATIC_RADIUS_M = 5.55e-3
_CHROMATIC_N_D = 1.333


def wavefront_of(
    zernike: ZernikeFit,
    *,
    pupil_diameter_mm: float | None = None,
    wavelength_nm: float | None = None,
    samples: int = 64,
) -> Wavefront:
    """The wavefront of an eye with given Zernike coefficients and a round pupil.

    A thin pupil that meets the sine condition: a ray at x mm in the entrance pupil has the spatial
    frequency x / lambda. What needs more than the pupil (Huygens integration) takes a nominal eye.

    Parameters
    ----------
    zernike
        Coefficients in the sense of `Wavefront`.
    pupil_diameter_mm
        Diameter of the pupil, at most that of the coefficients' circle; None takes all of it.
    wavelength_nm
        Wavelength of the light; None is that of the coefficients. The wavefront in um is kept.
    samples
        Samples across the pupil, 16 to 1024.

    Raises
    ------
    InvalidInputError
        If the pupil is larger than the circle, where the coefficients say nothing.
    """
    check_type("zernike", zernike, ZernikeFit)
    count = check_count("samples", samples, 16, 1024)
    nm = zernike.wavelength_nm
    if wavelength_nm is not None:
        nm = check_positive("wavelength_nm", wavelength_nm, "nm")
    radius = zernike.radius_mm
    if pupil_diameter_mm is not None:
        radius = check_positive("pupil_diameter_mm", pupil_diameter_mm, "mm") / 2.0
    if radius > zernike.radius_mm * (1.0 + 1e-9):
        raise InvalidInputError(
            f"pupil_diameter_mm must be at most {2 * zernike.radius_mm:g} mm, where the Zernike "
            f"coefficients end, got {2 * radius:g} mm"
        )
    axis = (np.arange(count) - (count - 1) / 2.0) * 2.0 / count
    x, y = np.meshgrid(axis, -axis)
    cover = _cover(count)
    inside = cover > 0
    per_mm = math.radians(1.0) / (nm * 1e-6)
    place = radius * np.stack([x, y], axis=-1)
    step_mm = 2.0 * radius / count
    return Wavefront(
        opd_um=np.where(inside, zernike.opd_um(place[..., 0], place[..., 1]), np.nan),
        amplitude=cover / math.sqrt(cover.sum()),
        flux=cover / cover.sum(),
        x_cpd=radius * axis * per_mm,
        y_cpd=-radius * axis * per_mm,
        entrance_mm=np.where(inside[..., None], place, np.nan),
        area_mm2=cover * step_mm**2,
        entrance_radius_mm=radius,
        wavelength_nm=nm,
        field_deg=(0.0, 0.0),
        vergence_dpt=0.0,
        centre_mm=np.array([0.0, 0.0, _FOCAL_MM * _VITREOUS_INDEX]),
        radius_mm=_FOCAL_MM * _VITREOUS_INDEX,
        mm_per_deg=-math.radians(_FOCAL_MM) * np.eye(3)[:2],
        vitreous_index=_VITREOUS_INDEX,
    )


def radial_mtf(
    zernike: ZernikeFit,
    frequency_cpd: np.ndarray | Sequence[float],
    *,
    pupil_diameter_mm: float | None = None,
    wavelengths_nm: np.ndarray | Sequence[float] | None = None,
    focus_nm: float = 560.0,
    samples: int | None = None,
) -> np.ndarray:
    """Modulation transfer in white light, the mean over all orientations, (n,).

    The modulus of the mean OTF over wavelengths, weighted by V(lambda) for equal energy; defocus
    changes with wavelength as in the chromatic reduced eye, nothing else does.

    Parameters
    ----------
    frequency_cpd
        Frequencies, cycles/degree.
    wavelengths_nm
        Ascending wavelengths, nm; None is 420 to 700 nm in steps of 20 nm. One alone gives the
        transfer in that light.
    focus_nm
        Wavelength at which the coefficients hold as they are, nm.
    samples
        Samples across the pupil; None takes 64, or what the aberrations need (up to 512).

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule, or the samples are too few for the aberrations.
    """
    frequency = check_frequencies(frequency_cpd)
    grid = check_wavelengths(
        np.arange(420.0, 701.0, 20.0) if wavelengths_nm is None else wavelengths_nm
    )
    share = luminous_efficiency(grid) if len(grid) > 1 else np.ones(1)
    if not share.sum() > 0.0:
        raise InvalidInputError(
            f"wavelengths_nm must hold visible light, got {grid[0]:g} to {grid[-1]:g} nm"
        )
    turn = np.arange(_AZIMUTHS) * np.pi / _AZIMUTHS
    x, y = np.outer(np.cos(turn), frequency), np.outer(np.sin(turn), frequency)
    total = np.zeros(x.shape, dtype=complex)
    for nm, part in zip(grid, share / share.sum(), strict=True):
        # In the blue the eye is too strong, as if a lens of so much power stood before it.
        lens = float(chromatic_difference_dpt(focus_nm) - chromatic_difference_dpt(float(nm)))

        def front(count: int, nm: float = float(nm), lens: float = lens) -> Wavefront:
            return wavefront_of(
                zernike, pupil_diameter_mm=pupil_diameter_mm, wavelength_nm=nm, samples=count
            ).with_lens(lens)

        sampled = front(_AUTO_SAMPLES[0] if samples is None else samples)
        if samples is None and sampled.samples_needed() > sampled.samples:
            sampled = front(min(sampled.samples_needed(), _AUTO_SAMPLES[1]))
        total += part * sampled.otf().at(x, y)
    return np.asarray(np.mean(np.abs(total), axis=0))


def chromatic_difference_dpt(wavelength_nm: np.ndarray | float) -> np.ndarray:
    """Refraction of the chromatic reduced eye relative to 589 nm, dpt; negative in the blue.

    (n(589) - n(lambda)) / (n_D r), n = 1.320535 + 0.004685 / (lambda - 0.214102), lambda in um.

    Source: Thibos, Ye, Zhang & Bradley 1992, Appl Opt 31:3594.
    """
    nm = check_array("wavelength_nm", wavelength_nm)
    if not np.all(nm > 300.0):
        raise InvalidInputError("wavelength_nm must be > 300 nm for the chromatic reduced eye")
    change = _chromatic_index(np.array(589.0)) - _chromatic_index(nm)
    return np.asarray(change / (_CHROMATIC_N_D * _CHROMATIC_RADIUS_M))


def _chromatic_index(wavelength_nm: np.ndarray) -> np.ndarray:
    return np.asarray(1.320535 + 0.004685 / (wavelength_nm * 1e-3 - 0.214102))


def _cover(samples: int) -> np.ndarray:
    """The part of every cell of a square grid that lies in the circle it encloses, (n, n)."""
    fine = (np.arange(samples * _RIM_SAMPLES) + 0.5) * 2.0 / (samples * _RIM_SAMPLES) - 1.0
    inside = fine[:, None] ** 2 + fine[None, :] ** 2 <= 1.0
    cells = inside.reshape(samples, _RIM_SAMPLES, samples, _RIM_SAMPLES)
    return np.asarray(cells.mean(axis=(1, 3)))
