"""PSFs with diffraction, from a pupil function, integrated over the squares of a grid."""

from __future__ import annotations

import math

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.eye.model import Eye
from isetcl.eye.waves.wavefront import Wavefront
from isetcl.psf_baseline.psf import Psf
from isetcl.psf_baseline.psfs.cells import binned, cropped, psf_of

MAX_SAMPLES = 1024

_FINE_SAMPLES = 33  # of a kernel's grid in a period of the pattern, at least
_ENOUGH_SAMPLES = 512


def wave_psf(
    eye: Eye,
    wavelength_nm: float,
    vergence_dpt: float,
    pitch_deg: float,
    field_deg: tuple[float, float] = (0.0, 0.0),
    *,
    reach_deg: float = 2.0,
) -> Psf:
    """The PSF of an eye's own wavefront, with diffraction (Fraunhofer).

    Relative to the chief ray of its own wavelength, as `geometric_psf`.

    Raises
    ------
    InvalidInputError
        If the defocus needs more than 1024 samples across the pupil.
    """
    distance = 1.0 / vergence_dpt if vergence_dpt > 0 else math.inf
    samples: int | None = None
    while True:
        front = eye.wavefront(field_deg, wavelength_nm, object_distance_m=distance, samples=samples)
        if not front.is_sampled:
            samples = _more(front, front.samples_needed())
            continue
        kernel = pupil_kernel(front.pupil_function(), front.step_cpd, pitch_deg)
        kept = cropped(kernel, reach_deg / pitch_deg)
        # The tails of a pattern that nearly fills its period lie in its middle.
        crowded = kept.shape[0] * pitch_deg > 0.5 / front.step_cpd
        if not crowded or front.samples >= _ENOUGH_SAMPLES:
            return psf_of(kept, pitch_deg)
        samples = 2 * front.samples


def _more(front: Wavefront, wanted: int) -> int:
    if wanted > MAX_SAMPLES or wanted <= front.samples:
        raise InvalidInputError(
            f"an object at {front.vergence_dpt:g} dpt is so far out of focus that its wavefront "
            f"needs {wanted} samples across the pupil, more than {MAX_SAMPLES}; use psf='geometric'"
            ", a smaller stop, or objects nearer to focus"
        )
    return wanted


def pupil_kernel(pupil: np.ndarray, step_cpd: float, pitch_deg: float) -> np.ndarray:
    """Shares of the flux on a grid, (m, m), m odd, of one whole period 1/step of the pattern.

    The transfer function, the autocorrelation of the pupil function, times the transform of a
    square, sinc(f_x p) sinc(f_y p), summed back onto the grid. Light farther out than the period
    is folded into it, so that none is lost.

    Parameters
    ----------
    pupil : ndarray, (n, n), complex
        Pupil function; row 0 is the upper side.
    step_cpd
        Distance of its samples, cycles/degree.
    pitch_deg
        Width of a square, degrees.
    """
    factor = 2 * math.ceil((_FINE_SAMPLES * pitch_deg * step_cpd - 1.0) / 2.0) + 1
    if factor > 1:
        return binned(pupil_kernel(pupil, step_cpd, pitch_deg / factor), factor)
    n = pupil.shape[0]
    transfer = np.fft.ifft2(np.abs(np.fft.fft2(pupil, (2 * n, 2 * n))) ** 2)
    transfer = np.fft.fftshift(transfer / transfer[0, 0].real)
    f = (np.arange(2 * n) - n) * step_cpd
    square = np.sinc(f * pitch_deg) * pitch_deg * step_cpd
    transfer *= square[:, None] * square[None, :]
    half = int((1.0 / (step_cpd * pitch_deg) - 1.0) / 2.0)
    v = np.arange(-half, half + 1) * pitch_deg
    # The transform of a real pattern: the columns of negative f repeat those of positive f.
    twice = np.where(np.arange(n) == 0, 1.0, 2.0)
    by_column = np.exp(2j * np.pi * np.outer(f[n:], v)) * twice[:, None]
    # Rows of the pupil descend in y, and so do the lags and the rows of the kernel.
    by_row = np.exp(2j * np.pi * np.outer(v, f))
    kernel = ((by_row @ transfer[:, n:]) @ by_column).real
    return np.asarray(kernel.clip(0.0))
