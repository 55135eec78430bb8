"""How far rays spread, as a PSF that nothing is blurred with: for methods that follow rays."""

from __future__ import annotations

import math

import numpy as np

from isetcl.eye.model import Eye
from isetcl.psf_baseline.outgoing import gathered_deg
from isetcl.psf_baseline.psf import Psf
from isetcl.psf_baseline.psfs.registry import PsfKind

_RAYS = 1024
# The outermost of so many rays lie up to 6 % of the radius inside the pupil's border.
_ROOM = 1.08


def reach_psf(
    eye: Eye,
    wavelength_nm: float,
    vergence_dpt: float,
    pitch_deg: float,
    field_deg: tuple[float, float] = (0.0, 0.0),
    *,
    reach_deg: float = 2.0,
) -> Psf:
    """A point in a kernel as large as `gathered_psf`'s, which takes a fraction of its time.

    Views are as large as the PSFs of their layers; methods that follow rays use nothing else of
    them.
    """
    x, y, _ = gathered_deg(eye, wavelength_nm, vergence_dpt, field_deg, _RAYS)
    half = math.ceil(_ROOM * float(max(np.abs(x).max(), np.abs(y).max())) / pitch_deg) + 1
    kernel = np.zeros((2 * half + 1, 2 * half + 1))
    kernel[half, half] = 1.0
    return Psf(kernel, pitch_deg, 0.0)


REACH = PsfKind(
    "reach",
    reach_psf,
    "how far the eye's own rays spread",
    "blurs nothing",
    knows_wavelength=True,
    knows_depth=True,
    knows_field=True,
)
